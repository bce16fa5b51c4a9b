// SPDX-License-Identifier: Apache-2.0
// Two recordings of a Vulkan renderer under way at once are the frames that it draws one after the other.
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "render/vulkan/buffer.h"
#include "render/vulkan/vulkan_renderer.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

namespace {

using DevicePtr = std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)>;

DevicePtr validatedDevice() {
  VulkanOptions options;
  options.validation = true;
  return createVulkanDevice(options);
}

FrameRequest requestFrom(const TestScene& scene, double angle) {
  FrameRequest request;
  request.camera = scene.camera;
  const glm::dmat3 turn(glm::dvec3(std::cos(angle), 0, -std::sin(angle)), glm::dvec3(0, 1, 0),
                        glm::dvec3(std::sin(angle), 0, std::cos(angle)));
  request.camera.rotation = turn * scene.camera.rotation;
  request.camera.translation = turn * scene.camera.translation;
  return request;
}

// A recording with its picture on the host.
class Flight {
 public:
  Flight(VulkanDevice& device, const Camera& camera)
      : commands_(device), pixels_(device, "a test's picture", 4 * size(camera), Memory::host) {}

  void start(VulkanRenderer& renderer, const FrameRequest& request) {
    commands_.start([&](VkCommandBuffer commands) {
      renderer.record(commands, request);
      stageBarrier(commands, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT);
      VkBufferImageCopy copy{};
      copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
      copy.imageExtent = {static_cast<std::uint32_t>(request.camera.size.x),
                          static_cast<std::uint32_t>(request.camera.size.y), 1};
      vkCmdCopyImageToBuffer(commands, renderer.image(), VK_IMAGE_LAYOUT_GENERAL, pixels_.handle(), 1, &copy);
      stageBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT);
    });
  }
  bool ended(std::uint64_t nanoseconds) { return commands_.finish(nanoseconds); }
  Image picture(const Camera& camera) const {
    return imageFromRgba8({pixels_.data(), 4 * size(camera)}, camera.size.x, camera.size.y);
  }

 private:
  static std::size_t size(const Camera& camera) { return static_cast<std::size_t>(camera.size.x) * camera.size.y; }
  Commands commands_;
  Buffer pixels_;
};

}  // namespace

TEST_CASE("two frames under way are the frames drawn alone, with their own counts and times") {
  const DevicePtr device = validatedDevice();
  const TestScene scene = makeScene(SceneKind::ordinary, 5, 2000, 160, 120);
  const auto renderer = makeVulkanRenderer(*device);
  renderer->setModel(scene.model);
  constexpr int kFrames = 6;
  std::vector<FrameRequest> requests;
  std::vector<Image> alone;
  std::vector<FrameCounts> counts;
  for (int i = 0; i < kFrames; ++i) {
    requests.push_back(requestFrom(scene, 0.05 * i));
    while (!renderer->draw(requests.back())) {
    }
    alone.push_back(renderer->picture());
    counts.push_back(renderer->counts());
  }
  REQUIRE(counts[0].pairs != counts[1].pairs);
  FrameRequest smaller = requests[0];
  smaller.camera.size.x /= 2;
  FrameRequest other_passes = requests[0];
  other_passes.output = Output::depth;
  CHECK(renderer->sharesProgram(requests[1]));
  CHECK_FALSE(renderer->sharesProgram(smaller));
  CHECK_FALSE(renderer->sharesProgram(other_passes));

  std::array<Flight, 2> flights = {Flight(*device, scene.camera), Flight(*device, scene.camera)};
  flights[0].start(*renderer, requests[0]);
  for (int i = 0; i < kFrames; ++i) {
    if (i + 1 < kFrames) flights[(i + 1) % 2].start(*renderer, requests[i + 1]);
    REQUIRE(flights[i % 2].ended(UINT64_MAX));
    REQUIRE(renderer->frameFits());
    REQUIRE(renderer->finishFrame());
    INFO(i);
    CHECK(flights[i % 2].picture(scene.camera).data == alone[i].data);
    CHECK(renderer->counts().visible == counts[i].visible);
    CHECK(renderer->counts().pairs == counts[i].pairs);
    CHECK(renderer->passTimes().size() >= 5);
  }
  CHECK(device->validation_messages == std::vector<std::string>());
}

TEST_CASE("a frame that overflows says so before its buffers grow, and the next recording is whole") {
  const DevicePtr device = validatedDevice();
  TestScene scene = makeScene(SceneKind::ordinary, 5, 20000, 320, 240);
  for (glm::vec3& scale : scene.model.log_scale) scale += 0.7f;
  const auto renderer = makeVulkanRenderer(*device);
  renderer->setModel(scene.model);
  std::array<Flight, 2> flights = {Flight(*device, scene.camera), Flight(*device, scene.camera)};
  const FrameRequest request = requestFrom(scene, 0);
  flights[0].start(*renderer, request);
  flights[1].start(*renderer, request);
  REQUIRE(flights[0].ended(UINT64_MAX));
  REQUIRE_FALSE(renderer->frameFits());
  REQUIRE(flights[1].ended(UINT64_MAX));
  CHECK_FALSE(renderer->finishFrame());
  CHECK_FALSE(renderer->sharesProgram(request));
  const auto reference = makeVulkanRenderer(*device);
  reference->setModel(scene.model);
  while (!reference->draw(request)) {
  }
  flights[0].start(*renderer, request);
  REQUIRE(flights[0].ended(UINT64_MAX));
  REQUIRE(renderer->finishFrame());
  CHECK(flights[0].picture(scene.camera).data == reference->picture().data);
  CHECK(device->validation_messages == std::vector<std::string>());
}

TEST_CASE("a frame of more pairs than a binding holds leaves nothing to the pictures after the one behind it",
          "[limits]") {
  const DevicePtr device = validatedDevice();
  TestScene scene = makeScene(SceneKind::ordinary, 4, 300, 90, 70);
  scene.model.atlas = {};
  device->properties.limits.maxTexelBufferElements = 4000;
  const auto renderer = makeVulkanRenderer(*device);
  renderer->setModel(scene.model);
  FrameRequest crowded = requestFrom(scene, 0);
  crowded.settings.splat_scale = 8.0f;
  const FrameRequest behind = requestFrom(scene, 0.1), next = requestFrom(scene, 0.2);
  REQUIRE(renderer->draw(behind));
  const FrameCounts of_behind = renderer->counts();
  REQUIRE(renderer->draw(next));
  const FrameCounts expected = renderer->counts();
  const Image alone = renderer->picture();
  REQUIRE(of_behind.pairs != expected.pairs);
  REQUIRE(renderer->sharesProgram(crowded));
  std::array<Flight, 2> flights = {Flight(*device, scene.camera), Flight(*device, scene.camera)};
  flights[0].start(*renderer, crowded);
  flights[1].start(*renderer, behind);
  REQUIRE(flights[0].ended(UINT64_MAX));
  REQUIRE_FALSE(renderer->frameFits());
  REQUIRE(flights[1].ended(UINT64_MAX));
  CHECK_THROWS_AS(renderer->finishFrame(), TooManyPairs);
  CHECK_FALSE(renderer->sharesProgram(next));
  flights[0].start(*renderer, next);
  REQUIRE(flights[0].ended(UINT64_MAX));
  REQUIRE(renderer->finishFrame());
  CHECK(renderer->counts().pairs == expected.pairs);
  CHECK(flights[0].picture(scene.camera).data == alone.data);
  CHECK(device->validation_messages == std::vector<std::string>());
}
