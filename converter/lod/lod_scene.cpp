// SPDX-License-Identifier: Apache-2.0
// lod-meta.json in, the choice of levels, and models out of files.
#include "converter/lod/lod_scene.h"

#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <queue>
#include <string_view>
#include <unordered_set>
#include <utility>

#include "converter/lod/lod_names.h"
#include "converter/sog/folder.h"
#include "core/bundle/camera_file.h"
#include "core/bundle/ply.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"
#include "core/system/numbers.h"

namespace tg {
namespace {

constexpr std::size_t kMaxFiles = 1'000'000;
constexpr std::size_t kMaxChildren = 1'000'000;

std::string insideName(const JsonNode& node, const std::string& name) {
  const std::optional<std::string> inside = nameInside(name);
  if (!inside) node.fail(leavesFolder(name));
  return *inside;
}

Box readBox(const JsonNode& node) {
  const auto low = node.numbers<3>("min", -lod::kFarthest, lod::kFarthest),
             high = node.numbers<3>("max", -lod::kFarthest, lod::kFarthest);
  Box box;
  for (int k = 0; k < 3; ++k) {
    if (low[k] > high[k]) node.fail("min is beyond max");
    box.low[k] = static_cast<float>(low[k]);
    box.high[k] = static_cast<float>(high[k]);
  }
  return box;
}

template <typename T>
T named(const JsonNode& node, const char* key) {
  const std::string name = node.string(key);
  const std::optional<T> value = parse<T>(name);
  if (!value) node.fail(std::string(key) + expectedFound(allNames<T>(), lod::quoted(name)));
  return *value;
}

class Parser {
 public:
  explicit Parser(LodScene& scene) : scene_(scene) {}

  void parse(const JsonNode& root) {
    if (root.has("version")) root.integer("version", 1, lod::kFormatVersion);
    scene_.levels = static_cast<int>(root.integer("lodLevels", 1, kMaxLodLevels));
    const JsonNode names = root.at("filenames").array();
    if (names.size() < 1 || names.size() > kMaxFiles) {
      names.fail("wrong number of files" +
                 expectedFound("1 to " + std::to_string(kMaxFiles), std::to_string(names.size())));
    }
    for (std::size_t i = 0; i < names.size(); ++i) {
      const JsonNode file = names.element(i);
      if (lowerExtension(file.string()) == ".sog") {
        file.fail("is a bundled SOG" + expectedFound("the meta.json of one that is not", file.shown()));
      }
      scene_.files.push_back(insideName(names, file.string()));
    }
    requireEachOnce(names);
    scene_.file_counts.assign(scene_.files.size(), 0);
    scene_.counts.assign(static_cast<std::size_t>(scene_.levels), 0);
    stored_ = scene_.counts;
    addNode(root.at("tree").object());
    if (scene_.leaves.empty()) root.fail("the tree has no leaves");
    requireApart(root);
    warnOf(root, "count", std::accumulate(stored_.begin(), stored_.end(), std::uint64_t{0}));
    warnOf(root, "counts", stored_);
    warnOfSpareLevels();
    scene_.has_environment = root.has("environment") && !root.member("environment").is_null();
    if (root.has(lod::kOwn)) parseOwn(root.at(lod::kOwn).object());
  }

 private:
  void warnOf(const JsonNode& root, const char* key, const nlohmann::json& held) {
    if (!root.has(key) || root.member(key) == held) return;
    scene_.warnings.push_back(lod::quoted(key) + " is not what the tree holds" +
                              expectedFound(held.dump(), root.at(key).shown()));
  }

  void warnOfSpareLevels() {
    if (spare_.empty()) return;
    scene_.warnings.push_back(
        "levels that \"lodLevels\" does not count are left out" +
        expectedFound("0 to " + std::to_string(scene_.levels - 1), lod::quoted(printable(spare_))));
  }

  // Its Gaussians would count again, whatever requireApart() finds.
  void requireEachOnce(const JsonNode& names) const {
    std::unordered_set<std::string_view> seen;
    for (std::size_t i = 0; i < scene_.files.size(); ++i) {
      if (seen.insert(scene_.files[i]).second) continue;
      names.element(i).fail("names a file a second time" +
                            expectedFound("each once", lod::quoted(printable(scene_.files[i]))));
    }
  }

  void addNode(const JsonNode& node) {
    if (node.has("lods")) addLeaf(node, node.at("lods").object());
    if (!node.has("children")) return;
    const JsonNode children = node.at("children").array();
    if (children.size() > kMaxChildren) children.fail("too many children" + atMost(kMaxChildren, children.size()));
    for (std::size_t i = 0; i < children.size(); ++i) addNode(children.element(i).object());
  }

  void addLeaf(const JsonNode& node, const JsonNode& lods) {
    const JsonNode bound = node.at("bound").object();
    LodLeaf leaf{readBox(bound), {}, {}};
    leaf.means = node.has(lod::kMeans) ? readBox(node.at(lod::kMeans).object()) : leaf.bound;
    std::vector<std::optional<LodRange>> given(static_cast<std::size_t>(scene_.levels));
    if (spare_.empty()) spare_ = spareLevel(lods);
    for (int level = 0; level < scene_.levels; ++level) {
      const std::string key = std::to_string(level);
      if (!lods.has(key.c_str())) continue;
      const JsonNode entry = lods.at(key.c_str()).object();
      const auto most = static_cast<std::int64_t>(kMaxGaussians);
      LodRange range;
      range.file =
          static_cast<std::uint32_t>(entry.integer("file", 0, static_cast<std::int64_t>(scene_.files.size()) - 1));
      range.first = static_cast<std::uint32_t>(entry.integer("offset", 0, most));
      range.count = static_cast<std::uint32_t>(entry.integer("count", 0, most - range.first));
      stored_[static_cast<std::size_t>(level)] += range.count;
      if (range.count == 0) continue;
      const bool repeated = std::ranges::find(given, std::optional(range)) != given.end();
      if (!repeated) ranges_.push_back(range);
      given[static_cast<std::size_t>(level)] = range;
      std::uint32_t& held = scene_.file_counts[range.file];
      held = std::max(held, range.first + range.count);
    }
    const auto first = std::ranges::find_if(given, [](const auto& range) { return range.has_value(); });
    if (first == given.end()) return;  // nothing to show
    LodRange last = **first;
    for (std::size_t level = 0; level < given.size(); ++level) {
      if (given[level]) last = *given[level];
      leaf.levels.push_back(last);
      scene_.counts[level] += last.count;
    }
    scene_.leaves.push_back(std::move(leaf));
  }

  // A number that is none of the scene's levels; "": there is none.
  std::string spareLevel(const JsonNode& lods) const {
    for (const auto& [key, entry] : lods.value.items()) {
      const std::optional<std::uint64_t> level = parseWhole<std::uint64_t>(key);
      if (level && *level >= static_cast<std::uint64_t>(scene_.levels)) return key;
    }
    return "";
  }

  // Ranges of a file lie one behind the other: else a small file is a large model.
  void requireApart(const JsonNode& root) {
    std::ranges::sort(ranges_, {}, [](const LodRange& range) { return std::pair(range.file, range.first); });
    std::uint32_t file = 0, end = 0;
    for (const LodRange& range : ranges_) {
      if (range.file != file) end = 0;
      file = range.file;
      if (range.first < end) {
        root.fail("ranges of Gaussians overlap in " + printable(scene_.files[file]) +
                  expectedFound("one from " + std::to_string(end) + " on", std::to_string(range.first)));
      }
      end = range.first + range.count;
    }
  }

  void parseOwn(const JsonNode& own) {
    if (own.integer("version", 1, 1000) != lod::kVersion) return;
    scene_.sh_degree = static_cast<int>(own.integer("sh_degree", 0, 3));
    scene_.texture_mode = named<TextureMode>(own, "texture_mode");
    scene_.intersection = named<IntersectionModel>(own, "intersection");
    scene_.outside = named<TextureOutside>(own, "outside");
    if (own.has("background")) {
      const auto [r, g, b] =
          own.numbers<3>("background", -std::numeric_limits<float>::max(), std::numeric_limits<float>::max());
      scene_.background = glm::vec3(r, g, b);
    }
    if (own.has("cameras")) scene_.cameras = insideName(own, own.string("cameras"));
  }

  LodScene& scene_;
  std::vector<std::uint64_t> stored_;  // [levels] Gaussians that leaves name
  std::string spare_;                  // a level beyond the scene's
  std::vector<LodRange> ranges_;  // of all leaves, without those that a leaf repeats
};

// Planes of the picture, a tenth of it wider at each side: a point p is inside where dot(plane, p - eye) >= 0.
std::array<glm::dvec3, 5> planesOf(const Pinhole& camera) {
  std::array<glm::dvec3, 3> r;
  for (int k = 0; k < 3; ++k) r[k] = {camera.rotation[0][k], camera.rotation[1][k], camera.rotation[2][k]};
  const double w = camera.size.x, h = camera.size.y, mx = 0.1 * w, my = 0.1 * h;
  const glm::dvec2 f = camera.focal, c = camera.center;
  return {r[2], f.x * r[0] + (c.x + mx) * r[2], (w - c.x + mx) * r[2] - f.x * r[0], f.y * r[1] + (c.y + my) * r[2],
          (h - c.y + my) * r[2] - f.y * r[1]};
}

struct Candidate {
  double error2;  // [px^2]
  std::uint32_t leaf;
  bool operator<(const Candidate& other) const {
    return error2 != other.error2 ? error2 < other.error2 : leaf > other.leaf;
  }
};

}  // namespace

LodReader lodFolderReader(const std::filesystem::path& lod_meta) {
  const std::filesystem::path folder = lod_meta.parent_path();
  return [folder](const std::string& relative, std::uint64_t most) { return readRegularFile(folder / relative, most); };
}

bool isLodMeta(const std::filesystem::path& path) {
  return lowerCase(path.filename().string()).ends_with(kLodMetaName);
}

LodScene parseLodScene(std::span<const std::uint8_t> json, const std::string& path) {
  LodScene scene;
  scene.path = path;
  const nlohmann::json document = parseJson(json, path);
  Parser(scene).parse(JsonNode{document, path, ""}.object());
  return scene;
}

LodScene readLodScene(const std::filesystem::path& path) {
  return parseLodScene(readFile(path, kMaxLodMetaBytes), path.string());
}

std::vector<Camera> readLodCameras(const LodScene& scene, const LodReader& reader) {
  if (scene.cameras.empty()) return {};
  const std::vector<std::uint8_t> bytes = reader(scene.cameras, kMaxCamerasBytes);
  return parseCameras({bytes.begin(), bytes.end()}, lod::besideMeta(scene.path, scene.cameras));
}

std::vector<Camera> readLodCameras(const LodScene& scene, const LodReader& reader, std::vector<std::string>& warnings) {
  try {
    return readLodCameras(scene, reader);
  } catch (const Error& error) {
    warnings.push_back(std::string("no cameras: ") + error.what());
    return {};
  }
}

Bundle readLodFile(const LodScene& scene, std::uint32_t file, const LodReader& reader, bool base_only) {
  TG_ASSERT(file < scene.files.size(), "a file of the scene");
  const std::string& meta = scene.files[file];
  const std::string folder = meta.substr(0, meta.rfind('/') + 1);  // "" where there is none
  const std::string path = lod::besideMeta(scene.path, meta);
  const SogFiles files = [&](const std::string& name, std::uint64_t most) {
    return reader(name == kSogMetaName ? meta : folder + name, most);
  };
  const std::uint32_t named = scene.file_counts[file];
  Bundle loaded = parseSogFiles(filesInside(files, path), path, std::max<std::uint32_t>(named, 1), base_only);
  const GaussianModel& model = loaded.model;
  if (model.size() < named) {
    throw Error(ErrorKind::badData, path,
                "too few Gaussians for what lod-meta.json says" + expectedFound(std::uint64_t{named}, model.size()));
  }
  if (scene.sh_degree && *scene.sh_degree != model.sh_degree) {
    throw Error(ErrorKind::badData, path,
                "another SH degree than lod-meta.json says" +
                    expectedFound(std::to_string(*scene.sh_degree), std::to_string(model.sh_degree)));
  }
  return loaded;
}

void requireSameTextures(const LodScene& scene, std::uint32_t file, const GaussianModel& found,
                         const GaussianModel& others) {
  if (!isTextured(found) || !isTextured(others)) return;
  if (found.intersection == others.intersection && found.outside == others.outside) return;
  throw Error(ErrorKind::badData, lod::besideMeta(scene.path, scene.files[file]),
              "another intersection model, or another way for textures to end, than other files have");
}

std::vector<std::uint8_t> chooseLevels(const LodScene& scene, const Pinhole& camera, std::uint64_t budget,
                                       double least_pixels) {
  const auto coarsest = static_cast<std::uint8_t>(scene.levels - 1);
  std::vector<std::uint8_t> levels = sameLevel(scene, coarsest);
  std::uint64_t total = countOf(scene, levels);
  const glm::dvec3 eye = camera.position();
  const std::array<glm::dvec3, 5> planes = planesOf(camera);
  const double focal = std::max(camera.focal.x, camera.focal.y), f2 = focal * focal;
  // Of one Gaussian that filled the leaf.
  const auto pixels2 = [&](const LodLeaf& leaf) {
    double d2 = 0.0, q = 0.0;
    for (int k = 0; k < 3; ++k) {
      const double low = leaf.means.low[k], high = leaf.means.high[k], side = high - low;
      const double out = eye[k] < low ? low - eye[k] : eye[k] > high ? eye[k] - high : 0.0;
      d2 += side * side;
      q += out * out;
    }
    if (d2 == 0.0) d2 = 1e-12;
    return f2 * d2 / (q + 0.01 * d2);
  };
  const auto visible = [&](const LodLeaf& leaf) {
    for (const glm::dvec3& plane : planes) {
      double reach = 0.0;
      for (int k = 0; k < 3; ++k) {
        reach += plane[k] * (static_cast<double>(plane[k] >= 0.0 ? leaf.bound.high[k] : leaf.bound.low[k]) - eye[k]);
      }
      if (reach < 0.0) return false;
    }
    return true;
  };
  const auto countAt = [&](std::uint32_t leaf) { return scene.leaves[leaf].levels[levels[leaf]].count; };
  std::vector<double> size2(scene.leaves.size());
  std::priority_queue<Candidate> open;
  for (std::uint32_t i = 0; i < scene.leaves.size(); ++i) {
    if (!visible(scene.leaves[i])) continue;
    size2[i] = pixels2(scene.leaves[i]);
    open.push({size2[i] / countAt(i), i});
  }
  while (!open.empty()) {
    const Candidate next = open.top();
    open.pop();
    if (next.error2 <= least_pixels * least_pixels) break;
    std::uint8_t& level = levels[next.leaf];
    if (level == 0) continue;
    const std::uint64_t before = countAt(next.leaf), after = scene.leaves[next.leaf].levels[level - 1u].count;
    if (total - before + after > budget) break;
    total = total - before + after;
    --level;
    open.push({size2[next.leaf] / countAt(next.leaf), next.leaf});
  }
  return levels;
}

std::vector<std::uint8_t> sameLevel(const LodScene& scene, int level) {
  TG_ASSERT(level >= 0 && level < scene.levels, "a level of the scene");
  return std::vector<std::uint8_t>(scene.leaves.size(), static_cast<std::uint8_t>(level));
}

std::uint64_t countOf(const LodScene& scene, std::span<const std::uint8_t> levels) {
  TG_ASSERT(levels.size() == scene.leaves.size(), "a level for every leaf");
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < levels.size(); ++i) count += scene.leaves[i].levels[levels[i]].count;
  return count;
}

std::vector<std::uint32_t> filesOf(const LodScene& scene, std::span<const std::uint8_t> levels) {
  TG_ASSERT(levels.size() == scene.leaves.size(), "a level for every leaf");
  std::vector<std::uint32_t> files;
  for (std::size_t i = 0; i < levels.size(); ++i) files.push_back(scene.leaves[i].levels[levels[i]].file);
  std::ranges::sort(files);
  files.erase(std::ranges::unique(files).begin(), files.end());
  return files;
}

GaussianModel assembleLod(const LodScene& scene, std::span<const std::uint8_t> levels,
                          const std::function<const GaussianModel&(std::uint32_t file)>& file) {
  const std::uint64_t count = countOf(scene, levels);
  if (count > kMaxGaussians) {
    throw Error(ErrorKind::badData, scene.path, "too many Gaussians for one model" + atMost(kMaxGaussians, count));
  }
  GaussianModel model;
  std::uint64_t texels = 0;
  bool textured = false;
  const auto visit = [&](auto&& use) {
    for (std::size_t i = 0; i < levels.size(); ++i) {
      const LodRange& range = scene.leaves[i].levels[levels[i]];
      use(range, file(range.file));
    }
  };
  visit([&](const LodRange& range, const GaussianModel& from) {
    TG_ASSERT(from.size() >= std::size_t{range.first} + range.count, "a file holds what its ranges name");
    if (!isTextured(from)) return;
    textured = true;
    for (std::uint32_t i = 0; i < range.count; ++i) texels += from.atlas.rects[range.first + i].texelCount();
  });
  if (texels > kMaxModelTexels) {
    throw Error(ErrorKind::badData, scene.path, "too many texels for one model" + atMost(kMaxModelTexels, texels));
  }
  if (textured) {
    model.atlas.rects.reserve(count);
    model.atlas.texels.reserve(texels);
  }
  std::size_t at = 0;
  visit([&](const LodRange& range, const GaussianModel& from) {
    if (at == 0) {
      resizeGaussians(model, count, from.sh_degree);
    } else if (from.sh_degree != model.sh_degree) {
      throw Error(ErrorKind::badData, lod::besideMeta(scene.path, scene.files[range.file]),
                  "another SH degree than other files have" +
                      expectedFound(std::to_string(model.sh_degree), std::to_string(from.sh_degree)));
    }
    forEachField(
        [&](const Field& field, auto& to, const auto& values) {
          const std::size_t row = field.values(model.shCount());
          std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(range.first * row), range.count * row,
                      to.begin() + static_cast<std::ptrdiff_t>(at * row));
        },
        model, from);
    at += range.count;
    if (!textured) return;
    for (std::uint32_t i = range.first; i < range.first + range.count; ++i) {
      TextureRect rect = rectOf(from, i);
      const auto first = from.atlas.texels.begin() + rect.offset;
      rect.offset = rect.texelCount() == 0 ? 0 : static_cast<std::uint32_t>(model.atlas.texels.size());
      model.atlas.texels.insert(model.atlas.texels.end(), first, first + rect.texelCount());
      model.atlas.rects.push_back(rect);
    }
    if (!isTextured(from)) return;
    requireSameTextures(scene, range.file, from, model);
    model.texture_mode = model.texture_mode | from.texture_mode;
    model.intersection = from.intersection;
    model.outside = from.outside;
  });
  if (!textured) {
    model.intersection = scene.intersection;
    model.outside = scene.outside;
  }
  return model;
}

}  // namespace tg
