// SPDX-License-Identifier: Apache-2.0
// One file to another: read, write, read back, compare.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "converter/edit/adapt.h"
#include "converter/edit/edit.h"
#include "converter/edit/progress.h"
#include "converter/edit/quality.h"
#include "converter/edit/target.h"
#include "converter/registry/file_format.h"

namespace tg {

// Whether source and result are rendered for the summary.
enum class Measure {
  automatic,  // where textures or rounding change pictures, and the model is not too large for it
  always,
  never
};

struct ConvertOptions {
  bool overwrite = false;
  bool base_only = false;  // see ReadOptions
  Measure measure = Measure::automatic;
  bool cameras = true;                     // whether what is written has those of the source
  bool lean = false;                       // glb: see WriteOptions
  bool dry_run = false;                    // encode and count, write nothing; implies Measure::never
  AtlasFormat atlas = AtlasFormat::png8;   // glb, gltf, png
  bool quantize = false;                   // glb, gltf: see WriteOptions
  bool meshopt = false;                    // likewise
  std::optional<float> steps = {};         // sog, glb, gltf, html: see WriteOptions
  std::optional<float> texture_step = {};  // likewise
  std::optional<int> spz_version = {};     // spz: see WriteOptions; without one the newest that `viewer` opens
  std::optional<SpzAxes> spz_axes = {};    // of an spz that is read: see ReadOptions
  std::vector<Camera> views = {};          // glb, gltf, html: in place of the source's; moved as the model is
  Target target = {};                      // sog, glb, gltf, html: instead of `steps`
  std::vector<Edit> edits = {};            // in this order, before anything is written
  std::optional<SplatViewer> viewer = {};  // not tgz, html, png: the base is made for it, after the edits
  FitAim aim = FitAim::textures;           // of `viewer`
  ConvertListener listener = {};           // of `viewer` and `target`
};

struct ConvertReport : Written {
  bool dry_run = false;
  std::string input_format;
  std::string output_format;
  std::optional<glm::vec3> input_axes;  // as Bundle::axes
  std::uint64_t input_bytes = 0;
  std::size_t gaussians = 0;
  int sh_degree = 0;
  std::optional<float> steps;  // that were asked for, or found for a target
  std::size_t cameras = 0;
  std::vector<EditReport> edits;
  std::optional<AdaptReport> adapted;
  // Of the file read back from the model, or from what stands in for textures where it holds none.
  std::optional<Deviation> deviation;
  std::size_t views = 0;                // rendered for the two figures below
  std::optional<double> textured_psnr;  // [dB] the file read back against the edited model; infinity when equal
  std::optional<double> base_psnr;      // [dB] what a reader without textures shows; only for textured sources
};

// Throws Error(usage) where options.viewer cannot open what would be written.
void requireOpened(const Format& format, const ConvertOptions& options);

// The output's format is its extension (converter/registry/file_format.h).
// Throws Error(usage / cannotRead / badData / cannotWrite), usage also for a target that no steps reach, for what
// requireOpened refuses and for a .sog with textures that is to be made for a viewer; nothing is written then. A binary
// PLY becomes a .glb or .gltf block by block where nothing is edited, rendered or packed; other ways hold the model in
// memory once.
ConvertReport convert(const std::filesystem::path& input, const std::filesystem::path& output,
                      const ConvertOptions& options = {});

// The report and a loaded model's facts, for people and for programs.
std::string describe(const ConvertReport& report);
std::string describeJson(const ConvertReport& report);
// `statistics`: with the distribution of every number.
std::string describe(const Bundle& loaded, bool statistics = false);
std::string describeJson(const Bundle& loaded, bool statistics = false);

}  // namespace tg
