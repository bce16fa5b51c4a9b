// SPDX-License-Identifier: Apache-2.0
// A folder of models to a folder of models.
#pragma once
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "converter/convert.h"

namespace tg {

struct BatchItem {
  std::filesystem::path input;
  std::filesystem::path output;
  std::string error;     // a printable line; "" when it went well
  ConvertReport report;  // when it did
};

struct BatchReport {
  std::vector<BatchItem> items;
  int exit_code = 0;  // the first failure's
};

struct BatchProgress {
  std::size_t item = 0, items = 0;
  std::string name;  // printable
  double done = 0;  // part of all bytes to be read, in [0, 1]
};

// Every file of a folder, not of its folders, that is a model by its content or is named as one, in the order of their
// names; no hidden ones, and no pages of others. Throws Error(cannotRead), also where there is none.
std::vector<std::filesystem::path> modelsIn(const std::filesystem::path& folder);

// Every model of `input` to `output`/NAME.`extension`. NAME is the file's without its format's ending; of a.ply and
// a.compressed.ply, which would both be a, the latter is a.compressed. A file that fails does not end the run. `output`
// is made if it is not there. Throws Error(usage) when two inputs would get one name, Error(cannotRead) when there is
// no model, Error(cannotWrite).
BatchReport convertFolder(const std::filesystem::path& input, const std::filesystem::path& output,
                          const std::string& extension, const ConvertOptions& options,
                          const std::function<void(const BatchProgress&)>& progress);

std::string describe(const BatchReport& report);
std::string describeJson(const BatchReport& report);

}  // namespace tg
