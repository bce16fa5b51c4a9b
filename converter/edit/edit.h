// SPDX-License-Identifier: Apache-2.0
// The edits of tgconvert's command line, one after the other in the order they are given.
#pragma once
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "converter/formats/read_options.h"
#include "core/bundle/bundle.h"

namespace tg {

struct Edit {
  std::string option;        // "--translate"
  std::string value;         // "1,2,3"; "" for an option without one
  ReadOptions reading = {};  // of the file that is merged
};

struct EditReport {
  Edit edit;
  std::size_t before = 0;  // Gaussians
  std::size_t after = 0;
  std::optional<double> psnr;  // [dB] after against before, for edits that leave the same scene with less of it
};

// What an option is called, what it takes ("" = nothing) and does: for --help and for the parser.
struct EditOption {
  std::string_view name;
  std::string_view value;
  std::string_view help;
};
std::span<const EditOption> editOptions();

// Numbers are in the model's axes (x right, y down, z forward) and world units. `measure`: render before and after
// where that says something. Throws Error(usage, "--option VALUE: ...") for a value that is wrong, Error(badData) when
// nothing or infinite numbers would be left, and what reading a merged file throws. An edited model loses its preview,
// and its training.json says that it is edited.
std::vector<EditReport> applyEdits(Bundle& loaded, std::span<const Edit> edits, bool measure);

}  // namespace tg
