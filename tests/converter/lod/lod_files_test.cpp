// SPDX-License-Identifier: Apache-2.0
// Scenes in levels of detail on disk: what is written comes back and looks alike from far away; what is broken is said.
#include <sys/stat.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "converter/check.h"
#include "converter/edit/quality.h"
#include "converter/lod/coarser.h"
#include "converter/lod/lod_names.h"
#include "converter/lod/lod_scenes.h"
#include "converter/lod/places.h"
#include "converter/lod/write_lod.h"
#include "converter/registry/file_format.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "converter/sog/sog.h"
#include "core/file/file.h"
#include "core/file/folder_lock.h"
#include "core/image/webp.h"
#include "core/merge/moments.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/scenes.h"

using namespace tg;
namespace fs = std::filesystem;

namespace {

// Small leaves and files, so that a small model has many of both.
constexpr LodOptions kSmall = {.leaf = 200, .file = 700, .coarsest = 60};

// [dB] of levels 1 to 3 against level 0, a decibel below what they have.
constexpr double kLeastPsnr[] = {26.9, 22.9, 18.7};

Bundle trained(int gaussians, bool textured) {
  Bundle bundle;
  bundle.model = test::trainedLikeModel(7, gaussians);
  setShDegree(bundle.model, 1);
  if (!textured) bundle.model = withoutTextures(bundle.model);
  bundle.background = glm::vec3(0.25f, 0.5f, 0.75f);
  return bundle;
}

// Every file below a folder by its name, with its bytes.
std::map<std::string, std::vector<std::uint8_t>> filesBelow(const fs::path& folder) {
  std::map<std::string, std::vector<std::uint8_t>> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files[fs::relative(entry.path(), folder).string()] = readFile(entry.path(), 1 << 24);
    }
  }
  return files;
}

// Of a picture on black.
glm::dvec3 meanColor(const GaussianModel& model, const Camera& camera) {
  const Image image = picture(model, camera);
  glm::dvec3 sum(0.0);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      for (int c = 0; c < 3; ++c) sum[c] += static_cast<double>(image.at(x, y, c));
    }
  }
  return sum / static_cast<double>(image.width * image.height);
}

}  // namespace

TEST_CASE("levels of detail: level 0 of one leaf has the numbers of a plain SOG") {
  const Scratch scratch;
  for (const bool textured : {false, true}) {
    Bundle in = trained(300, textured);
    in.cameras = {test::trainedLikeCamera(64, 48)};
    const fs::path path = scratch.folder() / (textured ? "textured" : "plain") / "lod-meta.json";
    const LodReport report = writeLod(path, in);
    const fs::path sog = scratch.folder() / "a.sog";
    CHECK(report.order == writeSog(sog, in.model));
    const Bundle out = readModel(path);
    GaussianModel expected = readSog(sog).model;
    expected.intersection = in.model.intersection;  // which a SOG without textures has no word for
    CHECK(out.model == expected);
    CHECK(out.cameras == in.cameras);
    CHECK(out.background == in.background);
    CHECK(out.format == "lod-meta.json");
    CHECK(readModel(path, {.base_only = true}).model == readModel(sog, {.base_only = true}).model);
  }
}

TEST_CASE("levels of detail: a bright background and a mean beyond all others are read again") {
  const Scratch scratch;
  Bundle in = trained(300, false);
  in.background = glm::vec3(1.5f, -0.25f, 0.0f);
  in.model.mean[7] = glm::vec3(0.0f, 2e30f, 0.0f);
  const fs::path path = scratch.folder() / "lod-meta.json";
  writeLod(path, in);
  const Bundle out = readModel(path);
  CHECK(out.model.size() == in.model.size());
  CHECK(out.background == in.background);
  CHECK(out.knows_background);
  // Keys in order, and names before the levels.
  nlohmann::json meta = nlohmann::json::parse(readFile(path, 1 << 20));
  meta.erase(lod::kOwn);
  for (int k = 0; k < 300; ++k) meta["filenames"].push_back("unused/number_" + std::to_string(k) + "/meta.json");
  scratch.write("lod-meta.json", meta.dump());
  const Bundle foreign = readModel(path);
  CHECK(foreign.model.size() == in.model.size());
  CHECK_FALSE(foreign.knows_background);
}

TEST_CASE("levels of detail: a background that the model does not know is not made up") {
  const Scratch scratch;
  Bundle in = trained(300, false);
  in.knows_background = false;
  const fs::path path = scratch.folder() / "lod-meta.json";
  writeLod(path, in);
  CHECK_FALSE(nlohmann::json::parse(readFile(path, 1 << 20))[lod::kOwn].contains("background"));
  const Bundle out = readModel(path);
  CHECK_FALSE(out.knows_background);
  CHECK(out.background == Bundle().background);
  CHECK(out.model.intersection == in.model.intersection);  // what else is ours is read
}

TEST_CASE("levels of detail: what each file warns of is told once") {
  const Scratch scratch;
  const fs::path path = scratch.folder() / "lod-meta.json";
  writeLod(path, trained(1000, false), kSmall);
  CHECK(readModel(path).warnings.empty());
  for (const std::string& file : readLodScene(path).files) {
    nlohmann::json meta = nlohmann::json::parse(readFile(scratch.folder() / file, 1 << 20));
    meta["antialias"] = true;
    scratch.write(file, meta.dump());
  }
  const std::vector<std::string> warnings = readModel(path).warnings;
  REQUIRE(warnings.size() == 1);
  CHECK(warnings.front().find("antialiasing") != std::string::npos);
}

TEST_CASE("levels of detail: what lod-meta.json warns of is told by who reads and by who checks it") {
  const Scratch scratch;
  const fs::path path = scratch.folder() / "lod-meta.json";
  writeLod(path, trained(1000, false), kSmall);
  nlohmann::json meta = nlohmann::json::parse(readFile(path, 1 << 20));
  meta["counts"][0] = 999;
  scratch.write("lod-meta.json", meta.dump());
  const std::string told = "\"counts\" is not what the tree holds";
  const Bundle read = readModel(path);
  REQUIRE(read.warnings.size() == 1);
  CHECK_THAT(read.warnings.front(), Contains(told));
  const CheckReport report = checkFile(path);
  CHECK(report.errors.empty());
  REQUIRE(report.warnings.size() == 1);
  CHECK_THAT(report.warnings.front().message, Contains(told));
}

TEST_CASE("levels of detail: every leaf is in every level, with a quarter of the Gaussians of the one before") {
  const Scratch scratch;
  const Bundle in = trained(3000, false);
  const fs::path path = scratch.folder() / "lod-meta.json";
  const LodReport report = writeLod(path, in, kSmall);
  const LodScene scene = readLodScene(path);
  REQUIRE(scene.levels == static_cast<int>(report.counts.size()));
  CHECK(scene.counts == report.counts);
  CHECK(scene.counts.front() == 3000);
  CHECK(scene.counts.back() <= kSmall.coarsest);
  CHECK(scene.leaves.size() == 16);
  for (const LodLeaf& leaf : scene.leaves) {
    REQUIRE(leaf.levels.size() == report.counts.size());
    for (std::size_t k = 0; k < leaf.levels.size(); ++k) {
      CHECK(leaf.levels[k].count >= 1);
      if (k > 0) CHECK(leaf.levels[k].count == (leaf.levels[k - 1].count + 3) / 4);
    }
  }
  // Files are the leaves of one level, one behind the other, and whole.
  std::vector<std::uint32_t> held(scene.files.size(), 0);
  std::vector<int> level_of(scene.files.size(), -1);
  for (std::size_t k = 0; k < report.counts.size(); ++k) {
    for (const LodLeaf& leaf : scene.leaves) {
      const LodRange& range = leaf.levels[k];
      CHECK(range.first == held[range.file]);
      held[range.file] += range.count;
      if (level_of[range.file] < 0) level_of[range.file] = static_cast<int>(k);
      CHECK(level_of[range.file] == static_cast<int>(k));
    }
  }
  CHECK(held == scene.file_counts);
  for (const std::uint32_t count : held) CHECK(count <= kSmall.file);
  CHECK(filesOf(scene, sameLevel(scene, scene.levels - 1)).size() == 1);
  // Each Gaussian of the model is one of level 0.
  std::vector<std::uint32_t> order = report.order;
  std::ranges::sort(order);
  for (std::size_t i = 0; i < order.size(); ++i) REQUIRE(order[i] == i);
}

TEST_CASE("levels of detail: a leaf's bounds hold what it shows at every level, to 3 sigma") {
  const Scratch scratch;
  const fs::path path = scratch.folder() / "lod-meta.json";
  writeLod(path, trained(1000, false), kSmall);
  const LodScene scene = readLodScene(path);
  for (int k = 0; k < scene.levels; ++k) {
    const GaussianModel model = wholeLevel(path, k);
    std::size_t at = 0;
    for (const LodLeaf& leaf : scene.leaves) {
      for (std::uint32_t i = 0; i < leaf.levels[static_cast<std::size_t>(k)].count; ++i, ++at) {
        const glm::dmat3 covariance = momentsOf(model, at, 1.0).covariance;
        for (int c = 0; c < 3; ++c) {
          const double reach = 3.0 * std::sqrt(covariance[c][c]), margin = 0.05 * reach + 2e-3;  // numbers are rounded
          CHECK(static_cast<double>(model.mean[at][c]) - reach >= static_cast<double>(leaf.bound.low[c]) - margin);
          CHECK(static_cast<double>(model.mean[at][c]) + reach <= static_cast<double>(leaf.bound.high[c]) + margin);
          if (k > 0) continue;
          CHECK(static_cast<double>(model.mean[at][c]) >= static_cast<double>(leaf.means.low[c]) - 2e-3);
          CHECK(static_cast<double>(model.mean[at][c]) <= static_cast<double>(leaf.means.high[c]) + 2e-3);
        }
      }
    }
  }
}

TEST_CASE("levels of detail: textures are 4 x 4, then 2 x 2, then their mean") {
  const Scratch scratch;
  const fs::path path = scratch.folder() / "lod-meta.json";
  writeLod(path, trained(800, true), {.leaf = 200, .file = 700, .coarsest = 16});
  const LodScene scene = readLodScene(path);
  REQUIRE(scene.levels == 4);
  CHECK(scene.texture_mode == TextureMode::rgba);
  for (int k = 0; k < scene.levels; ++k) {
    const GaussianModel model = wholeLevel(path, k);
    CAPTURE(k);
    CHECK(isTextured(model) == (k < 2));
    for (std::size_t i = 0; i < model.size(); ++i) {
      const TextureRect rect = rectOf(model, i);
      const int side = k == 0 ? 4 : k == 1 ? 2 : 0;
      REQUIRE(rect.width == side);
      REQUIRE(rect.height == side);
    }
  }
}

TEST_CASE("levels of detail: a coarser level has the colours and, from far away, the picture of the model") {
  const Scratch scratch;
  for (const bool textured : {false, true}) {
    const Bundle in = trained(4000, textured);
    const fs::path path = scratch.folder() / (textured ? "textured" : "plain") / "lod-meta.json";
    const LodReport report = writeLod(path, in, {.leaf = 1000, .file = 5000, .coarsest = 70});
    REQUIRE(report.counts.size() == 4);
    const GaussianModel finest = wholeLevel(path, 0);
    for (int k = 1; k < 4; ++k) {
      const GaussianModel model = wholeLevel(path, k);
      // Half as large a picture a level: what was a pixel stays one.
      const Camera camera = test::trainedLikeCamera(128 >> k, 96 >> k);
      const double psnr = renderedPsnr(finest, model, std::vector<Camera>{camera}, in.background);
      const glm::dvec3 mean = meanColor(finest, camera), off = glm::abs(meanColor(model, camera) - mean);
      CAPTURE(textured, k, psnr, mean.x, off.x, off.y, off.z);
      CHECK(psnr > kLeastPsnr[k - 1]);
      CHECK(std::max({off.x, off.y, off.z}) < 0.03);
    }
  }
}

TEST_CASE("levels of detail: texels that no steps reach are counted in all files") {
  const Scratch scratch;
  Bundle in = trained(1000, true);
  const fs::path path = scratch.folder() / "lod-meta.json";
  CHECK(writeLod(path, in, kSmall).clipped_texels == 0);
  for (glm::vec4& texel : in.model.atlas.texels) texel.x = 1e6f;
  CHECK(writeLod(path, in, kSmall).clipped_texels > in.model.atlas.texels.size());
}

TEST_CASE("levels of detail: any mix of levels is put together in the tree's order") {
  const Scratch scratch;
  for (const bool textured : {false, true}) {
    const fs::path path = scratch.folder() / (textured ? "textured" : "plain") / "lod-meta.json";
    writeLod(path, trained(1000, textured), kSmall);
    const LodScene scene = readLodScene(path);
    std::vector<std::uint8_t> levels = sameLevel(scene, 0);
    for (std::size_t i = 0; i < levels.size(); ++i) {
      levels[i] = static_cast<std::uint8_t>(i % static_cast<std::size_t>(scene.levels));
    }
    std::map<std::uint32_t, GaussianModel> files;
    for (const std::uint32_t file : filesOf(scene, levels)) {
      files[file] = readLodFile(scene, file, lodFolderReader(path)).model;
    }
    const auto assemble = [&] {
      return assembleLod(scene, levels, [&](std::uint32_t file) -> const GaussianModel& { return files.at(file); });
    };
    const GaussianModel mixed = assemble();
    CHECK(mixed.size() == countOf(scene, levels));
    CHECK(lengthsAgree(mixed));
    std::size_t at = 0;
    for (std::size_t i = 0; i < levels.size(); ++i) {
      const LodRange range = scene.leaves[i].levels[levels[i]];
      const GaussianModel& from = files.at(range.file);
      for (std::uint32_t j = range.first; j < range.first + range.count; ++j, ++at) {
        REQUIRE(mixed.mean[at] == from.mean[j]);
        REQUIRE(mixed.sh[at * mixed.shCount()] == from.sh[j * from.shCount()]);
        const TextureRect a = rectOf(mixed, at), b = rectOf(from, j);
        REQUIRE(a.width == b.width);
        REQUIRE(a.height == b.height);
        for (std::size_t t = 0; t < a.texelCount(); ++t) {
          REQUIRE(mixed.atlas.texels[a.offset + t] == from.atlas.texels[b.offset + t]);
        }
      }
    }
    if (!textured) continue;
    REQUIRE(files.size() > 1);
    GaussianModel& one = files.begin()->second;
    for (auto& [file, model] : files) model.texture_mode = &model == &one ? TextureMode::alpha : TextureMode::rgb;
    CHECK(assemble().texture_mode == TextureMode::rgba);
    one.intersection = IntersectionModel::plane;
    CHECK(test::messageOf(assemble).find("another intersection model") != std::string::npos);
  }
}

TEST_CASE("levels of detail: the same model gives the same bytes with any number of threads") {
  const Scratch scratch;
  const Bundle in = trained(1500, true);
  std::vector<std::map<std::string, std::vector<std::uint8_t>>> written;
  for (const int threads : {1, 3}) {
    setThreadCount(threads);
    const fs::path folder = scratch.folder() / std::to_string(threads);
    writeLod(folder / "lod-meta.json", in, kSmall);
    written.push_back(filesBelow(folder));
  }
  setThreadCount(0);
  CHECK(written[0].size() > 20);
  CHECK(written[0] == written[1]);
}

TEST_CASE("levels of detail: a broken file of a scene is said in one line, and the others are read") {
  const Scratch scratch;
  const fs::path path = scratch.folder() / "lod-meta.json";
  writeLod(path, trained(1000, false), kSmall);
  const LodScene scene = readLodScene(path);
  const LodReader reader = lodFolderReader(path);
  REQUIRE(scene.files.size() >= 3);
  const fs::path meta = scratch.folder() / scene.files[1], image = meta.parent_path() / "means_l.webp";
  const auto said = [&](ErrorKind kind) {
    const std::string text = test::messageOf([&] { readLodFile(scene, 1, reader); }, kind);
    CHECK(text.starts_with(meta.parent_path().string()));
    CHECK(text.find('\n') == std::string::npos);
    return text;
  };
  fs::resize_file(image, fs::file_size(image) / 2);
  CHECK(said(ErrorKind::badData).find("means_l.webp") != std::string::npos);
  fs::resize_file(image, 0);
  CHECK(said(ErrorKind::badData).find("means_l.webp") != std::string::npos);
  fs::remove(image);
  CHECK(said(ErrorKind::cannotRead).find("means_l.webp") != std::string::npos);
  fs::resize_file(meta, fs::file_size(meta) / 2);
  CHECK(said(ErrorKind::badData).find("meta.json") != std::string::npos);
  fs::remove(meta);
  CHECK(said(ErrorKind::cannotRead).find("meta.json") != std::string::npos);
  CHECK(readLodFile(scene, 0, reader).model.size() == scene.file_counts[0]);
  CHECK(readLodFile(scene, 2, reader).model.size() == scene.file_counts[2]);
}

TEST_CASE("levels of detail: check finds what readers put right behind any number of warnings") {
  const Scratch scratch;
  const fs::path path = scratch.folder() / "lod-meta.json";
  writeLod(path, trained(5000, false), kSmall);
  const LodScene scene = readLodScene(path);
  REQUIRE(scene.files.size() > 7);
  for (std::size_t file = 0; file < 7; ++file) {
    const fs::path meta = scratch.folder() / scene.files[file];
    nlohmann::ordered_json json = nlohmann::ordered_json::parse(std::ifstream(meta));
    json["model"] = std::string(1, static_cast<char>('a' + file));
    std::ofstream(meta) << json;
  }
  CHECK(checkFile(path).errors.empty());
  const fs::path quats = scratch.folder() / fs::path(scene.files[6]).parent_path() / "quats.webp";
  BytePixels pixels = decodeWebp(readFile(quats, 1 << 20), quats.string());
  pixels.data[3] = 7;
  const std::vector<std::uint8_t> encoded = encodeWebp(pixels);
  std::ofstream(quats, std::ios::binary) << std::string(encoded.begin(), encoded.end());
  const CheckReport report = checkFile(path);
  REQUIRE(report.errors.size() == 1);
  CHECK(report.errors[0].message == "1 splats with a broken rotation: not turned");
  REQUIRE(report.warnings.size() == 6);
  CHECK(report.warnings[5].message == "further warnings of its files are left out");
  CHECK(report.gaussians > 0);
}

TEST_CASE("levels of detail: check finds files that are in one another's place") {
  const Scratch scratch;
  const fs::path path = scratch.folder() / "lod-meta.json";
  Bundle in = trained(1400, false);
  in.model.mean[7] = glm::vec3(0.0f, 2e30f, 0.0f);  // beyond what bounds say
  writeLod(path, in, kSmall);
  CHECK(checkFile(path).errors.empty());
  in.model.mean[7] = in.model.mean[8];
  writeLod(path, in, kSmall);
  CHECK(checkFile(path).errors.empty());
  const LodScene scene = readLodScene(path);
  const auto folder = [&](std::size_t file) { return (scratch.folder() / scene.files[file]).parent_path(); };
  REQUIRE(scene.file_counts[0] == scene.file_counts[1]);
  fs::rename(folder(0), scratch.folder() / "first");
  fs::rename(folder(1), folder(0));
  fs::rename(scratch.folder() / "first", folder(1));
  const CheckReport report = checkFile(path);
  REQUIRE(report.errors.size() == 2);
  for (std::size_t file = 0; file < 2; ++file) {
    CHECK_THAT(report.errors[file].pointer, Contains(scene.files[file]));
    CHECK_THAT(report.errors[file].message,
               Contains("Gaussians outside the bounds that lod-meta.json has for them (expected none of " +
                        std::to_string(scene.file_counts[file]) + ", found "));
  }
}

TEST_CASE("levels of detail: means are in the bounds of their leaves as far as a SOG keeps them") {
  const Scratch scratch;
  const fs::path path = scratch.folder() / "lod-meta.json";
  Bundle in = trained(300, false);
  in.model.log_scale.assign(in.model.size(), glm::vec3(-30.0f));  // bounds end at means
  in.model.mean[0] = glm::vec3(3000.0f, -2000.0f, 1000.0f);
  writeLod(path, in, kSmall);
  const LodScene scene = readLodScene(path);
  const LodReader reader = lodFolderReader(path);
  const LodPlaces places(scene);
  for (std::uint32_t file = 0; file < scene.files.size(); ++file) {
    CHECK_NOTHROW(places.require(file, readLodFile(scene, file, reader).model));
  }
  GaussianModel moved = readLodFile(scene, 0, reader).model;
  moved.mean[5].x -= 10.0f;
  CHECK(test::messageOf([&] { places.require(0, moved); }, ErrorKind::badData)
            .ends_with("(expected none of " + std::to_string(moved.size()) + ", found 1)"));
}

TEST_CASE("levels of detail: a file that holds more or less than lod-meta.json says is refused") {
  const Scratch scratch;
  const fs::path path = scratch.folder() / "lod-meta.json";
  writeLod(path, trained(300, false), kSmall);
  LodScene scene = readLodScene(path);
  const LodReader reader = lodFolderReader(path);
  ++scene.file_counts[0];
  CHECK(test::messageOf([&] { readLodFile(scene, 0, reader); }).find("too few Gaussians") != std::string::npos);
  scene.file_counts[0] -= 2;
  CHECK(test::messageOf([&] { readLodFile(scene, 0, reader); }).find("too many Gaussians") != std::string::npos);
}

TEST_CASE("levels of detail: a new scene leaves nothing of the old one in its place, and what others put there") {
  const Scratch scratch;
  const fs::path folder = scratch.folder() / "s", path = folder / "lod-meta.json";
  writeLod(path, trained(900, true), kSmall);
  std::ofstream(folder / "page.html") << "mine";
  writeLod(path, trained(250, false), kSmall);
  const GaussianModel out = readModel(path).model;
  CHECK(out.size() == 250);
  const LodScene scene = readLodScene(path);
  std::size_t files = 0;
  for (const auto& [name, bytes] : filesBelow(folder)) files += name.ends_with("meta.json");
  CHECK(files == scene.files.size() + 1);
  CHECK(fs::exists(folder / "page.html"));
}

TEST_CASE("levels of detail: folders are open to whom the process' mask allows") {
  const Scratch scratch;
  for (const mode_t mask : {0027u, 0002u}) {
    const fs::path path = scratch.folder() / std::to_string(mask) / "lod-meta.json";
    const mode_t before = ::umask(mask);
    writeLod(path, trained(50, false));
    ::umask(before);
    const fs::path file = readLodScene(path).files.front();
    for (const fs::path& folder : {file.parent_path().parent_path(), file.parent_path()}) {
      CHECK(fs::status(path.parent_path() / folder).permissions() == static_cast<fs::perms>(0777 & ~mask));
    }
  }
}

TEST_CASE("levels of detail: a new scene removes what lod-meta.json named and no other folder, whatever its name") {
  const Scratch scratch;
  const fs::path path = scratch.folder() / "lod-meta.json";
  const auto leave = [&](const std::string& folder, bool mark) {
    fs::create_directories(scratch.folder() / folder / "0_0");
    std::ofstream(scratch.folder() / folder / "0_0/meta.json") << "{}";
    if (mark) std::ofstream(scratch.folder() / folder / ".unfinished");
  };
  writeLod(path, trained(50, false));
  leave(".new-1-0", true);
  leave("1", true);
  leave("2", false);
  fs::create_directory(scratch.folder() / ".new-york");
  writeLod(path, trained(50, false));
  std::set<std::string> left;
  for (const fs::directory_entry& entry : fs::directory_iterator(scratch.folder())) {
    left.insert(entry.path().filename().string());
  }
  CHECK(left == std::set<std::string>{".new-1-0", ".new-york", "1", "2", "3", "lod-meta.json"});
  CHECK(readLodScene(path).files.front() == "3/0_0/meta.json");
  CHECK(fs::exists(scratch.folder() / "1/.unfinished"));
}

TEST_CASE("levels of detail: a scene is written beside a run that holds the folder, and does not hold it") {
  const Scratch scratch;
  const fs::path path = scratch.folder() / "lod-meta.json";
  writeLod(path, trained(50, false));
  int refused = 0;
  {
    const std::jthread run([&](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        try {
          const FolderLock alone(scratch.folder());
        } catch (const Error&) {
          ++refused;
        }
      }
    });
    for (int i = 0; i < 20; ++i) writeLod(path, trained(50, false));
  }
  CHECK(refused == 0);
  CHECK(std::distance(fs::directory_iterator(scratch.folder()), fs::directory_iterator()) == 2);
}

TEST_CASE("levels of detail: of several that write one scene at once the last one leaves its files alone") {
  const Scratch scratch;
  const fs::path path = scratch.folder() / "lod-meta.json";
  writeLod(path, trained(50, false));
  for (int round = 0; round < 5; ++round) {
    {
      std::vector<std::jthread> writers;
      for (int i = 0; i < 8; ++i) {
        writers.emplace_back([&, source = trained(5 + i, false)] {
          for (int k = 0; k < 5; ++k) writeLod(path, source);
        });
      }
    }
    CHECK(std::distance(fs::directory_iterator(scratch.folder()), fs::directory_iterator()) == 2);
    CHECK(readModel(path).model.size() >= 5);
  }
}

TEST_CASE("levels of detail: a folder in which all numbers are taken is told as such and left as it was") {
  const Scratch scratch;
  for (int number = 0; number < 1000; ++number) fs::create_directory(scratch.folder() / std::to_string(number));
  const fs::path path = scratch.folder() / "lod-meta.json";
  CHECK(test::messageOf([&] { writeLod(path, trained(50, false)); }, ErrorKind::cannotWrite) ==
        scratch.folder().string() + ": cannot name the folder of files: 0 to 999 are there already");
  CHECK(std::distance(fs::directory_iterator(scratch.folder()), fs::directory_iterator()) == 1000);
  fs::remove(scratch.folder() / "0");
  fs::create_symlink("nothing", scratch.folder() / "0");
  fs::remove(scratch.folder() / "998");
  writeLod(path, trained(50, false));
  CHECK(readLodScene(path).files.front() == "998/0_0/meta.json");
}

TEST_CASE("levels of detail: what nobody sees goes first whatever its colour") {
  constexpr std::size_t kSeen = 20;
  GaussianModel model;
  model.sh_degree = 0;
  for (const bool seen : {true, false}) {
    for (std::size_t i = 0; i < kSeen; ++i) {
      model.mean.push_back({static_cast<float>(i), seen ? 0.0f : 0.1f, 0.0f});
      model.rotation.push_back({1, 0, 0, 0});
      model.log_scale.push_back(glm::vec3(-3.0f));
      model.opacity_logit.push_back(seen ? 2.0f : -1e4f);
      model.sh.push_back(glm::vec3(seen ? 0.1f * static_cast<float>(i) : i % 2 == 0 ? 3e38f : -3e38f));
    }
  }
  const GaussianModel left = coarser(model, 28);  // one round of pairs
  for (std::size_t i = 0; i < kSeen; ++i) {
    CAPTURE(i);
    CHECK(std::ranges::find(left.mean, model.mean[i]) != left.mean.end());
  }
}

TEST_CASE("levels of detail: a channel that a model's textures do not use is not looked at") {
  for (const TextureMode mode : {TextureMode::rgb, TextureMode::alpha}) {
    GaussianModel plain = trained(50, true).model;
    plain.texture_mode = mode;
    GaussianModel other = plain;
    neutralize(plain.atlas.texels, mode);
    for (glm::vec4& texel : other.atlas.texels)
      texel = mode == TextureMode::rgb ? glm::vec4(glm::vec3(texel), 0.0f) : glm::vec4(7.0f, -7.0f, 5.0f, texel.a);
    CAPTURE(name(mode));
    for (const std::size_t count : {60u, 13u}) CHECK(coarser(other, count) == coarser(plain, count));
  }
}

TEST_CASE("levels of detail: fewer Gaussians than asked for stay, with their textures at half the side") {
  const GaussianModel model = trained(50, true).model;
  const GaussianModel half = coarser(model, 60);
  CHECK(half.mean == model.mean);
  CHECK(half.log_scale == model.log_scale);
  for (std::size_t i = 0; i < half.size(); ++i) CHECK(rectOf(half, i).width == 2);
  CHECK(coarser(model, 1).size() == 1);
}
