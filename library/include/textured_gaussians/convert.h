// SPDX-License-Identifier: Apache-2.0
// A model's file to another format.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "textured_gaussians/camera.h"

namespace textured_gaussians {

// tgconvert's flags of these names, which messages say (docs/converter.md).
struct ConvertOptions {
  bool overwrite = false;  // a file that is there
  bool quantize = false;   // glb, gltf, html: integers for rotations, opacities and colours
  bool meshopt = false;    // glb, gltf, html: compressed by EXT_meshopt_compression
  bool measure = false;    // --psnr: render both models and compare
  // sog, glb, gltf, html: how many times as wide as usual the steps of all numbers are, 1/8 to 64.
  std::optional<float> steps = {};
  // Edits in this order, by name and value of the flags: {{"scale", "2"}, {"upright", ""}}.
  std::vector<std::pair<std::string, std::string>> edits = {};
  // sog, glb, gltf, html, instead of `steps` and of one another: the finest steps with which the file has at most this
  // size [bytes], 1 or more; the coarsest with which pictures of up to four views come so near to the edited source's
  // [dB], 1 to 100.
  std::optional<std::uint64_t> target_size = {};
  std::optional<double> target_psnr = {};
  std::optional<float> texture_step = {};    // sog, glb, gltf, html: between a texture's colours, 1/1024 to 1/2
  bool cameras = true;                       // false, --no-cameras: without cameras and named views
  std::vector<Camera> views = {};            // glb, gltf, html: named views in place of the source's
  bool base_only = false;                    // a glb, gltf, html, sog, lod-meta or tileset is read without its textures
  bool lean = false;                         // glb, gltf: without the numbers that only bring a .ply back bit by bit
  std::optional<std::string> atlas = {};     // glb, gltf, html, png: texels as png8 (without one), png16, exr or webp
  std::optional<int> spz_version = {};       // spz: 3 or 4
  std::optional<std::string> spz_axes = {};  // of an spz that is read, whatever it says: rub or rdf
  std::optional<std::string> viewer = {};    // --for: what viewers without textures show looks right in this one
  std::optional<std::string> viewer_aim = {};  // --for-aim: textures (without one) or base
  bool dry_run = false;                        // find out how large the file would be and write nothing
  // How many of how many steps of what takes long are done: "fit" to `viewer`, "target" for trials of a target, of
  // which a second search counts anew. Before the first and after each, on the caller's thread. What it throws ends the
  // conversion: no file is written, one that was there stays.
  std::function<void(const std::string& part, std::size_t done, std::size_t steps)> progress = {};
};

struct ConvertReport {
  std::string input_format;
  std::string output_format;
  std::uint64_t input_bytes = 0;
  std::uint64_t output_bytes = 0;
  std::size_t gaussians = 0;          // written
  std::optional<float> steps;         // that were asked for, or found for a target
  std::optional<double> psnr;         // [dB] of the file read back against what was to be written; where measured
  std::vector<std::string> warnings;  // what the format does not hold, a line each
};

// The output's format is its extension; what is written takes its name once it is complete, a relative one in the
// working folder as it is then. Throws Error: usage (also for options that do nothing for these formats, and for a
// target that no steps reach), cannotRead, badData, cannotWrite (also for a file that is there, without `overwrite`).
ConvertReport convert(const std::filesystem::path& input, const std::filesystem::path& output,
                      const ConvertOptions& options = {});

}  // namespace textured_gaussians
