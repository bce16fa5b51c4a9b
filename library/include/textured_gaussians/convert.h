// SPDX-License-Identifier: Apache-2.0
// A model's file to another format.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace textured_gaussians {

struct ConvertOptions {
  bool overwrite = false;  // a file that is there
  bool quantize = false;   // glb, gltf, html: integers for rotations, opacities and colours
  bool meshopt = false;    // glb, gltf, html: compressed by EXT_meshopt_compression
  bool measure = false;    // render both models and compare
  // sog, glb, gltf, html: how many times as wide as usual the steps of all numbers are, 1/8 to 64.
  std::optional<float> steps = {};
  // Edits in this order, by name and value of tgconvert's flags (docs/converter.md): {{"scale", "2"}, {"upright", ""}}.
  std::vector<std::pair<std::string, std::string>> edits = {};
};

struct ConvertReport {
  std::string input_format;
  std::string output_format;
  std::uint64_t input_bytes = 0;
  std::uint64_t output_bytes = 0;
  std::size_t gaussians = 0;          // written
  std::optional<double> psnr;         // [dB] of the file read back against what was to be written; where measured
  std::vector<std::string> warnings;  // what the format does not hold, a line each
};

// The output's format is its extension; what is written takes its name once it is complete. Throws Error: usage
// (also for options that the output's format does nothing with), cannotRead, badData, cannotWrite (also for a file that
// is there, without `overwrite`).
ConvertReport convert(const std::filesystem::path& input, const std::filesystem::path& output,
                      const ConvertOptions& options = {});

}  // namespace textured_gaussians
