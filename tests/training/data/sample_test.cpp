// SPDX-License-Identifier: Apache-2.0
// The built-in scene: same bytes every time, and geometry, cameras and points that agree.
#include "training/data/sample.h"

#include <algorithm>
#include <map>

#include "core/file/file.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/data/dataset.h"

namespace fs = std::filesystem;

namespace {

const tg::SampleOptions kSmall{.size = 40, .train_views = 3, .test_views = 2, .points = 500, .supersampling = 2};

std::map<std::string, std::vector<std::uint8_t>> contents(const fs::path& folder) {
  std::map<std::string, std::vector<std::uint8_t>> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files[fs::relative(entry.path(), folder)] = tg::readFile(entry.path(), 1 << 20);
  }
  return files;
}

}  // namespace

TEST_CASE("make-sample writes the same bytes at any thread count", "[sample]") {
  tg::TemporaryFolder folder;
  tg::setThreadCount(1);
  tg::writeSample(folder / "a", kSmall, false);
  tg::setThreadCount(2);
  tg::writeSample(folder / "b", kSmall, false);
  tg::setThreadCount(0);
  const auto files = contents(folder / "a");
  CHECK(files.size() == 3 + 2 + 3);
  CHECK(files == contents(folder / "b"));
}

TEST_CASE("make-sample's data set loads, and its points lie on what its cameras see", "[sample]") {
  tg::TemporaryFolder folder;
  tg::writeSample(folder.path, kSmall, true);
  const tg::Dataset dataset = tg::loadDataset(folder.path);
  CHECK(dataset.layout == tg::DatasetLayout::nerfSynthetic);
  CHECK(dataset.indices(false).size() == 3);
  CHECK(dataset.indices(true).size() == 2);
  CHECK(dataset.points.position.size() == Approx(500).margin(10));
  tg::SampleOptions one = kSmall;
  one.points = 1;
  CHECK(tg::samplePoints(one).position.size() == 1);
  const tg::Camera expected = tg::sampleCamera(kSmall, false, 2);
  const tg::Camera& camera = dataset.views[2];
  CHECK(camera.focal.x == Approx(expected.focal.x).epsilon(1e-9));
  CHECK(glm::length(camera.position() - expected.position()) < 1e-9);

  // A point that projects into a view falls on the object, never on the empty background.
  const tg::Image image = tg::renderSample(kSmall, expected);
  int checked = 0;
  for (const glm::vec3& point : dataset.points.position) {
    const glm::dvec3 p = cameraFromWorld(camera, point);
    const glm::dvec2 at = project(camera, p);
    if (p.z <= 0 || at.x < 0 || at.y < 0 || at.x >= 40 || at.y >= 40) continue;
    CHECK(image.at(static_cast<int>(at.x), static_cast<int>(at.y), 3) > 0);
    ++checked;
  }
  CHECK(checked > 400);
}

TEST_CASE("make-sample refuses sizes out of range and an existing data set", "[sample]") {
  tg::TemporaryFolder folder;
  tg::SampleOptions options = kSmall;
  options.size = 0;
  CHECK_THROWS_WITH(tg::writeSample(folder.path, options, false), Contains("image size out of range"));
  tg::writeSample(folder.path, kSmall, false);
  CHECK_THROWS_WITH(tg::writeSample(folder.path, kSmall, false), Contains("holds transforms_train.json already"));
  CHECK_NOTHROW(tg::writeSample(folder.path, kSmall, true));
  // Other data sets' files, without the one that this one has.
  for (const char* file : {"transforms.json", "sparse", "points3d.ply", "train"}) {
    tg::TemporaryFolder other;
    fs::create_directories(other / file);
    CHECK_THROWS_WITH(tg::writeSample(other.path, kSmall, false), Contains(std::string("holds ") + file));
  }
}
