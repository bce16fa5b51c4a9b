// SPDX-License-Identifier: Apache-2.0
// Leaves by median splits, the levels of each, files of leaves, and lod-meta.json.
#include "converter/lod/write_lod.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <thread>

#include "converter/formats/space_curve.h"
#include "converter/lod/coarser.h"
#include "converter/lod/lod_names.h"
#include "converter/lod/lod_scene.h"
#include "converter/lod/split.h"
#include "converter/sog/sog.h"
#include "core/bundle/camera_file.h"
#include "core/file/atomic_files.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/merge/moments.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/descriptor.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "core/system/parallel.h"
#include "core/system/temporary_files.h"

namespace tg {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;


struct Leaf {
  std::span<std::uint32_t> gaussians;  // of the model, along a Hilbert curve
  Box means;
  Box bound;
  std::vector<GaussianModel> coarse;  // levels from 1 on
  std::vector<LodRange> ranges;       // [levels]
};

struct Node {
  int leaf = -1;                    // or
  std::size_t left = 0, right = 0;  // nodes
};

struct Tree {
  std::vector<Node> nodes;  // the root last
  std::vector<Leaf> leaves;
};

std::size_t addNode(Tree& tree, std::span<const glm::vec3> places, std::span<std::uint32_t> part, std::size_t most) {
  Node node;
  if (part.size() <= most) {
    node.leaf = static_cast<int>(tree.leaves.size());
    tree.leaves.push_back({part, boxOf(places, part), {}, {}, {}});
  } else {
    const std::size_t middle = part.size() / 2;
    splitAt(places, part, middle);
    node.left = addNode(tree, places, part.first(middle), most);
    node.right = addNode(tree, places, part.subspan(middle), most);
  }
  tree.nodes.push_back(node);
  return tree.nodes.size() - 1;
}

void orderAlongCurve(std::span<const glm::vec3> places, std::span<std::uint32_t> part) {
  std::ranges::sort(part);
  std::vector<glm::vec3> own;
  for (const std::uint32_t i : part) own.push_back(places[i]);
  std::vector<std::uint32_t> ordered;
  for (const std::uint32_t j : hilbertOrder(own)) ordered.push_back(part[j]);
  std::ranges::copy(ordered, part.begin());
}

Box reached(const Box& box) { return {lod::reached(box.low), lod::reached(box.high)}; }

// To 3 sigma along the world's axes.
Box boundOf(const GaussianModel& model) {
  Box bound{model.mean[0], model.mean[0]};
  for (std::size_t i = 0; i < model.size(); ++i) {
    const glm::dmat3 covariance = momentsOf(model, i, 1.0).covariance;
    const glm::vec3 reach(3.0 * glm::sqrt(glm::dvec3(covariance[0][0], covariance[1][1], covariance[2][2])));
    bound = around(bound, {model.mean[i] - reach, model.mean[i] + reach});
  }
  return reached(bound);
}

// [levels][leaves]
std::vector<std::vector<std::size_t>> countsOf(const Tree& tree, const LodOptions& options) {
  std::vector<std::vector<std::size_t>> counts(1);
  for (const Leaf& leaf : tree.leaves) counts[0].push_back(leaf.gaussians.size());
  while (counts.size() < kMaxLodLevels) {
    const std::vector<std::size_t>& last = counts.back();
    if (std::accumulate(last.begin(), last.end(), std::size_t{0}) <= options.coarsest) break;
    std::vector<std::size_t> next;
    for (const std::size_t count : last) next.push_back((count + options.merged - 1) / options.merged);
    if (next == last) break;
    counts.push_back(std::move(next));
  }
  return counts;
}

// Consecutive leaves at one level.
struct File {
  std::size_t level;
  std::size_t first_leaf, end_leaf;
};

std::vector<File> filesOf(const std::vector<std::vector<std::size_t>>& counts, Tree& tree, const LodOptions& options) {
  std::vector<File> files;
  for (std::size_t level = 0; level < counts.size(); ++level) {
    std::size_t held = 0;
    for (std::size_t leaf = 0; leaf < tree.leaves.size(); ++leaf) {
      const std::size_t count = counts[level][leaf];
      if (leaf == 0 || held + count > options.file) {
        files.push_back({level, leaf, leaf});
        held = 0;
      }
      files.back().end_leaf = leaf + 1;
      tree.leaves[leaf].ranges.push_back({static_cast<std::uint32_t>(files.size() - 1),
                                          static_cast<std::uint32_t>(held), static_cast<std::uint32_t>(count)});
      held += count;
    }
  }
  return files;
}

constexpr const char* kDigits = "0123456789";
constexpr std::string_view kFileMeta = "/meta.json", kCamerasName = "cameras.json";
constexpr std::chrono::seconds kLongestTurn(30);  // that a program may take to name its folder

bool allOf(std::string_view text, const char* known) {
  return !text.empty() && text.find_first_not_of(known) == std::string_view::npos;
}

fs::path parentOf(const fs::path& file) { return file.parent_path().empty() ? fs::path(".") : file.parent_path(); }

// The lod-meta.json that is there, held by this program alone while this lives, so that no two remove what one names.
// The system lets go of it with the process. Nothing is held where none is there or the file system knows no locks.
class Turn {
 public:
  explicit Turn(const fs::path& meta) {
    const auto until = std::chrono::steady_clock::now() + kLongestTurn;
    for (;;) {
      file_.emplace(::open(meta.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
      if (file_->get() < 0) {
        absent_ = errno == ENOENT;
        return;
      }
      const bool held = ::flock(file_->get(), LOCK_EX | LOCK_NB) == 0;
      if (!held && errno != EWOULDBLOCK) return;
      if (held && isStillAt(meta)) return;  // else the one before has just replaced it
      late_ = std::chrono::steady_clock::now() >= until;
      if (late_) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  }
  // Whether what it names may go: no other has held it all the time, and none has made it since.
  bool mayRemove() const { return !late_ && !absent_; }

 private:
  bool isStillAt(const fs::path& meta) const {
    struct stat opened{}, there{};
    return ::fstat(file_->get(), &opened) == 0 && ::stat(meta.c_str(), &there) == 0 && opened.st_dev == there.st_dev &&
           opened.st_ino == there.st_ino;
  }

  std::optional<Descriptor> file_;
  bool late_ = false, absent_ = false;
};

// Whether a list of files in `parent`, but for the one of that name, has one in the folder N/.
bool isNamedIn(const fs::path& parent, const std::string& folder, const fs::path& but_for) {
  for (const fs::directory_entry& entry : fs::directory_iterator(parent)) {
    if (!isLodMeta(entry.path()) || entry.path().filename() == but_for) continue;
    const std::vector<std::uint8_t> other = readRegularFile(entry.path(), kMaxLodMetaBytes);
    if (std::string_view(reinterpret_cast<const char*>(other.data()), other.size()).find("\"" + folder) !=
        std::string_view::npos)
      return true;
  }
  return false;
}

// A folder that is gone when this ends, unless it has got its name. Open to whom the process' mask allows.
class NewFolder {
 public:
  explicit NewFolder(const fs::path& parent) {
    path_ = makeTemporaryFolder(parent / ".new-", 0777, removed_);
    if (path_.empty())
      throw Error(ErrorKind::cannotWrite, parent.string(), "cannot make a folder here: " + systemReason());
  }
  ~NewFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  NewFolder& operator=(NewFolder&&) = delete;

  const fs::path& path() const { return path_; }

  // The first number from `from` on that nothing beside it has as its name. Throws Error(cannotWrite).
  int freeNumber(int from) const {
    constexpr int kNumbers = 1000;
    for (int number = from; number < kNumbers; ++number) {
      if (!isTaken(number)) return number;
    }
    throw cannotName("0 to " + std::to_string(kNumbers - 1) + " are there already");
  }
  // Gives it the number as its name; false where something has come by that name. Throws Error(cannotWrite).
  bool settle(int number) {
    std::error_code status;
    fs::rename(path_, beside(number), status);
    if (status) {
      if (isTaken(number)) return false;
      throw cannotName(status.message());
    }
    path_ = beside(number);
    removed_.reset();  // a signal must not take what lod-meta.json is about to name
    return true;
  }
  void keep() { path_.clear(); }

 private:
  fs::path beside(int number) const { return path_.parent_path() / std::to_string(number); }
  bool isTaken(int number) const {
    std::error_code ignored;
    return fs::exists(fs::symlink_status(beside(number), ignored));  // a link to nothing takes it, too
  }
  Error cannotName(const std::string& reason) const {
    return {ErrorKind::cannotWrite, path_.parent_path().string(), "cannot name the folder of files: " + reason};
  }

  fs::path path_;
  std::optional<RemovedBySignal> removed_;
};

// N/NAME with the folder N, a number as freeNumber() gives it; the name's part behind it, "" where it is another's.
std::string_view inFolder(std::string_view file, std::string_view folder) {
  return file.starts_with(folder) && allOf(folder.substr(0, folder.size() - 1), kDigits) ? file.substr(folder.size())
                                                                                         : std::string_view();
}

// Whether the file is named as Writer names its own: N/LEVEL_NUMBER/meta.json.
bool isOurs(std::string_view file, std::string_view folder) {
  std::string_view rest = inFolder(file, folder);
  if (!rest.ends_with(kFileMeta)) return false;
  rest.remove_suffix(kFileMeta.size());
  const std::size_t middle = rest.find('_');
  return middle != std::string_view::npos && allOf(rest.substr(0, middle), kDigits) &&
         allOf(rest.substr(middle + 1), kDigits);
}

// What our lod-meta.json that is there names, below the folder that it stands in: those files alone go with it, and
// none where one of them has a name that Writer does not give, or lies behind a link.
std::vector<fs::path> filesBefore(const fs::path& path) {
  const fs::path parent = parentOf(path);
  try {
    const LodScene scene = readLodScene(path);
    if (!scene.sh_degree) return {};  // another program's
    const std::string first = scene.files.front(), folder = first.substr(0, first.find('/') + 1);
    const bool ours = std::ranges::all_of(scene.files, [&](const std::string& file) { return isOurs(file, folder); });
    if (!ours || (!scene.cameras.empty() && inFolder(scene.cameras, folder) != kCamerasName)) return {};
    if (isNamedIn(parent, folder, path.filename())) return {};
    std::vector<fs::path> files;
    if (!scene.cameras.empty()) files.push_back(parent / scene.cameras);
    for (const std::string& file : scene.files) {
      const fs::path meta = parent / file;
      if (!isFile(meta)) continue;
      if (fs::canonical(meta.parent_path()) != fs::canonical(parent) / fs::path(file).parent_path()) return {};
      files.push_back(meta);
      const nlohmann::json sog = parseJson(readRegularFile(meta, kMaxLodMetaBytes), meta.string());
      for (const nlohmann::json& part : sog) {
        if (!part.is_object() || !part.contains("files")) continue;
        for (const nlohmann::json& image : part["files"]) {
          const fs::path beside = image.is_string() ? fs::path(image.get<std::string>()) : fs::path();
          if (beside == beside.filename() && beside.extension() == ".webp")
            files.push_back(meta.parent_path() / beside);
        }
      }
    }
    return files;
  } catch (const std::exception&) {
    return {};
  }
}

// And the folders that are empty then.
void removeFiles(const std::vector<fs::path>& files, const fs::path& parent) {
  std::error_code ignored;
  for (const fs::path& file : files) fs::remove(file, ignored);
  for (const fs::path& file : files) {
    for (fs::path folder = file.parent_path(); folder != parent && !folder.empty(); folder = folder.parent_path()) {
      if (!fs::remove(folder, ignored)) break;
    }
  }
}

Json numbersOf(glm::vec3 v) {
  Json array = Json::array();
  for (int k = 0; k < 3; ++k) array.push_back(shortDouble(v[k]));
  return array;
}

Json jsonOf(const Box& box) { return {{"min", numbersOf(box.low)}, {"max", numbersOf(box.high)}}; }

class Writer {
 public:
  Writer(const fs::path& path, const Bundle& source, const LodOptions& options)
      : path_(path), source_(source), options_(options) {}

  LodReport write() {
    const GaussianModel& model = source_.model;
    report_.order.resize(model.size());
    std::iota(report_.order.begin(), report_.order.end(), 0u);
    addNode(tree_, model.mean, report_.order, options_.leaf);
    const std::vector<std::vector<std::size_t>> counts = countsOf(tree_, options_);
    files_ = filesOf(counts, tree_, options_);
    for (const auto& level : counts) {
      report_.counts.push_back(std::accumulate(level.begin(), level.end(), std::uint64_t{0}));
    }
    const fs::path parent = parentOf(path_);
    FolderToFill filled(parent);
    requireWritable(path_);
    NewFolder folder(parent);
    const std::string cameras = source_.cameras.empty() ? "" : storedCameras(source_.cameras, path_.string());
    makeLevels(counts);
    writeFiles(folder.path());
    if (!cameras.empty()) add(folder.path() / kCamerasName, cameras);
    commitMeta(folder, counts);
    filled.keep();
    report_.files = files_.size();
    report_.bytes = bytes_;
    report_.clipped_texels = clipped_texels_;
    return std::move(report_);
  }

 private:
  // The folder's name and lod-meta.json, which tells it: all that takes time comes before both get their names. What
  // lod-meta.json named before goes, also where another program has written it meanwhile: they take turns.
  void commitMeta(NewFolder& folder, const std::vector<std::vector<std::size_t>>& counts) {
    for (int number = folder.freeNumber(0);; number = folder.freeNumber(number)) {
      const std::string meta = dumpJson(metaOf(counts, std::to_string(number)));
      const std::span bytes(reinterpret_cast<const std::uint8_t*>(meta.data()), meta.size());
      (void)parseLodScene(bytes, path_.string());  // what is there goes for what can be read
      AtomicFiles files;
      files.add(path_, bytes);
      const Turn turn(path_);
      const std::vector<fs::path> before = turn.mayRemove() ? filesBefore(path_) : std::vector<fs::path>();
      if (!folder.settle(number)) continue;
      files.commit();
      folder.keep();
      removeFiles(before, parentOf(path_));
      bytes_ += meta.size();
      return;
    }
  }

  void makeLevels(const std::vector<std::vector<std::size_t>>& counts) {
    parallelFor(static_cast<std::int64_t>(tree_.leaves.size()), 1, [&](std::int64_t item) {
      const auto i = static_cast<std::size_t>(item);
      Leaf& leaf = tree_.leaves[i];
      orderAlongCurve(source_.model.mean, leaf.gaussians);
      const GaussianModel finest = select(source_.model, leaf.gaussians);
      leaf.bound = boundOf(finest);
      for (std::size_t level = 1; level < counts.size(); ++level) {
        const GaussianModel& finer = level == 1 ? finest : leaf.coarse.back();
        leaf.coarse.push_back(coarser(finer, counts[level][i]));
        leaf.bound = around(leaf.bound, boundOf(leaf.coarse.back()));
      }
    });
  }

  GaussianModel modelOf(const File& file) const {
    if (file.level == 0) {
      const std::uint32_t* first = tree_.leaves[file.first_leaf].gaussians.data();
      const std::span<std::uint32_t> last = tree_.leaves[file.end_leaf - 1].gaussians;
      return select(source_.model, {first, last.data() + last.size()});
    }
    GaussianModel model = tree_.leaves[file.first_leaf].coarse[file.level - 1];
    for (std::size_t leaf = file.first_leaf + 1; leaf < file.end_leaf; ++leaf) {
      const GaussianModel& next = tree_.leaves[leaf].coarse[file.level - 1];
      if (isTextured(next)) model.texture_mode = next.texture_mode;
      append(model, next);
    }
    return model;
  }

  void writeFiles(const fs::path& folder) {
    parallelFor(static_cast<std::int64_t>(files_.size()), 1, [&](std::int64_t item) {
      const fs::path own = folder / folderOf(static_cast<std::size_t>(item));
      createFolder(own);
      SogReport report;
      const File& file = files_[static_cast<std::size_t>(item)];
      for (const ZipEntry& entry : sogFiles(modelOf(file), path_.string(), {}, &report)) {
        add(own / entry.name, entry.bytes);
      }
      clipped_texels_ += report.clipped_texels;
    });
  }

  template <typename Content>
  void add(const fs::path& path, const Content& content) {
    writeFileAtomically(path, std::span(reinterpret_cast<const std::uint8_t*>(content.data()), content.size()));
    bytes_ += content.size();
  }

  std::string folderOf(std::size_t file) const {
    return std::to_string(files_[file].level) + "_" + std::to_string(file);
  }

  Json metaOf(const std::vector<std::vector<std::size_t>>& counts, const std::string& folder) const {
    Json meta = Json::object();
    meta["version"] = lod::kFormatVersion;
    meta["lodLevels"] = counts.size();
    meta["count"] = std::accumulate(report_.counts.begin(), report_.counts.end(), std::uint64_t{0});
    meta["counts"] = report_.counts;
    Json own = {{"version", lod::kVersion},
                {"sh_degree", source_.model.sh_degree},
                {"texture_mode", name(isTextured(source_.model) ? source_.model.texture_mode : TextureMode::none)},
                {"intersection", name(source_.model.intersection)},
                {"outside", name(source_.model.outside)}};
    if (source_.knows_background) own["background"] = numbersOf(source_.background);
    if (!source_.cameras.empty()) own["cameras"] = folder + "/" + std::string(kCamerasName);
    meta[lod::kOwn] = std::move(own);
    Json& names = meta["filenames"] = Json::array();
    for (std::size_t i = 0; i < files_.size(); ++i)
      names.push_back(folder + "/" + folderOf(i) + std::string(kFileMeta));
    Box whole;
    meta["tree"] = nodeOf(tree_.nodes.back(), whole);
    return meta;
  }

  Json nodeOf(const Node& node, Box& bound) const {
    Json json = Json::object();
    json["bound"] = nullptr;  // its place
    if (node.leaf >= 0) {
      const Leaf& leaf = tree_.leaves[static_cast<std::size_t>(node.leaf)];
      bound = leaf.bound;
      json[lod::kMeans] = jsonOf(reached(leaf.means));
      Json& lods = json["lods"] = Json::object();
      for (std::size_t level = 0; level < leaf.ranges.size(); ++level) {
        const LodRange& range = leaf.ranges[level];
        lods[std::to_string(level)] = {{"file", range.file}, {"offset", range.first}, {"count", range.count}};
      }
    } else {
      Box left, right;
      Json children = Json::array({nodeOf(tree_.nodes[node.left], left), nodeOf(tree_.nodes[node.right], right)});
      bound = around(left, right);
      json["children"] = std::move(children);
    }
    json["bound"] = jsonOf(bound);
    return json;
  }

  const fs::path& path_;
  const Bundle& source_;
  const LodOptions& options_;
  Tree tree_;
  std::vector<File> files_;
  std::atomic<std::uint64_t> bytes_{0}, clipped_texels_{0};
  LodReport report_;
};

}  // namespace

LodReport writeLod(const std::filesystem::path& path, const Bundle& source, const LodOptions& options) {
  TG_ASSERT(lengthsAgree(source.model), "the model's arrays have their lengths");
  TG_ASSERT(options.leaf > 0 && options.file > 0 && options.merged > 1, "sizes that make a tree");
  if (source.model.size() == 0) throw Error(ErrorKind::badData, path.string(), "the model has no Gaussians");
  return Writer(path, source, options).write();
}

}  // namespace tg
