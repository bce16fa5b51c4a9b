// SPDX-License-Identifier: Apache-2.0
// A file of a size, or of a likeness to its model.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>

#include "converter/edit/progress.h"
#include "converter/registry/file_format.h"

namespace tg {

// At most one of them.
struct Target {
  std::uint64_t bytes = 0;  // [bytes] at most; 0: any
  double psnr = 0;          // [dB] at least, of pictures against the source's, textured where it is; 0: any
  bool given() const { return bytes > 0 || psnr > 0; }
};

// writeModel() to `file` in a ScratchFolder on the way to `name`, or to that itself. Errors name `name`, but where the
// trial cannot be written the folder for temporary files.
void writeTrial(const Format& format, const std::filesystem::path& file, const std::filesystem::path& name,
                const Bundle& source, const WriteOptions& options, Written& written);

// The finest WriteOptions::steps with which a file is no larger, or the coarsest with which its pictures are as near:
// found to 2.5 %, or for a size until 1 % of it is free at most or to 0.3 %, by writing to `name` in a temporary folder
// and, for pictures, by drawing `views`. What is returned has been tried. Throws Error(usage) for what no steps reach,
// and what the format's writer throws. The format has steps.
float stepsFor(const Format& format, const std::filesystem::path& name, const Bundle& source,
               std::span<const Camera> views, WriteOptions options, const Target& target,
               const ConvertListener& listener = {});

struct Chosen {
  float steps = 1;
  bool textured = true;
};
// The same, and where a textured source should have a size whether it is nearer to itself as what stands in for it
// without textures, by drawing `views`, or no steps reach it otherwise. Models whose pictures nobody asks for are too
// large for that: textured.
Chosen chooseSteps(const Format& format, const std::filesystem::path& name, const Bundle& source,
                   std::span<const Camera> views, const WriteOptions& options, const Target& target,
                   const ConvertListener& listener = {});
// `source` as what stands in for it without textures.
Bundle untextured(const Bundle& source);

// Of what writeModel() makes of `source` at a file of this name.
std::uint64_t bytesOf(const Format& format, const std::filesystem::path& name, const Bundle& source,
                      WriteOptions options);

}  // namespace tg
