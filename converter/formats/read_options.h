// SPDX-License-Identifier: Apache-2.0
// What a caller asks of the readers of model files.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "converter/formats/spz.h"

namespace tg {

struct ReadProgress;

struct ReadOptions {
  ReadProgress* progress = nullptr;      // of tgz and PLY; may be null
  bool base_only = false;                // glTF, SOG: leave the textures aside, as a reader that knows only the base
  std::optional<SpzAxes> spz_axes = {};  // spz: those of its numbers, whatever the file says
  // glTF files: gets every error of the base and the layer that can be told apart before the first one is thrown, and
  // what breaks a rule and is put right, which is no warning then; it stays empty when the file could not be taken
  // apart. May be null.
  std::vector<std::string>* errors = nullptr;
};

}  // namespace tg
