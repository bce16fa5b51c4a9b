// SPDX-License-Identifier: Apache-2.0
// Data set flags, the device, notes.
#include "training/cli.h"

#include <array>
#include <cstdio>
#include <optional>
#include <vector>

#include "core/system/error.h"
#include "core/system/names.h"
#include "core/system/numbers.h"
#include "core/system/program.h"
#ifdef TG_HAVE_CUDA
#include "training/cuda/renderer.h"
#endif

namespace tg {

void addDatasetFlags(CLI::App& app, DatasetFlags& flags) {
  const std::string before = app.option_defaults()->get_group();
  app.option_defaults()->group("Data set");
  app.add_option("--layout", flags.layout, "How the data set is laid out")
      ->check(oneOf<DatasetLayout>())
      ->capture_default_str();
  app.add_option("--downscale", flags.downscale, "Shrink the photographs by an integer")->capture_default_str();
  app.add_option(
         "--background", flags.background,
         "white, black, r,g,b in [0,1], or random: transparent pixels over a new colour every time, scored over "
         "the default (white for nerf-synthetic, else black)")
      ->type_name("COLOUR");
  app.add_option("--test-every", flags.test_every, "Hold out every n-th image where no split is given (0: none)")
      ->capture_default_str();
  app.add_flag("--validation", flags.validation,
               "Hold out every 8th training view instead, for choosing settings: the test views are not looked at");
  app.add_option("--masks", flags.masks,
                 "What 0 in a mask means: the pixel does not count, or is background and counts")
      ->check(oneOf<MaskMeaning>())
      ->capture_default_str();
  app.add_option("--image-folder", flags.images,
                 "Folder of the photographs (with --downscale N, images_N where it fits)")
      ->type_name("FOLDER")
      ->capture_default_str();
  app.add_option("--image-memory", flags.image_memory,
                 "MiB for decoded photographs; more are decoded when needed (0: a quarter of the machine's memory)")
      ->check(within(0, 1 << 30))
      ->capture_default_str();
  app.add_option("--points", flags.points, "Initial points (.ply) instead of the data set's own")->type_name("FILE");
  app.add_flag("--normalize", flags.normalize,
               "Move and scale cameras and points: the model is of that world, and a line says how to bring it back");
  app.option_defaults()->group(before);
}

DatasetOptions datasetOptions(const DatasetFlags& flags) {
  DatasetOptions options;
  options.layout = parse<DatasetLayout>(flags.layout).value_or(DatasetLayout::automatic);
  options.downscale = flags.downscale;
  options.test_every = flags.test_every;
  options.normalize = flags.normalize;
  options.validation = flags.validation;
  options.masks = parse<MaskMeaning>(flags.masks).value_or(MaskMeaning::hidden);
  options.images = flags.images;
  if (!flags.points.empty()) options.points = flags.points;
  if (flags.image_memory > 0) options.image_memory = flags.image_memory << 20;
  options.random_background = flags.background == "random";
  if (!flags.background.empty() && !options.random_background) {
    const std::optional<std::array<float, 3>> color = parseColor(flags.background);
    if (!color) {
      throw Error(ErrorKind::usage,
                  "--background: not a colour (expected white, black, random or r,g,b in [0,1], found '" +
                      flags.background + "')");
    }
    options.background = glm::vec3((*color)[0], (*color)[1], (*color)[2]);
  }
  return options;
}

void addDeviceFlag(CLI::App& app, std::string& device, const std::string& help) {
  app.add_option("--device", device, help)->check(oneOf({"auto", "cpu", "cuda"}))->capture_default_str();
}

#ifdef TG_HAVE_CUDA
std::unique_ptr<DifferentiableRenderer> openCuda(const std::string& device, std::string& why_cpu) {
  if (device == "cpu") return nullptr;
  try {
    return makeCudaDifferentiableRenderer();
  } catch (const Error& error) {
    if (device == "cuda") throw;
    why_cpu = error.what();
    return nullptr;
  }
}
#else
std::unique_ptr<DifferentiableRenderer> openCuda(const std::string& device, std::string&) {
  if (device != "cuda") return nullptr;
  throw Error(ErrorKind::device, "CUDA", "this program was built without it (no nvcc when it was configured)");
}
#endif

void printNotes(const std::string& folder, const Dataset& dataset) {
  for (const std::string& note : dataset.notes) {
    std::fprintf(stderr, "%s: %s\n", printable(folder).c_str(), printable(note).c_str());
  }
}

void refuseExisting(const std::string& path, bool overwrite) {
  std::error_code ignored;
  if (!overwrite && std::filesystem::exists(path, ignored)) {
    throw Error(ErrorKind::cannotWrite, path, "exists already (add --overwrite to replace it)");
  }
}

}  // namespace tg
