// SPDX-License-Identifier: Apache-2.0
// Picks the layout, decodes the photographs in parallel and splits them into train and test.
#include "training/data/dataset.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <locale>
#include <mutex>
#include <set>
#include <sstream>

#include "core/file/file.h"
#include "core/image/picture_name.h"
#include "core/model/views.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/median.h"
#include "core/system/parallel.h"
#include "core/system/shortened.h"
#include "training/data/normalize.h"

namespace tg {
namespace fs = std::filesystem;

namespace {

constexpr int kValidationEvery = 8;  // of the training views
constexpr int kMaxDownscale = 64;
constexpr double kFarthest = 1e9;  // positions [world units] and principal points [px]: squares stay far inside float
constexpr double kShortestFocal = 1e-3;  // [px]
constexpr double kLongestFocal = 1e9;    // [px]

DatasetLayout detectLayout(const fs::path& folder) {
  // COLMAP first: folders that hold both describe one scene, and COLMAP's has points. But not what nerfstudio made its
  // transforms.json of.
  const bool transforms = isFile(folder / "transforms_train.json") || isFile(folder / "transforms.json");
  if (findColmapModel(folder, !transforms)) return DatasetLayout::colmap;
  if (isFile(folder / "transforms_train.json")) {
    // With calibrated cameras it is a scene of photographs, whose split stands in two files where there is no third.
    const bool photographs = namesFocalLengths(folder / "transforms_train.json");
    return photographs ? DatasetLayout::transforms : DatasetLayout::nerfSynthetic;
  }
  if (isFile(folder / "transforms.json")) return DatasetLayout::transforms;
  if (std::error_code reason; fs::directory_iterator(folder, reason), reason == std::errc::permission_denied) {
    throw Error(ErrorKind::cannotRead, folder.string(), "cannot read the folder: " + reason.message());
  }
  throw Error(ErrorKind::badData, folder.string(),
              "not a data set (expected transforms_train.json, transforms.json, or a COLMAP model in sparse/0 or "
              "sparse with cameras.bin / cameras.txt; found none of them)" +
                  datasetNear(folder));
}

std::string text(double value) {
  std::ostringstream stream;
  stream.imbue(std::locale::classic());
  stream << value;
  return stream.str();
}

Camera downscaled(Camera camera, int factor) {
  // The box filter cuts rows and columns that do not fill a box: the scale is exactly 1 / factor.
  camera.size /= factor;
  camera.focal /= factor;
  camera.center /= factor;
  return camera;
}

bool isFolder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

// Whether a picture is 1/factor of another, give or take the rounding of whoever reduced it.
bool isReduced(int small, int large, int factor) { return std::abs(std::int64_t{small} * factor - large) < factor; }

// Before those in the folder `images` are read in their place: lengths in pixels are of the photographs that the
// cameras name, and of their size where none stands beside them.
void knowSizes(const fs::path& images, DatasetIndex& index) {
  parallelFor(static_cast<std::int64_t>(index.entries.size()), 1, [&](std::int64_t i) {
    DatasetIndex::Entry& entry = index.entries[static_cast<std::size_t>(i)];
    const bool in_pixels = entry.focal_x || entry.focal_y || entry.center_x || entry.center_y;
    if (entry.camera.size.x > 0 || entry.below_images.empty() || !in_pixels) return;
    if (!isFile(images / entry.below_images)) return;  // skipped, as what is missing is
    if (!isFile(entry.image)) {
      throw Error(
          ErrorKind::badData, entry.image.string(),
          "is not there to tell the size that its camera's fl_x, cx or cy are of (expected w and h beside them)");
    }
    const Image image = readImage(entry.image);
    entry.camera = intrinsicsOf(entry, entry.camera, {image.width, image.height});
  });
}

// The data set's own reduced photographs spare the decoding of the large ones. Points the entries at `images_N` and
// returns true where it holds all of them at the size that the factor asks for.
bool useReducedFolder(const fs::path& folder, int factor, DatasetIndex& index, std::vector<std::string>& notes) {
  const std::string name = "images_" + std::to_string(factor);
  if (factor == 1 || !isFolder(folder / name)) return false;
  const auto reduced = [&](const DatasetIndex::Entry& entry) { return folder / name / entry.below_images; };
  const DatasetIndex::Entry* first = nullptr;
  std::size_t full_files = 0, reduced_files = 0;
  for (const DatasetIndex::Entry& entry : index.entries) {
    full_files += isFile(entry.image);
    const bool found = !entry.below_images.empty() && isFile(reduced(entry));
    reduced_files += found;
    if (found && !first) first = &entry;
  }
  if (!first || reduced_files < full_files) {
    notes.push_back(name + " lacks photographs (found " + std::to_string(reduced_files) + " of " +
                    std::to_string(full_files) + "): images is reduced instead");
    return false;
  }
  const Image small = readImage(reduced(*first));
  glm::ivec2 large = first->camera.size;
  if (large.x == 0 && isFile(first->image)) {
    const Image image = readImage(first->image);
    large = {image.width, image.height};
  }
  if (large.x > 0 && !(isReduced(small.width, large.x, factor) && isReduced(small.height, large.y, factor))) {
    notes.push_back(name + " is of another size (expected 1/" + std::to_string(factor) + " of " +
                    std::to_string(large.x) + " x " + std::to_string(large.y) + ", found " +
                    std::to_string(small.width) + " x " + std::to_string(small.height) +
                    "): images is reduced instead");
    return false;
  }
  knowSizes(folder / name, index);
  for (DatasetIndex::Entry& entry : index.entries) entry.image = reduced(entry);
  notes.push_back("photographs are read from " + name + ", which holds them at 1/" + std::to_string(factor));
  return true;
}

// A mask that goes with the photograph by its name: of images/a/b.jpg below masks/a; masks_N before masks where
// images_N is read.
fs::path findMask(const fs::path& folder, const std::vector<std::string>& mask_folders,
                  const DatasetIndex::Entry& entry) {
  const fs::path below =
      entry.below_images.empty() ? entry.image.lexically_relative(folder) : fs::path(entry.below_images);
  for (const std::string& masks : mask_folders) {
    if (fs::path mask = maskNamedFor(folder / masks / below); !mask.empty()) return mask;
  }
  return {};
}

void findMasks(const fs::path& folder, const std::string& images, MaskMeaning meaning, DatasetIndex& index,
               std::vector<std::string>& notes) {
  std::vector<std::string> mask_folders;
  for (const std::string& name :
       {images.starts_with("images_") ? "masks" + images.substr(6) : "", std::string("masks")}) {
    if (!name.empty() && isFolder(folder / name)) mask_folders.push_back(name);
  }
  std::size_t masked = 0;
  for (DatasetIndex::Entry& entry : index.entries) {
    if (entry.mask.empty()) entry.mask = findMask(folder, mask_folders, entry);
    masked += !entry.mask.empty();
  }
  if (masked > 0) {
    notes.push_back(std::to_string(masked) + " of " + std::to_string(index.entries.size()) +
                    " photographs have a mask: pixels where it is 0 are " +
                    (meaning == MaskMeaning::hidden ? "not trained and not scored" : "background"));
  } else if (!mask_folders.empty()) {
    notes.push_back(mask_folders.front() +
                    " holds no mask that goes with a photograph (expected NAME.EXTENSION.png, "
                    "NAME.EXTENSION.mask.png, NAME.png or NAME_mask.png)");
  }
}

// The camera of a photograph of width x height pixels, before it is downscaled.
Camera cameraOf(const DatasetIndex::Entry& entry, int width, int height) {
  Camera camera = entry.camera;
  if (camera.size.x == 0) {
    camera = intrinsicsOf(entry, camera, {width, height});
  } else if (camera.size != glm::ivec2(width, height)) {
    camera = resized(camera, width, height);
  }
  checkCamera(entry.image.string(), camera);
  return camera;
}

Undistortion undistortionOf(const DatasetIndex::Entry& entry, int width, int height) {
  return {entry.lens, cameraOf(entry, width, height), entry.image.string()};
}

PhotographSource sourceOf(const DatasetIndex::Entry& entry, int downscale) {
  PhotographSource source;
  source.image = entry.image;
  source.mask = entry.mask;
  source.downscale = downscale;
  if (!entry.lens.isPinhole()) source.undistortion = [entry](int w, int h) { return undistortionOf(entry, w, h); };
  return source;
}

// Photographs of which every pixel is hidden show nothing: a film with masks of something that comes late has them.
void leaveOutHidden(const fs::path& place, bool only_test, int downscale, DatasetIndex& index,
                    std::vector<std::string>& notes) {
  std::vector<std::uint8_t> hidden(index.entries.size(), 0);
  parallelFor(hidden.size(), 1, [&](std::size_t i) {
    const DatasetIndex::Entry& entry = index.entries[i];
    hidden[i] = !entry.mask.empty() && hidesAll(sourceOf(entry, downscale));
  });
  const auto first = std::ranges::find(hidden, 1);
  if (first == hidden.end()) return;
  const std::string name = index.entries[static_cast<std::size_t>(first - hidden.begin())].image.filename().string();
  std::vector<DatasetIndex::Entry> shown;
  std::size_t held_out = 0;
  for (std::size_t i = 0; i < hidden.size(); ++i) {
    held_out += hidden[i] != 0 && index.entries[i].camera.test;
    if (hidden[i] == 0) shown.push_back(std::move(index.entries[i]));
  }
  index.entries = std::move(shown);
  if (index.entries.empty() || (!only_test && index.entries.front().camera.test)) {
    throw Error(
        ErrorKind::badData, place.string(),
        std::string("masks hide every pixel of the ") + (only_test ? "test" : "training") + " photographs (0 hides)");
  }
  notes.push_back(std::to_string(hidden.size() - index.entries.size()) + " of " + std::to_string(hidden.size()) +
                  " photographs, " + std::to_string(held_out) +
                  " of them held out, are left out: their masks hide every pixel (the first: " + name + ")");
}

// Photographs that lie there and are not trained on, since COLMAP could not place them.
void noteWithoutCamera(const fs::path& images, const std::string& name, const DatasetIndex& index,
                       std::vector<std::string>& notes) {
  std::set<fs::path> placed, others;
  for (const DatasetIndex::Entry& entry : index.entries) placed.insert(fs::path(entry.below_images).lexically_normal());
  std::error_code reason;
  for (fs::recursive_directory_iterator file(images, reason), end; !reason && file != end; file.increment(reason)) {
    const fs::path below = file->path().lexically_relative(images);
    const bool shown = !file->path().filename().string().starts_with(".");
    if (isPictureName(file->path()) && shown && !placed.contains(below)) others.insert(below);
  }
  if (others.empty()) return;
  notes.push_back(std::to_string(others.size()) + " photographs in " + name +
                  " have no camera and are left out (the first: " + others.begin()->string() + ")");
}

// A photograph that is listed twice in one split counts once; one in both splits stays in both, as it was asked for.
// scored: by the views that the data set holds out.
void dropRepeated(const fs::path& folder, bool scored, DatasetIndex& index, std::vector<std::string>& notes) {
  std::set<fs::path> seen[2];  // of the training views, of those held out
  std::string first_repeated;
  const std::size_t listed = index.entries.size();
  std::erase_if(index.entries, [&](const DatasetIndex::Entry& entry) {
    const bool repeated = !seen[entry.camera.test ? 1 : 0].insert(entry.image.lexically_normal()).second;
    if (repeated && first_repeated.empty()) first_repeated = entry.image.lexically_proximate(folder).string();
    return repeated;
  });
  if (const std::size_t repeated = listed - index.entries.size(); repeated > 0) {
    notes.push_back(std::to_string(repeated) + " of " + std::to_string(listed) +
                    " listed images are listed before and count once (the first: " + first_repeated + ")");
  }
  const auto shared = std::ranges::count_if(seen[1], [&](const fs::path& image) { return seen[0].contains(image); });
  if (shared > 0 && scored) {
    notes.push_back(std::to_string(shared) + " of " + std::to_string(seen[1].size()) +
                    " images that are held out are trained on as well: scores say little");
  }
}

PointCloud choosePoints(const DatasetOptions& options, DatasetIndex& index, std::vector<std::string>& notes) {
  if (options.points) {
    PointCloud points = readPointCloudPly(*options.points, index.origin);
    if (points.position.empty()) {
      throw Error(ErrorKind::badData, options.points->string(), "holds no points (expected at least one)");
    }
    return points;
  }
  if (!index.points_file.empty() && index.points.position.empty()) {
    notes.push_back(shortened(index.points_file) +
                    (index.points_missing ? ", which transforms.json names, is missing" : " holds no points") +
                    ": training starts from random ones");
  }
  return std::move(index.points);
}

void noteLenses(const DatasetIndex& index, Dataset& dataset) {
  const auto bent = [](const DatasetIndex::Entry& entry) { return !entry.lens.isPinhole(); };
  const auto count = std::ranges::count_if(index.entries, bent);
  if (count == 0) return;
  const auto first = std::ranges::find_if(index.entries, bent);
  const Camera& camera = dataset.views[static_cast<std::size_t>(first - index.entries.begin())];
  dataset.notes.push_back(std::to_string(count) + " of " + std::to_string(index.entries.size()) +
                          " photographs are undistorted as they are read (the first: " + first->lens.model + ", to " +
                          std::to_string(camera.size.x) + " x " + std::to_string(camera.size.y) + ")");
}

// Whether a photograph and its camera have sides in the same proportion, but for a reduced one's rounding.
bool sameShape(const Camera& camera, int width, int height) {
  if (camera.size.x == 0) return true;
  const double proportion = static_cast<double>(camera.size.y) / camera.size.x;
  return std::abs(width * proportion - height) <= 1 + proportion;
}

// Decodes every photograph once: a broken file shows before hours of training, not after.
void loadPhotographs(const DatasetIndex& index, int downscale, const DatasetOptions& options, Dataset& dataset) {
  std::vector<PhotographSource> sources;
  for (const DatasetIndex::Entry& entry : index.entries) {
    PhotographSource& source = sources.emplace_back(sourceOf(entry, downscale));
    source.mask_meaning = options.masks;
    if (!dataset.random_background) source.background = dataset.background;
  }
  const std::int64_t count = static_cast<std::int64_t>(sources.size());
  dataset.views.resize(sources.size());
  for (const DatasetIndex::Entry& entry : index.entries) {
    dataset.files.push_back(entry.listed);
    dataset.sources.push_back(entry.image);
    if (!entry.mask.empty()) dataset.sources.push_back(entry.mask);
  }
  dataset.photographs = std::make_shared<PhotographStore>(
      sources.size(), options.image_memory, [sources](std::size_t view) { return decodePhotograph(sources[view]); });
  dataset.decode = [sources](std::size_t view, const glm::vec3& background) {
    PhotographSource source = sources[view];
    source.background = background;
    return decodePhotograph(source);
  };
  const auto isOwn = [&](std::size_t i) {
    return options.parts == 1 ||
           (!index.entries[i].camera.test && i % static_cast<std::size_t>(options.parts) == std::size_t(options.part));
  };
  std::size_t to_keep = 0;
  for (std::size_t i = 0; i < sources.size(); ++i) to_keep += isOwn(i);
  std::mutex counting;
  std::size_t decoded = 0;
  std::vector<std::string> stretched(sources.size());
  parallelFor(count, 1, [&](std::size_t i) {
    const DatasetIndex::Entry& entry = index.entries[i];
    const bool own = isOwn(i);
    if (!own && options.part > 0) {
      dataset.views[i].name = entry.camera.name;
      dataset.views[i].test = entry.camera.test;
      return;
    }
    const bool decodes = !options.cameras_only || entry.camera.size.x == 0;
    Photograph photograph;
    if (decodes) {
      photograph = decodePhotograph(sources[i]);
    } else {
      photograph.file_width = entry.camera.size.x;
      photograph.file_height = entry.camera.size.y;
    }
    dataset.views[i] = entry.lens.isPinhole()
                           ? cameraOf(entry, photograph.file_width, photograph.file_height)
                           : undistortionOf(entry, photograph.file_width, photograph.file_height).pinhole;
    if (downscale > 1) dataset.views[i] = downscaled(dataset.views[i], downscale);
    const Camera& camera = entry.camera;
    if (!sameShape(camera, photograph.file_width, photograph.file_height)) {
      stretched[i] = sources[i].image.filename().string() + ": expected the shape of " + std::to_string(camera.size.x) +
                     " x " + std::to_string(camera.size.y) + ", found " + std::to_string(photograph.file_width) +
                     " x " + std::to_string(photograph.file_height);
    }
    if (decodes && own) dataset.photographs->offer(i, std::move(photograph));
    const std::lock_guard lock(counting);
    if (options.decoded) options.decoded(++decoded, sources.size());
  });
  std::erase(stretched, "");
  if (!stretched.empty()) {
    dataset.notes.push_back(std::to_string(stretched.size()) + " of " + std::to_string(sources.size()) +
                            " photographs do not have the shape of their camera's picture and are taken as stretched; "
                            "were they turned or cropped since? (" +
                            stretched.front() + ")");
  }
  dataset.photographs->finishOffers();
  noteLenses(index, dataset);
  const std::size_t kept = dataset.photographs->keptViews();
  if (!options.cameras_only && kept < to_keep) {
    dataset.notes.push_back("the decoded photographs exceed " + std::to_string(options.image_memory >> 20) +
                            " MiB: " + std::to_string(to_keep - kept) + " of " + std::to_string(to_keep) +
                            " are decoded whenever they are needed");
  }
}

void requireListed(const fs::path& folder, const fs::path& whole, const BlockFile& block, const DatasetIndex& index) {
  std::set<std::string> missing(block.views.begin(), block.views.end());
  for (const DatasetIndex::Entry& entry : index.entries) missing.erase(entry.listed);
  if (missing.empty()) return;
  throw Error(ErrorKind::badData, (folder / kBlockName).string(),
              "names " + std::to_string(missing.size()) + " photographs that " + whole.string() +
                  " lacks (the first: " + shortened(*missing.begin()) + ")");
}

}  // namespace

std::vector<std::size_t> Dataset::indices(bool test) const {
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (views[i].test == test) result.push_back(i);
  }
  return result;
}

std::shared_ptr<const ViewPixels> Dataset::pixels(std::size_t view) const { return composited(view, background); }

std::shared_ptr<const ViewPixels> Dataset::composited(std::size_t view, const glm::vec3& color) const {
  TG_ASSERT(view < views.size() && photographs, "the data set has this view");
  TG_ASSERT(!insideParallelFor(), "pixels are not fetched inside a parallelFor");
  return compositeOver(photographs->get(view), color);
}

std::shared_ptr<const ViewPixels> Dataset::reloaded(std::size_t view, const glm::vec3& color) const {
  if (color == background) return pixels(view);
  TG_ASSERT(view < views.size() && decode, "the data set has this view, of a file");
  return compositeOver(std::make_shared<const Photograph>(decode(view, color)), color);
}

void Dataset::prefetch(std::size_t view) const {
  TG_ASSERT(view < views.size() && photographs, "the data set has this view");
  photographs->prefetch(view);
}

bool hasCameras(const fs::path& folder) {
  return findColmapModel(folder) || isFile(folder / "transforms_train.json") || isFile(folder / "transforms.json");
}

std::string datasetNear(const fs::path& folder) {
  const auto named = [](const fs::path& found) { return " (did you mean " + printable(found.string()) + "?)"; };
  constexpr int kMostEntries = 1000, kDeepest = 1;
  std::error_code reason;
  std::vector<fs::path> found;
  int entries = 0;
  for (fs::recursive_directory_iterator entry(folder, fs::directory_options::skip_permission_denied, reason), end;
       !reason && entry != end && ++entries <= kMostEntries; entry.increment(reason)) {
    std::error_code ignored;
    if (!entry->is_directory(ignored)) continue;
    if (hasCameras(entry->path())) found.push_back(entry->path());
    if (entry.depth() == kDeepest) entry.disable_recursion_pending();
  }
  if (!found.empty()) return named(*std::ranges::min_element(found));
  const fs::path above = (folder / "..").lexically_normal();
  return hasCameras(above) ? named(above) : "";
}

void checkCamera(const std::string& what, const Camera& camera) {
  for (const double focal : {camera.focal.x, camera.focal.y}) {
    if (!(focal >= kShortestFocal && focal <= kLongestFocal)) {
      throw Error(ErrorKind::badData, what,
                  "focal length out of range (expected 0.001 to 1e9 pixels, found " + text(focal) + ")");
    }
  }
  const glm::dvec3 position = camera.position();
  for (const double value : {camera.center.x, camera.center.y, position.x, position.y, position.z}) {
    if (!(std::abs(value) <= kFarthest)) {
      throw Error(ErrorKind::badData, what,
                  "camera position or principal point out of range (expected -1e9 to 1e9, found " + text(value) + ")");
    }
  }
}

void checkPoints(const std::string& what, const PointCloud& points) {
  for (std::size_t i = 0; i < points.position.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      if (!(std::abs(points.position[i][axis]) <= kFarthest)) {
        throw Error(ErrorKind::badData, what,
                    "point " + std::to_string(i) + " is out of range (expected -1e9 to 1e9, found " +
                        text(points.position[i][axis]) + ")");
      }
    }
  }
}

void checkDatasetOptions(const DatasetOptions& options) {
  if (options.downscale < 1 || options.downscale > kMaxDownscale) {
    throw Error(
        ErrorKind::usage, "--downscale",
        "out of range" + expectedFound("1 to " + std::to_string(kMaxDownscale), std::to_string(options.downscale)));
  }
  if (options.test_every < 0 || options.test_every == 1) {
    throw Error(ErrorKind::usage, "--test-every",
                "out of range" + expectedFound("0, for none, or at least 2", std::to_string(options.test_every)));
  }
  if (options.points && !isFile(*options.points)) {
    throw Error(ErrorKind::cannotRead, options.points->string(), "no such file");
  }
}

Dataset loadDataset(const fs::path& place, const DatasetOptions& options) {
  std::error_code code;
  const bool exists = fs::exists(place, code);
  const fs::path whole_place = code ? place : fs::absolute(place, code);  // none where the working folder is gone
  if (code) throw Error(ErrorKind::cannotRead, place.string(), "cannot be read: " + code.message());
  if (!exists) throw Error(ErrorKind::cannotRead, place.string(), "no such folder");
  if (!fs::is_directory(place, code)) {
    throw Error(ErrorKind::cannotRead, place.string(), "not a folder (expected a data set)");
  }
  checkDatasetOptions(options);

  Dataset dataset;
  const std::optional<BlockFile> block = readBlock(place);
  const fs::path folder = block ? wholeDataset(place, *block) : place;
  const fs::path canonical = fs::weakly_canonical(whole_place, code);
  dataset.name = (code ? whole_place : canonical).filename().string();
  dataset.layout = options.layout;
  if (block && dataset.layout == DatasetLayout::automatic) {
    const std::optional<DatasetLayout> layout = parse<DatasetLayout>(block->layout);
    if (!layout) throw Error(ErrorKind::badData, (place / kBlockName).string(), "\"layout\" is none");
    dataset.layout = *layout;
  }
  if (block && options.normalize) {
    throw Error(ErrorKind::usage, place.string(), "is a block: a whole scene alone can be normalized");
  }
  if (block) dataset.block = block->block;
  if (dataset.layout == DatasetLayout::automatic) dataset.layout = detectLayout(folder);
  DatasetIndex index = dataset.layout == DatasetLayout::colmap
                           ? readColmap(folder, options.normalize)
                           : readTransforms(folder, dataset.layout, options.normalize);
  const fs::path whole = fs::absolute(folder).lexically_normal();
  for (DatasetIndex::Entry& entry : index.entries) {
    entry.listed = fs::absolute(entry.image).lexically_normal().lexically_relative(whole).string();
  }
  dataset.notes = index.notes;
  const glm::vec3 usual(dataset.layout == DatasetLayout::nerfSynthetic ? 1.0f : 0.0f);
  dataset.background = options.background.value_or(index.background.value_or(usual));
  dataset.random_background = options.random_background;
  dataset.validation = options.validation;
  dataset.masks = options.masks;
  if (options.normalize) dataset.normalized = normalize(index, dataset.notes);
  if (block && !options.points) {
    dataset.points = readPointCloudPly(place / "points3d.ply");
  } else {
    dataset.points = choosePoints(options, index, dataset.notes);
  }
  if (dataset.normalized) {
    for (glm::vec3& point : dataset.points.position) point = glm::vec3(dataset.normalized->scale * glm::dvec3(point));
  }
  checkPoints(options.points.value_or(place).string(), dataset.points);

  std::string images = options.images;
  int downscale = options.downscale;
  if (images != "images") {
    knowSizes(folder / images, index);
    bool follows = false;
    for (DatasetIndex::Entry& entry : index.entries) {
      if (entry.below_images.empty()) continue;
      entry.image = folder / images / entry.below_images;
      follows = true;
    }
    if (!follows) {
      throw Error(ErrorKind::usage, folder.string(),
                  "lists no images in a folder \"images\", whose place --image-folder would take");
    }
  } else if (useReducedFolder(folder, downscale, index, dataset.notes)) {
    images += "_" + std::to_string(downscale);
    downscale = 1;
  }
  if (index.outside_split > 0) {
    dataset.notes.push_back(std::to_string(index.outside_split) + " of " +
                            std::to_string(index.entries.size() + index.outside_split) +
                            " frames are left out: neither train_filenames nor the list that is held out names them");
  }
  if (dataset.layout == DatasetLayout::colmap) noteWithoutCamera(folder / images, images, index, dataset.notes);
  const std::size_t listed = index.entries.size();
  const auto missing = std::find_if(index.entries.begin(), index.entries.end(),
                                    [](const DatasetIndex::Entry& entry) { return !isFile(entry.image); });
  const std::string first_missing =
      missing == index.entries.end() ? "" : missing->image.lexically_proximate(folder).string();
  std::erase_if(index.entries, [](const DatasetIndex::Entry& entry) { return !isFile(entry.image); });
  dataset.missing_images = static_cast<int>(listed - index.entries.size());
  if (dataset.missing_images > 0) {
    dataset.notes.push_back(std::to_string(dataset.missing_images) + " of " + std::to_string(listed) +
                            " listed images are missing and were skipped (the first: " + shortened(first_missing) +
                            ")");
  }
  if (index.entries.empty()) {
    std::error_code reason;
    if (listed > 0 && !fs::exists(folder / first_missing, reason) && reason == std::errc::permission_denied) {
      throw Error(ErrorKind::cannotRead, (folder / first_missing).string(), "cannot open: " + reason.message());
    }
    throw Error(ErrorKind::badData, folder.string(),
                listed == 0 ? "the data set lists no images"
                            : "none of the " + std::to_string(listed) + " listed images exists (expected " +
                                  shortened(first_missing) + " and others; --image-folder names another folder)");
  }

  dropRepeated(folder, !options.validation, index, dataset.notes);

  if (block) requireListed(place, folder, *block, index);
  std::stable_sort(index.entries.begin(), index.entries.end(),
                   [](const auto& a, const auto& b) { return a.camera.name < b.camera.name; });
  const auto holdOut = [&](int every) {
    for (std::size_t i = 0; i < index.entries.size(); i += static_cast<std::size_t>(every)) {
      index.entries[i].camera.test = index.entries.size() > 1;  // a single image is for training
    }
  };
  if (!index.has_split && options.test_every > 0) holdOut(options.test_every);
  const bool holds_out =
      std::ranges::any_of(index.entries, [](const DatasetIndex::Entry& entry) { return entry.camera.test; });
  if (index.has_split && !holds_out && !options.validation && options.test_every > 0) {
    dataset.notes.emplace_back("no view is held out, as the data set says");
  }
  if (options.validation) {
    std::erase_if(index.entries, [](const DatasetIndex::Entry& entry) { return entry.camera.test; });
    holdOut(kValidationEvery);
  }
  std::stable_partition(index.entries.begin(), index.entries.end(),
                        [](const DatasetIndex::Entry& entry) { return !entry.camera.test; });
  if (block) {
    const std::set<std::string> chosen(block->views.begin(), block->views.end());
    std::erase_if(index.entries, [&](const DatasetIndex::Entry& entry) { return !chosen.contains(entry.listed); });
  }
  const bool trains = !index.entries.empty() && !index.entries.front().camera.test;
  const bool test_alone = options.only_test.value_or(false) && index.has_split && !index.entries.empty();
  if (!trains && !test_alone) {
    throw Error(ErrorKind::badData, place.string(), "no image of the training split exists");
  }

  if (options.only_test) {
    std::erase_if(index.entries, [&](const DatasetIndex::Entry& e) { return e.camera.test != *options.only_test; });
  }
  findMasks(folder, images, options.masks, index, dataset.notes);
  // After views were held out: which these are is the same for every size and meaning of masks.
  if (options.masks == MaskMeaning::hidden) {
    leaveOutHidden(place, options.only_test.value_or(false), downscale, index, dataset.notes);
  }
  loadPhotographs(index, downscale, options, dataset);
  if (options.part == 0)
    std::ranges::copy(notesOnPlace(dataset, options.normalize_by), std::back_inserter(dataset.notes));
  return dataset;
}

double cameraExtent(const Dataset& dataset) { return spanOf(trainingViews(dataset)).value_or(1.0); }

double sceneExtent(const Dataset& dataset, double distances) {
  const double extent = cameraExtent(dataset);
  if (distances == 0) return extent;
  std::vector<double> nearest;
  for (const Sighting& sighting : sightings(dataset.points.position, trainingViews(dataset))) {
    if (sighting.views > 0) nearest.push_back(sighting.nearest);
  }
  if (nearest.empty()) return extent;
  const double middle = medianOf(std::move(nearest));
  constexpr double kOnePlace = 1e-7;  // of their distance to what they see: as near are cameras at one place
  return std::min(extent > kOnePlace * middle ? extent : 1.0, distances * middle);
}

fs::path maskNamedFor(const fs::path& name) {
  const std::string stem = fs::path(name).replace_extension().string();
  for (const fs::path& candidate : {fs::path(name.string() + ".png"), fs::path(name.string() + ".mask.png"),
                                    fs::path(stem + ".png"), fs::path(stem + "_mask.png")}) {
    if (isFile(candidate)) return candidate;
  }
  return {};
}

std::vector<Camera> trainingViews(const Dataset& dataset) {
  std::vector<Camera> views;
  for (const std::size_t i : dataset.indices(false)) views.push_back(dataset.views[i]);
  return views;
}

std::uint64_t trainingPixels(const Dataset& dataset) {
  std::uint64_t pixels = 0;
  for (const std::size_t view : dataset.indices(false)) {
    const glm::ivec2 size = dataset.views[view].size;
    pixels += static_cast<std::uint64_t>(size.x) * static_cast<std::uint64_t>(size.y);
  }
  return pixels;
}

}  // namespace tg
