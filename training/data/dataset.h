// SPDX-License-Identifier: Apache-2.0
// Photographs with known cameras: NeRF-synthetic and instant-ngp / nerfstudio JSON, COLMAP sparse models.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/bundle/blocks.h"
#include "core/bundle/camera_file.h"
#include "core/bundle/ply.h"
#include "core/bundle/training_json.h"
#include "core/model/camera.h"
#include "core/system/names.h"
#include "training/data/photographs.h"

namespace tg {

enum class DatasetLayout { automatic, nerfSynthetic, transforms, colmap };
constexpr auto namesOf(DatasetLayout) { return enumNames("auto", "nerf-synthetic", "transforms", "colmap"); }

constexpr unsigned kMaxImageSide = kMaxCameraSide;  // [px] that a description may claim: models keep its cameras

struct Dataset {
  std::string name;  // of the folder
  DatasetLayout layout = DatasetLayout::automatic;
  std::vector<Camera> views;       // of the photographs: sorted by image name inside train and test; train first
  std::vector<std::string> files;  // of each: its path below the data set's folder, as the data set lists it
  std::vector<std::filesystem::path> sources;  // what is read for them: photographs and masks
  std::optional<SceneBlock> block;             // of a scene in blocks
  PointCloud points;                           // empty when the data set has none
  glm::vec3 background{0.0f};                  // what scores are taken against, and training without random_background
  bool random_background = false;              // transparency is kept: training composites over a new colour every time
  std::optional<Normalization> normalized;     // how it was moved and scaled as it was read
  bool validation = false;                     // the views called test are training views that were held out
  MaskMeaning masks = MaskMeaning::hidden;
  std::vector<std::string> notes;                // what a user should know: one line each, without the data set's path
  int missing_images = 0;                        // listed by the data set, not on disk: skipped
  std::shared_ptr<PhotographStore> photographs;  // one a view
  std::function<Photograph(std::size_t view, const glm::vec3& background)> decode;  // of files, over any background

  std::vector<std::size_t> indices(bool test) const;
  // The pixels of a view over `background`, or over a colour of the caller's choice: the same ones where the photograph
  // is opaque or random_background is false. They stay valid as long as the result lives. Not inside a parallelFor.
  std::shared_ptr<const ViewPixels> pixels(std::size_t view) const;
  std::shared_ptr<const ViewPixels> composited(std::size_t view, const glm::vec3& color) const;
  // As pixels() of the same files where they are loaded over `color`: decoded anew, unless it is `background`.
  std::shared_ptr<const ViewPixels> reloaded(std::size_t view, const glm::vec3& color) const;
  // A hint that the pixels of this view are wanted soon; up to PhotographStore::kReadAhead views ahead is of use.
  void prefetch(std::size_t view) const;
};

struct DatasetOptions {
  DatasetLayout layout = DatasetLayout::automatic;
  int downscale = 1;                    // integer box filter
  std::optional<glm::vec3> background;  // default: the data set's; white for NeRF-synthetic, black otherwise
  bool random_background = false;
  int test_every = 8;       // every n-th image by name is held out, where no split is given; 0: none
  bool validation = false;  // every 8th of the training views is the test split, and the other test views are not there
  MaskMeaning masks = MaskMeaning::hidden;
  // Folder of the photographs: COLMAP's, and JSON's where file_path begins with images/. With the default and a
  // downscale factor N, images_N is read instead where it holds the photographs at that size.
  std::string images = "images";
  std::optional<std::filesystem::path> points;        // point cloud PLY instead of the data set's own
  std::optional<bool> only_test;                      // keep the views of one side of the split only
  std::uint64_t image_memory = defaultImageMemory();  // decoded photographs beyond it are decoded when needed [bytes]
  // Where several processes share the photographs: of the training views those whose number leaves `part` over `parts`
  // are kept in memory here, and others are decoded whenever they are asked for. At the start part 0 decodes all, the
  // others their own alone: of other views they have no camera but its name.
  int part = 0;
  int parts = 1;
  // Cameras and points are moved and scaled (training/data/normalize.h): the model is of that world. Not for blocks.
  bool normalize = false;
  std::string normalize_by;   // what callers add for it, as notes on small and far scenes say; empty: they do not
  bool cameras_only = false;  // photographs are decoded when asked for, at the start only where they say the size
  // Told while photographs are decoded for the first time, from any thread, one call at a time.
  std::function<void(std::size_t done, std::size_t count)> decoded;
};

// A folder with block.json is some photographs of the data set that it names, with the same ones held out, and its own
// points3d.ply. Throws Error(cannotRead / badData / usage).
Dataset loadDataset(const std::filesystem::path& place, const DatasetOptions& options = {});
// Whether training could begin with this folder as it is: it has cameras.
bool hasCameras(const std::filesystem::path& folder);
// " (did you mean PATH?)" where a folder has none and one below it, or the one above it, does; else "".
std::string datasetNear(const std::filesystem::path& folder);
// What float cannot hold would train for hours to a model that cannot be written. `what` begins messages. Throw
// Error(badData).
void checkCamera(const std::string& what, const Camera& camera);
void checkPoints(const std::string& what, const PointCloud& points);
// What loadDataset() refuses of the options without a look at the data set. Throws Error.
void checkDatasetOptions(const DatasetOptions& options);

// 1.1 * the largest distance of a training camera from their mean, as 3DGS has it. [world units]
double cameraExtent(const Dataset& dataset);

// The unit of position learning rates, of MCMC's noise and of the densification thresholds: cameraExtent(), but at most
// `distances` (0: any number) times what the median point is away from the nearest training camera that sees it. For
// what is walked or flown through, cameras span many times that, and steps that belong to the span are pixels wide in
// every photograph. Points: every k-th of the data set's, as sightings() has them; without, cameraExtent().
// [world units]
double sceneExtent(const Dataset& dataset, double distances);

// The mask of a photograph NAME in a folder of masks: the first that exists of NAME.png (as COLMAP names them),
// NAME.mask.png, NAME with the extension png, and with _mask.png in its place; empty: none.
std::filesystem::path maskNamedFor(const std::filesystem::path& name);

// In order.
std::vector<Camera> trainingViews(const Dataset& dataset);

// Pixels of all training views together.
std::uint64_t trainingPixels(const Dataset& dataset);

// What the loaders of each layout return: cameras whose images are not decoded yet. Exposed for the tests.
struct DatasetIndex {
  struct Entry {
    Camera camera;  // size = 0: taken from the image, focal length from field_of_view
    Lens lens;
    std::filesystem::path image;
    std::string listed;                     // Dataset::files; filled by loadDataset()
    std::string below_images;               // the image's path below the folder `images`; empty: it is in another one
    std::filesystem::path mask;             // named by the data set; empty: found by its name, or none
    std::optional<double> field_of_view_x;  // [rad]
    std::optional<double> field_of_view_y;  // [rad]
    // [px] Where the camera has no size yet.
    std::optional<double> focal_x, focal_y, center_x, center_y;
  };
  std::vector<Entry> entries;
  glm::dvec3 origin{0.0};  // [world units] middleOf() where it is to be normalized: what points are from, cameras not
  PointCloud points;
  std::string points_file;  // where they are from; empty: the data set names none
  bool points_missing = false;
  bool has_split = false;          // Camera::test is set
  std::vector<std::string> notes;  // of Dataset::notes
  std::size_t outside_split = 0;   // frames that are not entries, as no list of the data set's names them
  std::optional<glm::vec3> background;
};
// Of transforms.json, three numbers from 0 to 1; ours alone (docs/training.md).
constexpr const char* kBackgroundKey = "background";
// nerfSynthetic: transforms_train.json and transforms_test.json. transforms: transforms.json, or those two without it.
DatasetIndex readTransforms(const std::filesystem::path& folder, DatasetLayout layout = DatasetLayout::transforms,
                            bool normalize = false);
// `camera` at a size [px]: what the entry does not say follows from its field of view, of which it has one at least
// where it has no focal length, and from the middle.
Camera intrinsicsOf(const DatasetIndex::Entry& entry, Camera camera, glm::ivec2 size);
// Whether a file of transforms has "fl_x", for all frames or for the first. Throws Error as readTransforms().
bool namesFocalLengths(const std::filesystem::path& transforms);
DatasetIndex readColmap(const std::filesystem::path& folder, bool normalize = false);
// The COLMAP model's folder below a data set: sparse/0, sparse, or the sparse/N with the most photographs.
// below_colmap: or so in the folder colmap beside images, as nerfstudio has it.
std::optional<std::filesystem::path> findColmapModel(const std::filesystem::path& folder, bool below_colmap = true);

}  // namespace tg
