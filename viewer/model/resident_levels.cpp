// SPDX-License-Identifier: Apache-2.0
// Leaves go from files to pieces, and from pieces and the model before to the next model.
#include "viewer/model/resident_levels.h"

#include <algorithm>
#include <functional>
#include <new>
#include <optional>
#include <tuple>

#include "core/file/file.h"
#include "core/file/identity.h"
#include "core/file/web_address.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "viewer/model/http_reader.h"

namespace tg {
namespace {

// From the eye to a leaf's box, squared.
double distance2(const LodLeaf& leaf, glm::dvec3 eye) {
  const glm::dvec3 nearest = glm::clamp(eye, glm::dvec3(leaf.means.low), glm::dvec3(leaf.means.high));
  return glm::dot(nearest - eye, nearest - eye);
}

using Bytes = std::vector<std::uint8_t>;

// `stamp` is of the file as it was opened. `now()` gives that of now, none where nothing can be said, and where `same`
// denies, `again()` the file's bytes: stamps may change with the time of day, the machine of several that answers, or
// the inode of a mount, and the file not.
template <typename Stamp, typename Same, typename Now, typename Again>
std::function<void()> requireSame(const std::filesystem::path& path, Bytes opened, Stamp stamp, Same same, Now now,
                                  Again again) {
  const auto bytes = std::make_shared<const Bytes>(std::move(opened));
  return [=]() mutable {
    const auto fresh = now();
    if (!fresh || same(stamp, *fresh)) return;
    if (again() != *bytes) throw SceneRewritten(path);
    stamp = *fresh;
  };
}

}  // namespace

OpenedLevels openLevels(const std::filesystem::path& path, const std::stop_token& stop) {
  OpenedLevels opened;
  if (isWebAddress(path.string())) {
    const auto server = std::make_shared<HttpReader>(path.string());
    opened.reader = [server, stop](const std::string& relative, std::uint64_t most) {
      return server->read(relative, most, stop);
    };
    HttpStamp stamp;
    Bytes bytes = server->read("", kMaxLodMetaBytes, stop, &stamp);
    opened.scene = parseLodScene(bytes, path.string());
    opened.require_same = requireSame(
        path, std::move(bytes), stamp, sameEdition,
        [server, stop, told = !stamp.modified.empty() || !stamp.tag.empty()] {
          return told && server->answered() ? server->stampNow(stop) : std::nullopt;
        },
        [server, stop] { return server->read("", kMaxLodMetaBytes, stop); });
  } else {
    // As of a model in one file.
    std::error_code ignored;
    if (!std::filesystem::exists(path, ignored) && !ignored) {
      throw Error(ErrorKind::cannotRead, path.string(), "no such file");
    }
    opened.reader = [files = lodFolderReader(path), stop](const std::string& relative, std::uint64_t most) {
      if (stop.stop_requested()) throw ReadCancelled();
      return files(relative, most);
    };
    const FileIdentity stamp = identityOf(path).value_or(FileIdentity{});
    Bytes bytes = readFile(path, kMaxLodMetaBytes);
    opened.scene = parseLodScene(bytes, path.string());
    opened.require_same = requireSame(
        path, std::move(bytes), stamp, std::equal_to<>(), [path] { return identityOf(path); },
        [path] { return readRegularFile(path, kMaxLodMetaBytes); });
  }
  opened.cameras = readLodCameras(opened.scene, opened.reader, opened.warnings);
  return opened;
}

ResidentLevels::ResidentLevels(const LodScene& scene, LodReader reader, std::function<void()> require_same)
    : scene_(scene),
      reader_(std::move(reader)),
      require_same_(std::move(require_same)),
      coarsest_levels_(sameLevel(scene, scene.levels - 1)),
      levels_(coarsest_levels_) {
  // No place is known yet: every leaf is missing.
  for (const std::uint32_t file : filesOf(scene, levels_)) read(file, levels_);
  coarsest_ = model_ = joined(levels_);
  coarsest_starts_ = starts_ = startsOf(levels_);
  pieces_.clear();
  waiting_.clear();
  bytes_waiting_ = 0;
}

ResidentLevels::Place ResidentLevels::placeOf(std::size_t leaf, std::uint8_t level) const {
  // A leaf may have the same Gaussians at several levels.
  const std::vector<LodRange>& ranges = scene_.leaves[leaf].levels;
  const LodRange& range = ranges[level];
  if (coarsest_ && range == ranges[coarsest_levels_[leaf]]) return {coarsest_.get(), coarsest_starts_[leaf]};
  if (model_ && range == ranges[levels_[leaf]]) return {model_.get(), starts_[leaf]};
  const auto found = waiting_.find({leaf, level});
  return found == waiting_.end() ? Place{} : found->second;
}

std::vector<std::uint32_t> ResidentLevels::missing(std::span<const std::uint8_t> wanted, glm::dvec3 eye) const {
  TG_ASSERT(wanted.size() == scene_.leaves.size(), "a level for every leaf");
  std::map<std::uint32_t, double> nearest;  // by file
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (placeOf(i, wanted[i]).model) continue;
    const double distance = distance2(scene_.leaves[i], eye);
    const auto [at, fresh] = nearest.emplace(scene_.leaves[i].levels[wanted[i]].file, distance);
    if (!fresh) at->second = std::min(at->second, distance);
  }
  std::vector<std::pair<double, std::uint32_t>> order;
  for (const auto& [file, distance] : nearest) order.emplace_back(distance, file);
  std::ranges::sort(order);
  std::vector<std::uint32_t> files;
  for (const auto& [distance, file] : order) files.push_back(file);
  return files;
}

GaussianModel ResidentLevels::readFile(std::uint32_t file) {
  const LodReader counted = [this](const std::string& relative, std::uint64_t most) {
    std::vector<std::uint8_t> bytes = reader_(relative, most);
    bytes_read_ += bytes.size();
    return bytes;
  };
  const auto askAgain = [this] {
    if (require_same_) require_same_();
  };
  GaussianModel model;
  try {
    model = readLodFile(scene_, file, counted).model;
  } catch (const Error&) {
    askAgain();  // the files of the scene before may be gone
    throw;
  }
  askAgain();
  return model;
}

void ResidentLevels::read(std::uint32_t file, std::span<const std::uint8_t> wanted) {
  TG_ASSERT(wanted.size() == scene_.leaves.size(), "a level for every leaf");
  const GaussianModel whole = readFile(file);
  if (coarsest_ && whole.sh_degree != coarsest_->sh_degree) {
    throw Error(ErrorKind::badData, scene_.path,
                scene_.files[file] + ": another SH degree than the coarsest level has" +
                    expectedFound(std::to_string(coarsest_->sh_degree), std::to_string(whole.sh_degree)));
  }
  // Else all of them together would be refused later (assembleLod).
  if (coarsest_) requireSameTextures(scene_, file, whole, *coarsest_);
  if (model_) requireSameTextures(scene_, file, whole, *model_);
  for (const auto& piece : pieces_) requireSameTextures(scene_, file, whole, *piece);
  // The leaves that want it, as a scene of their own.
  LodScene part;
  part.path = scene_.path;
  part.files = {scene_.files[file]};
  part.intersection = scene_.intersection;
  part.outside = scene_.outside;
  std::vector<std::pair<std::size_t, std::uint32_t>> kept;  // leaf, and where it begins in the piece
  std::uint32_t count = 0;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    LodRange range = scene_.leaves[i].levels[wanted[i]];
    if (range.file != file || placeOf(i, wanted[i]).model) continue;
    kept.emplace_back(i, count);
    count += range.count;
    range.file = 0;
    part.leaves.push_back({{}, {}, {range}});
  }
  if (kept.empty()) return;
  pieces_.push_back(std::make_unique<const GaussianModel>(
      assembleLod(part, sameLevel(part, 0), [&](std::uint32_t) -> const GaussianModel& { return whole; })));
  bytes_waiting_ += bytesOf(*pieces_.back());
  for (const auto& [leaf, first] : kept) waiting_[{leaf, wanted[leaf]}] = {pieces_.back().get(), first};
}

std::vector<std::uint8_t> ResidentLevels::reachable(std::span<const std::uint8_t> wanted, std::uint64_t budget) const {
  TG_ASSERT(wanted.size() == scene_.leaves.size(), "a level for every leaf");
  std::vector<std::uint8_t> levels(wanted.begin(), wanted.end());
  for (std::size_t i = 0; i < levels.size(); ++i) {
    if (!placeOf(i, levels[i]).model) levels[i] = levels_[i];
  }
  std::uint64_t total = countOf(scene_, levels);
  for (std::size_t i = 0; i < levels.size() && total > budget; ++i) {
    if (levels[i] >= wanted[i]) continue;
    const std::vector<LodRange>& ranges = scene_.leaves[i].levels;
    total = total - ranges[levels[i]].count + ranges[coarsest_levels_[i]].count;
    levels[i] = coarsest_levels_[i];
  }
  return levels;
}

std::vector<std::uint32_t> ResidentLevels::startsOf(std::span<const std::uint8_t> levels) const {
  std::vector<std::uint32_t> starts;
  starts.reserve(levels.size());
  std::uint32_t at = 0;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    starts.push_back(at);
    at += scene_.leaves[i].levels[levels[i]].count;
  }
  return starts;
}

// Every model that leaves lie in is a file of a scene of one level.
std::shared_ptr<const GaussianModel> ResidentLevels::joined(std::span<const std::uint8_t> levels) const {
  LodScene parts;
  parts.path = scene_.path;
  parts.intersection = scene_.intersection;
  parts.outside = scene_.outside;
  std::vector<const GaussianModel*> models;
  parts.leaves.reserve(levels.size());
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const Place place = placeOf(i, levels[i]);
    TG_ASSERT(place.model != nullptr, "the level is there");
    const LodRange& range = scene_.leaves[i].levels[levels[i]];
    auto at = std::ranges::find(models, place.model);
    if (at == models.end()) {
      models.push_back(place.model);
      parts.files.push_back(scene_.files[range.file]);
      at = models.end() - 1;
    }
    parts.leaves.push_back({{}, {}, {{static_cast<std::uint32_t>(at - models.begin()), place.first, range.count}}});
  }
  return std::make_shared<const GaussianModel>(assembleLod(
      parts, sameLevel(parts, 0), [&](std::uint32_t file) -> const GaussianModel& { return *models[file]; }));
}

void ResidentLevels::assemble(std::span<const std::uint8_t> levels) {
  TG_ASSERT(levels.size() == scene_.leaves.size(), "a level for every leaf");
  model_ = joined(levels);
  levels_.assign(levels.begin(), levels.end());
  starts_ = startsOf(levels_);
  pieces_.clear();
  waiting_.clear();
  bytes_waiting_ = 0;
}

std::vector<std::uint8_t> withoutFiles(const LodScene& scene, std::vector<std::uint8_t> levels,
                                       const std::set<std::uint32_t>& lost) {
  TG_ASSERT(levels.size() == scene.leaves.size(), "a level for every leaf");
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const std::vector<LodRange>& ranges = scene.leaves[i].levels;
    while (levels[i] + 1 < scene.levels && lost.contains(ranges[levels[i]].file)) ++levels[i];
  }
  return levels;
}

Scene sceneOf(const OpenedLevels& opened, std::shared_ptr<const GaussianModel> model,
              const std::filesystem::path& path) {
  Scene scene;
  scene.path = path;
  scene.streamed_from = static_cast<std::size_t>(opened.scene.counts.front());
  scene.background = opened.scene.background.value_or(scene.background);
  scene.knows_background = opened.scene.background.has_value();
  scene.cameras = opened.cameras;
  scene.up = sceneUp(opened.cameras);
  scene.warnings = opened.warnings;
  if (opened.scene.has_environment) scene.warnings.emplace_back("its environment is not shown");
  scene.model = std::move(model);
  measure(scene);
  return scene;
}

}  // namespace tg
