// SPDX-License-Identifier: Apache-2.0
// Devices that offer little: what Vulkan promises of every one, and what passes need beyond.
#include "core/bundle/bundle.h"
#include "core/image/metrics.h"
#include "render/vulkan/check.h"
#include "render/vulkan/pass_device.h"
#include "render/vulkan/vulkan_renderer.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

namespace {

VkQueueFlags hidden_queues = 0;  // what the driver's families of queues do not say that they can do

// The least values of the specification (table "Required Limits") of what a pass, a buffer or an image asks for.
VkPhysicalDeviceLimits leastLimits() {
  VkPhysicalDeviceLimits limits{};
  limits.maxImageDimension2D = 4096;
  limits.maxTexelBufferElements = 65536;
  limits.maxStorageBufferRange = 1u << 27;
  limits.maxPerStageDescriptorStorageBuffers = 4;
  limits.maxComputeSharedMemorySize = 16384;
  limits.maxComputeWorkGroupInvocations = 128;
  limits.maxComputeWorkGroupSize[0] = 128;
  limits.minUniformBufferOffsetAlignment = 256;
  return limits;
}

class HiddenQueues {
 public:
  explicit HiddenQueues(VkQueueFlags flags) { hidden_queues = flags; }
  HiddenQueues& operator=(HiddenQueues&&) = delete;
  ~HiddenQueues() { hidden_queues = 0; }
};

}  // namespace

// The linker puts it before Vulkan's own (--wrap).
extern "C" {
void __real_vkGetPhysicalDeviceQueueFamilyProperties(VkPhysicalDevice, std::uint32_t*, VkQueueFamilyProperties*);

void __wrap_vkGetPhysicalDeviceQueueFamilyProperties(VkPhysicalDevice device, std::uint32_t* count,
                                                     VkQueueFamilyProperties* families) {
  __real_vkGetPhysicalDeviceQueueFamilyProperties(device, count, families);
  for (std::uint32_t i = 0; families && i < *count; ++i) families[i].queueFlags &= ~hidden_queues;
}
}

TEST_CASE("what a device lacks is named, one thing after the other, until it suffices") {
  VkPhysicalDeviceLimits limits = leastLimits();
  CHECK(whatLimitsLack(limits) == "11 storage buffers per stage");
  limits.maxPerStageDescriptorStorageBuffers = 11;
  CHECK(whatLimitsLack(limits) == "workgroups of 256 threads");
  limits.maxComputeWorkGroupInvocations = limits.maxComputeWorkGroupSize[0] = 256;
  CHECK(whatLimitsLack(limits) == "20480 bytes of shared memory");
  limits.maxComputeSharedMemorySize = 20480;
  CHECK(whatLimitsLack(limits).empty());
  limits.maxPerStageDescriptorStorageBuffers = 7;
  CHECK_FALSE(whatLimitsLack(limits).empty());
  limits.maxTexelBufferElements = 1u << 27;  // then passes bind fewer storage buffers
  CHECK(whatLimitsLack(limits).empty());
}

TEST_CASE("a device whose queues compute and draw no triangles renders, one whose queues cannot compute is refused") {
  const TestScene scene = makeScene(SceneKind::ordinary, 3, 50);
  const auto draw = [&](VulkanDevice& device) {
    const auto renderer = makeVulkanRenderer(device);
    renderer->setModel(scene.model);
    return renderer->render(scene.camera, {});
  };
  const Frame expected = draw(*createVulkanDevice({}));
  {
    const HiddenQueues hidden(VK_QUEUE_GRAPHICS_BIT);
    CHECK(draw(*createVulkanDevice({})).base == expected.base);
  }
  const HiddenQueues hidden(VK_QUEUE_COMPUTE_BIT);
  CHECK_THROWS_WITH(createVulkanDevice({}), Contains("lacks a compute queue"));
}

TEST_CASE("buffers, which are whole multiples of 16 bytes, are no larger than what a device binds") {
  VkPhysicalDeviceProperties properties{};
  for (const std::uint32_t most : {~0u, 0x7FFFFFFFu, 0x10000001u}) {
    properties.limits.maxStorageBufferRange = properties.limits.maxTexelBufferElements = most;
    for (const bool storage_texels : {false, true}) {
      const GpuLimits limits = limitsOf(properties, storage_texels);
      CHECK(limits.storage_bytes == most / 16 * 16);
      CHECK(bufferBytes(std::uint64_t{4} * maxPairCapacity(limits, {})) <= most);
    }
  }
  properties.limits.maxTexelBufferElements = 70001;
  const GpuLimits texels = limitsOf(properties, false);
  CHECK(bufferBytes(std::uint64_t{4} * maxPairCapacity(texels, {})) / 4 <= 70001);
}

TEST_CASE("with Vulkan's least texel buffers a model of many times their size is drawn, to the same pixels",
          "[limits]") {
  VulkanOptions options;
  options.validation = true;
  const auto device = createVulkanDevice(options);
  const TestScene scene = makeScene(SceneKind::ordinary, 11, 8000, 96, 64);
  const auto draw = [&](ModelPrecision precision) {
    const auto renderer = makeVulkanRenderer(*device);
    renderer->setPrecision(precision);
    renderer->setModel(scene.model);
    return renderer->render(scene.camera, {});
  };
  VkPhysicalDeviceLimits& limits = device->properties.limits;
  const VkPhysicalDeviceLimits own = limits, least = leastLimits();
  for (const ModelPrecision precision : {ModelPrecision::exact, ModelPrecision::compact}) {
    device->storage_texels = false;
    const Frame expected = draw(precision);
    limits.maxImageDimension2D = least.maxImageDimension2D;
    limits.maxTexelBufferElements = least.maxTexelBufferElements;
    limits.maxStorageBufferRange = least.maxStorageBufferRange;
    limits.minUniformBufferOffsetAlignment = least.minUniformBufferOffsetAlignment;
    device->storage_texels = true;
    const Frame found = draw(precision);
    CHECK(found.base == expected.base);
    CHECK(found.texture == expected.texture);
    CHECK(found.depth == expected.depth);
    limits = own;
  }
  CHECK(device->validation_messages.empty());
}

TEST_CASE("the sample model, of 90,002 elements of texels, is drawn as the CPU draws it") {
  const auto device = createVulkanDevice({});
  const Bundle sample = readBundle("docs/sample.tgz");
  const Camera camera = resized(sample.cameras.front(), 160, 120);
  RenderSettings settings;
  settings.background = sample.background;
  const auto cpu = makeCpuRenderer();
  const auto vulkan = makeVulkanRenderer(*device);
  cpu->setModel(sample.model);
  vulkan->setModel(sample.model);
  const Image expected = visualize(cpu->render(camera, settings), Output::final);
  CHECK(psnr(visualize(vulkan->render(camera, settings), Output::final), expected) > 60);
}

TEST_CASE("a buffer that the device has no memory for is an error that names it and its size") {
  const auto device = createVulkanDevice({});
  VulkanPassDevice passes(*device, makePipelines(*device));
  CHECK_THROWS_WITH(passes.makeBuffer("the moon", std::uint64_t{1} << 50),
                    Contains("no memory for the moon (1073741824 MiB)"));
  CHECK_THROWS_AS(passes.makeBuffer("the moon", std::uint64_t{1} << 50), DoesNotFit);
}

TEST_CASE("an error of Vulkan names the function and the result, and no place in a source file") {
  CHECK_THROWS_WITH(checkVulkan(VK_ERROR_OUT_OF_DEVICE_MEMORY, "vkQueueSubmit(queue, 1, &submit, fence)"),
                    Catch::Matchers::Equals("Vulkan: out of device memory (-2) in vkQueueSubmit"));
}
