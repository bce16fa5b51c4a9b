// SPDX-License-Identifier: Apache-2.0
// What a trained model is written as.
#include "training/write_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <vector>

#include "converter/registry/file_format.h"
#include "core/tiny_model.h"
#include "shared/splat.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace tg;

TEST_CASE("a file that has room is written in parts of the steps that it was trained for") {
  const TemporaryFolder folder;
  const std::string path = (folder / "scene.sog").string();
  float steps = 8;
  Bundle scene;
  scene.model = asStored(path, tinyTexturedModel(3000), 0, steps);
  for (glm::vec3& color : scene.model.sh) color += 0.011f;  // has gone on, and lies on no grid
  const auto written = [&](std::uint64_t bytes) {
    writeScene(path, scene, true, "", true, {bytes, steps});
    return std::filesystem::file_size(path);
  };
  const std::uint64_t trained = written(0);
  CHECK(written(trained * 102 / 100) == trained);
  CHECK(written(trained * 99 / 100) <= trained * 99 / 100);
  const std::uint64_t most = trained * 2;
  const std::uint64_t finer = written(most);
  CHECK(finer > trained);
  CHECK(finer <= most);
  const auto sorted = [](const GaussianModel& model) {
    std::vector<float> all;
    for (const glm::vec3& mean : model.mean) all.push_back(mean.x);
    std::ranges::sort(all);
    return all;
  };
  const std::vector<float> before = sorted(scene.model), after = sorted(readModel(path).model);
  REQUIRE(before.size() == after.size());
  float farthest = 0;
  for (std::size_t i = 0; i < before.size(); ++i) farthest = std::max(farthest, std::abs(before[i] - after[i]));
  CHECK(farthest < 1e-4f);
}

TEST_CASE("what a file holds of textured Gaussians has the axes of the model whichever way the file names them") {
  const TemporaryFolder folder;
  const GaussianModel model = tinyTexturedModel(3000);
  const auto planeOf = [](const GaussianModel& of, std::size_t i) { return shortestAxis(glm::exp(of.log_scale[i])); };
  std::array<std::size_t, 3> normals{};
  for (std::size_t i = 0; i < model.size(); ++i) ++normals[planeOf(model, i)];
  for (const std::size_t count : normals) REQUIRE(count > 100);
  for (const char* name : {"scene.glb", "scene.sog"}) {
    for (float steps : {1.0f, 8.0f}) {
      CAPTURE(name, steps);
      const GaussianModel stored = asStored((folder / name).string(), model, 0, steps);
      REQUIRE(stored.size() == model.size());
      REQUIRE(stored.atlas.rects.size() == model.size());  // some without a texture, if nothing is left of it
      std::size_t far_scales = 0, far_rotations = 0, other_planes = 0;
      for (std::size_t i = 0; i < model.size(); ++i) {
        const glm::vec3 off = glm::abs(stored.log_scale[i] - model.log_scale[i]);
        if (glm::max(off.x, glm::max(off.y, off.z)) > 0.05f * steps) ++far_scales;
        const float near = std::abs(glm::dot(glm::normalize(stored.rotation[i]), glm::normalize(model.rotation[i])));
        if (near < std::cos(0.03f * steps)) ++far_rotations;
        if (stored.atlas.rects[i].texelCount() > 0 && planeOf(stored, i) != planeOf(model, i)) ++other_planes;
      }
      CHECK(far_scales == 0);
      CHECK(far_rotations == 0);
      CHECK(other_planes == 0);
    }
  }
}
