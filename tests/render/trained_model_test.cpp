// SPDX-License-Identifier: Apache-2.0
// Reference, CPU and Vulkan agree on a model that came out of training, output by output: docs/sample.tgz, or the
// bundle that the environment names as TG_MODEL.
#include <algorithm>
#include <cstdlib>
#include <iostream>

#include "core/bundle.h"
#include "render/reference/reference.h"
#include "support/catch.h"
#include "support/compare.h"
#include "vulkan_device.h"

namespace tg {
namespace {

// Trained splats are thin and many lie on one another, so more pixels than in random scenes see a threshold fall the
// other way, and depth moves with them.
const test::Tolerance kTrained{.tight = 2e-5, .outlier_share = 2e-2, .loose = 1e-3, .flip = 5e-2, .depth_factor = 10};

TEST_CASE("Reference, CPU and Vulkan show a trained model alike in every output") {
  const char* other = std::getenv("TG_MODEL");
  const Bundle bundle = readBundle(other ? other : "docs/sample.tgz");
  REQUIRE(bundle.model.texture_mode == TextureMode::rgba);
  const Camera& view = bundle.cameras.at(bundle.cameras.size() / 2);
  const int longer = std::max(view.width, view.height);
  const Camera camera = resized(view, 96 * view.width / longer, 96 * view.height / longer);
  const auto intersection = GENERATE(IntersectionModel::maxResponse, IntersectionModel::plane);
  const RenderSettings settings{TextureMode::rgba, intersection, bundle.background};
  const FrameT<double> reference = renderReference(ReferenceModel(bundle.model), camera, settings);

  const auto cpu = makeCpuRenderer();
  cpu->setModel(bundle.model);
  const Frame cpu_frame = cpu->render(camera, settings);
  const auto cpu_difference = test::compareFrames(cpu_frame, reference, kTrained);
  std::cout << "CPU against the reference, " << name(intersection) << "\n" << test::report(cpu_difference);
  CHECK(test::violations(cpu_difference, kTrained) == "");

  VulkanRenderer& vulkan = test::vulkanRenderer();
  vulkan.setModel(bundle.model);
  const auto vulkan_difference = test::compareFrames(vulkan.render(camera, settings), reference, kTrained);
  std::cout << "Vulkan against the reference, " << name(intersection) << "\n" << test::report(vulkan_difference);
  CHECK(test::violations(vulkan_difference, kTrained) == "");
  CHECK(test::validationMessages() == "");
}

}  // namespace
}  // namespace tg
