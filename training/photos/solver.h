// SPDX-License-Identifier: Apache-2.0
// COLMAP, as a program or as Python's module, and what to tell it.
#pragma once
#include <atomic>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/system/names.h"

namespace tg {

enum class SolverKind { automatic, colmap, pycolmap };
constexpr auto namesOf(SolverKind) { return enumNames("auto", "colmap", "pycolmap"); }

enum class Mapper { incremental, global };
constexpr auto namesOf(Mapper) { return enumNames("incremental", "global"); }

// Lens models that photographs start with, by COLMAP's names.
enum class LensModel { simplePinhole, pinhole, simpleRadial, radial, opencv, opencvFisheye };
constexpr auto namesOf(LensModel) {
  return enumNames("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE");
}
// "f,cx,cy,0" and the like: a lens without distortion. [px]
std::string lensParameters(LensModel model, double focal, int width, int height);

struct Solver {
  SolverKind kind = SolverKind::colmap;
  std::string program;           // colmap, or the Python that has the module
  std::string version;           // "3.8"
  bool gpu = false;              // it was built with CUDA
  bool renamed_options = false;  // of 4.0: --FeatureExtraction.use_gpu, where --SiftExtraction.use_gpu was
  bool global_mapper = false;
};

// What is on the PATH: `automatic` takes colmap if it is there, but pycolmap 4 before an older one without CUDA. Throws
// Error(device) that says what to install.
Solver findSolver(SolverKind asked, const std::filesystem::path& log, const std::atomic<int>& stop);

struct SolverFiles {
  std::filesystem::path database;
  std::filesystem::path images;
};
// Command lines; threads: 0 for all. `list` names the photographs that one camera took, `pairs` what is matched, a line
// each. trials: beginnings of a model that the incremental mapper tries in a round; 0: as many as it usually does.
std::vector<std::string> findFeatures(const Solver& solver, const SolverFiles& files, const std::filesystem::path& list,
                                      LensModel lens, const std::string& parameters, int threads);
std::vector<std::string> matchPairs(const Solver& solver, const SolverFiles& files, const std::filesystem::path& pairs,
                                    int threads);
std::vector<std::string> solveCameras(const Solver& solver, const SolverFiles& files,
                                      const std::filesystem::path& models, Mapper mapper, std::size_t smallest_model,
                                      int trials, int threads);

// The number of photographs done that a line of COLMAP speaks of; 0: of none. `registered`: by the mapper.
std::size_t photographsDone(std::string_view line, bool registered);

}  // namespace tg
