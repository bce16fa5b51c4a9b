// SPDX-License-Identifier: Apache-2.0
// All backends agree on a model that came out of training, output by output: docs/sample.tgz, or the bundle that the
// environment names as TG_MODEL.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iostream>

#include "core/bundle/bundle.h"
#include "core/system/error.h"
#include "render/devices/devices.h"
#include "render/reference/reference.h"
#include "support/catch.h"
#include "support/compare.h"

namespace tg {
namespace {

// Trained splats are thin and many lie on one another, so more pixels than in random scenes see a threshold fall the
// other way, and depth moves with them.
const test::Tolerance kTrained{.tight = 2e-5, .outlier_share = 2e-2, .loose = 1e-3, .flip = 5e-2, .depth_factor = 10};
// Of the pixels of any output, between any two backends: farther apart than 1e-3 of the larger of 1 and their size.
constexpr double kApart = 1e-3;
constexpr double kApartShare = 2e-2;

struct Backend {
  std::string name;
  Frame frame;
};

struct View {
  Bundle bundle;
  Camera camera;
};

View trainedView() {
  const char* other = std::getenv("TG_MODEL");
  View view{readBundle(other ? other : "docs/sample.tgz"), {}};
  const Camera& seen = view.bundle.cameras.at(view.bundle.cameras.size() / 2);
  const glm::ivec2 size = 96 * seen.size / std::max(seen.size.x, seen.size.y);
  view.camera = resized(seen, size.x, size.y);
  return view;
}

std::vector<Backend> drawnByAll(const View& view, const RenderSettings& settings) {
  std::vector<Backend> backends;
  const auto add = [&](std::string_view name, Renderer& renderer) {
    renderer.setModel(view.bundle.model);
    backends.push_back({std::string(name), renderer.render(view.camera, settings)});
  };
  backends.push_back(
      {"reference", test::rounded(renderReference(ReferenceModel(view.bundle.model), view.camera, settings))});
  add("cpu", *makeCpuRenderer());
  for (const Api api : kApis) {
    try {
      const auto device = openDevice(api, {{}, true});
      add(name(api), *device->makeRenderer());
      CHECK(device->messages().empty());
    } catch (const Error& error) {
      if (error.kind != ErrorKind::device) throw;
      std::cout << name(api) << " is left out: " << error.what() << "\n";
    }
  }
  return backends;
}

struct Apart {
  double largest = 0;
  double share = 0;  // of the pixels beyond kApart
};

Apart apart(const Frame& a, const Frame& b, Output output) {
  const Image x = extract(a, output), y = extract(b, output);
  REQUIRE(x.data.size() == y.data.size());
  REQUIRE(!x.data.empty());
  Apart result;
  std::size_t beyond = 0;
  for (std::size_t i = 0; i < x.data.size(); ++i) {
    const double difference = std::abs(double{x.data[i]} - y.data[i]);
    REQUIRE(std::isfinite(difference));
    result.largest = std::max(result.largest, difference);
    beyond += difference > kApart * std::max(1.0, std::abs(double{y.data[i]}));
  }
  result.share = static_cast<double>(beyond) / static_cast<double>(x.data.size());
  return result;
}

}  // namespace

TEST_CASE("every backend shows a trained model as the reference does") {
  const View view = trainedView();
  REQUIRE(view.bundle.model.texture_mode == TextureMode::rgba);
  const auto intersection = GENERATE(IntersectionModel::maxResponse, IntersectionModel::plane);
  RenderSettings settings;
  settings.intersection = intersection;
  settings.background = view.bundle.background;
  const auto reference = renderReference(ReferenceModel(view.bundle.model), view.camera, settings);
  for (const Backend& backend : drawnByAll(view, settings)) {
    if (backend.name == "reference") continue;
    const auto difference = test::compareFrames(backend.frame, reference, kTrained);
    std::cout << backend.name << " against the reference, " << name(intersection) << "\n" << test::report(difference);
    INFO(backend.name);
    CHECK(test::violations(difference, kTrained) == "");
  }
}

TEST_CASE("any two backends agree on a trained model in every output") {
  const View view = trainedView();
  RenderSettings settings;
  settings.background = view.bundle.background;
  settings.outputs = kAllOutputs;
  const std::vector<Backend> backends = drawnByAll(view, settings);
  REQUIRE(backends.size() >= 2);
  std::printf("largest difference, share of the numbers beyond %g\n%-14s", kApart, "");
  for (std::size_t a = 0; a < backends.size(); ++a) {
    for (std::size_t b = a + 1; b < backends.size(); ++b) {
      std::printf(" %20s", (backends[a].name + "/" + backends[b].name).c_str());
    }
  }
  for (const Output output : valuesOf<Output>()) {
    std::printf("\n%-14s", std::string(name(output)).c_str());
    for (std::size_t a = 0; a < backends.size(); ++a) {
      for (std::size_t b = a + 1; b < backends.size(); ++b) {
        const Apart found = apart(backends[a].frame, backends[b].frame, output);
        std::printf("  %9.2e %7.3f %%", found.largest, 100 * found.share);
        INFO(name(output) << ": " << backends[a].name << ", " << backends[b].name << ": " << found.largest);
        CHECK(found.share <= kApartShare);
      }
    }
  }
  std::printf("\n");
}

}  // namespace tg
