// SPDX-License-Identifier: Apache-2.0
// Arguments of colmap, and a script for pycolmap that takes the same.
#include "training/photos/solver.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "core/system/error.h"
#include "core/system/numbers.h"
#include "training/photos/child.h"

namespace tg {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

constexpr int kNewMajor = 4;  // a quarter of the processor time of 3.8 for the same cameras

constexpr const char* kInstall =
    "no COLMAP found (expected colmap on the PATH, as `apt install colmap` puts it there, or a python3 with pycolmap "
    "4, as "
    "`pip install pycolmap` does)";

// Arguments: what to do, then that function's own. An empty path entry is the current folder, which may hold anything.
constexpr const char* kScript = R"(
import sys
sys.path = [folder for folder in sys.path if folder]
import pycolmap
task, arguments = sys.argv[1], sys.argv[2:]
if task == "version":
    print("pycolmap", pycolmap.__version__, "global" if hasattr(pycolmap, "global_mapping") else "")
elif task == "features":
    database, images, names, model, parameters, threads = arguments
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model, reader.camera_params = model, parameters
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads = int(threads)
    with open(names, "rb") as file:  # names may hold Unicode's spaces and ends of lines
        image_names = file.read().decode().split("\n")[:-1]
    pycolmap.extract_features(database, images, image_names=image_names, camera_mode=pycolmap.CameraMode.SINGLE,
                              reader_options=reader, extraction_options=options)
elif task == "matches":
    database, pairs, threads = arguments
    options = pycolmap.FeatureMatchingOptions()
    options.num_threads = int(threads)
    pairing = pycolmap.ImportedPairingOptions()
    pairing.match_list_path = pairs
    pycolmap.match_image_pairs(database, matching_options=options, pairing_options=pairing)
else:
    database, images, models, smallest, trials, threads = arguments
    options = pycolmap.GlobalPipelineOptions() if task == "global" else pycolmap.IncrementalPipelineOptions()
    options.num_threads, options.min_model_size = int(threads), int(smallest)
    if int(trials) > 0:
        options.init_num_trials = int(trials)
    solve = pycolmap.global_mapping if task == "global" else pycolmap.incremental_mapping
    solve(database, images, models, options)
)";

int majorOf(const Solver& solver) {
  int major = 0;
  std::from_chars(solver.version.data(), solver.version.data() + solver.version.size(), major);
  return major;
}

std::string threadsWord(int threads) { return std::to_string(threads > 0 ? threads : -1); }

Words script(const Solver& solver, std::initializer_list<std::string> words) {
  Words all = {solver.program, "-c", kScript};
  all.insert(all.end(), words);
  return all;
}

std::optional<Solver> findColmap(const fs::path& log, const std::atomic<int>& stop) {
  const std::optional<fs::path> program = findProgram("colmap");
  if (!program) return std::nullopt;
  Solver solver;
  solver.program = program->string();
  bool commands = false;
  const auto read = [&](std::string_view line) {
    // "COLMAP 3.8 -- Structure-from-Motion and Multi-View Stereo", "(Commit X on Y without CUDA)"
    if (line.starts_with("COLMAP ") && solver.version.empty()) {
      solver.version = line.substr(7, line.find(' ', 7) - 7);
      std::erase(solver.version, ',');
    }
    if (line.find("with CUDA") != line.npos) solver.gpu = true;
    if (line.find("global_mapper") != line.npos) solver.global_mapper = true;
    if (line.find("matches_importer") != line.npos) commands = true;
    if (line.find("FeatureExtraction.use_gpu") != line.npos) solver.renamed_options = true;
  };
  const ChildEnd end = runChild({{solver.program, "help"}, log, read, {}}, stop);
  runChild({{solver.program, "feature_extractor", "-h"}, log, read, {}}, stop);
  if (!commands) {
    throw Error(ErrorKind::device, solver.program,
                "is no COLMAP that works (expected `colmap help` to list matches_importer, found exit code " +
                    std::to_string(end.code) + ": " + end.last + ")");
  }
  return solver;
}

std::optional<Solver> findPycolmap(const fs::path& log, const std::atomic<int>& stop) {
  const std::optional<fs::path> program = findProgram("python3");
  if (!program) return std::nullopt;
  Solver solver;
  solver.kind = SolverKind::pycolmap;
  solver.program = program->string();
  const auto read = [&](std::string_view line) {
    if (!line.starts_with("pycolmap ")) return;
    solver.version = line.substr(9, line.find(' ', 9) - 9);
    solver.global_mapper = line.find("global") != line.npos;
  };
  if (runChild({script(solver, {"version"}), log, read, {}}, stop).code != 0) return std::nullopt;
  return solver;
}

}  // namespace

std::string lensParameters(LensModel model, double focal, int width, int height) {
  const std::string f = numberText(focal), center = numberText(width / 2.0) + "," + numberText(height / 2.0);
  switch (model) {
    case LensModel::simplePinhole:
      return f + "," + center;
    case LensModel::pinhole:
      return f + "," + f + "," + center;
    case LensModel::simpleRadial:
      return f + "," + center + ",0";
    case LensModel::radial:
      return f + "," + center + ",0,0";
    case LensModel::opencv:
    case LensModel::opencvFisheye:
      return f + "," + f + "," + center + ",0,0,0,0";
  }
  return {};
}

Solver findSolver(SolverKind asked, const fs::path& log, const std::atomic<int>& stop) {
  std::optional<Solver> colmap;
  if (asked != SolverKind::pycolmap) colmap = findColmap(log, stop);
  if (colmap && (asked == SolverKind::colmap || colmap->gpu || majorOf(*colmap) >= kNewMajor)) return *colmap;
  if (asked != SolverKind::colmap) {
    const std::optional<Solver> module = findPycolmap(log, stop);
    if (module && majorOf(*module) >= kNewMajor) return *module;
    if (module && !colmap) {
      throw Error(ErrorKind::device, "pycolmap",
                  "is too old" + expectedFound("version 4", module->version) +
                      ": `pip install -U pycolmap`, or `apt install colmap`");
    }
  }
  if (!colmap) throw Error(ErrorKind::device, kInstall);
  return *colmap;
}

Words findFeatures(const Solver& solver, const SolverFiles& files, const fs::path& list, LensModel lens,
                   const std::string& parameters, int threads) {
  if (solver.kind == SolverKind::pycolmap) {
    return script(solver, {"features", files.database.string(), files.images.string(), list.string(),
                           std::string(name(lens)), parameters, threadsWord(threads)});
  }
  const std::string extraction = solver.renamed_options ? "--FeatureExtraction." : "--SiftExtraction.";
  Words words = {solver.program,
                 "feature_extractor",
                 "--database_path",
                 files.database.string(),
                 "--image_path",
                 files.images.string(),
                 "--image_list_path",
                 list.string(),
                 "--ImageReader.single_camera",
                 "1",
                 "--ImageReader.camera_model",
                 std::string(name(lens)),
                 extraction + "use_gpu",
                 solver.gpu ? "1" : "0",
                 extraction + "num_threads",
                 threadsWord(threads)};
  if (!parameters.empty()) words.insert(words.end(), {"--ImageReader.camera_params", parameters});
  return words;
}

Words matchPairs(const Solver& solver, const SolverFiles& files, const fs::path& pairs, int threads) {
  if (solver.kind == SolverKind::pycolmap) {
    return script(solver, {"matches", files.database.string(), pairs.string(), threadsWord(threads)});
  }
  const std::string matching = solver.renamed_options ? "--FeatureMatching." : "--SiftMatching.";
  return {solver.program,       "matches_importer",     "--database_path",        files.database.string(),
          "--match_list_path",  pairs.string(),         "--match_type",           "pairs",
          matching + "use_gpu", solver.gpu ? "1" : "0", matching + "num_threads", threadsWord(threads)};
}

Words solveCameras(const Solver& solver, const SolverFiles& files, const fs::path& models, Mapper mapper,
                   std::size_t smallest_model, int trials, int threads) {
  const std::string smallest = std::to_string(smallest_model);
  if (solver.kind == SolverKind::pycolmap) {
    return script(solver, {std::string(name(mapper)), files.database.string(), files.images.string(), models.string(),
                           smallest, std::to_string(trials), threadsWord(threads)});
  }
  const bool global = mapper == Mapper::global;
  Words words = {solver.program,    global ? "global_mapper" : "mapper",
                 "--database_path", files.database.string(),
                 "--image_path",    files.images.string(),
                 "--output_path",   models.string()};
  const std::string options = global ? "--GlobalMapper." : "--Mapper.";
  words.insert(words.end(), {options + "num_threads", threadsWord(threads)});
  if (!global) words.insert(words.end(), {options + "min_model_size", smallest});
  if (!global && trials > 0) words.insert(words.end(), {options + "init_num_trials", std::to_string(trials)});
  return words;
}

std::size_t photographsDone(std::string_view line, bool registered) {
  // "Processed file [27/30]"; "Registering image #12 (13)", of 4.0 "Registering image #12 (num_reg_frames=13)"
  const std::string_view begin = registered ? "Registering image #" : "Processed file [";
  std::size_t at = line.find(begin);
  if (at == line.npos) return 0;
  at = line.find(registered ? '(' : '[', at) + 1;
  if (at == 0) return 0;
  if (const std::size_t equals = line.find('=', at); registered && equals != line.npos) at = equals + 1;
  std::size_t count = 0;
  std::from_chars(line.data() + at, line.data() + line.size(), count);
  return count;
}

}  // namespace tg
