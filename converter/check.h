// SPDX-License-Identifier: Apache-2.0
// Says what is wrong with a file, and where: tgconvert check.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace tg {

struct Finding {
  std::string pointer;  // JSON pointer; "" where the message is about the whole file or the file is no glTF
  std::string message;
};

struct CheckReport {
  std::string file;
  std::string format;  // as name(FileFormat) has it; "" when not even that could be told
  std::size_t gaussians = 0;
  std::vector<Finding> errors;    // a reader refuses the file or its texture layer
  std::vector<Finding> warnings;  // a reader repairs, ignores or guesses
};

// Of glTF files the base and the texture layer are read apart, up to the first error of each, and what a reader can
// overlook is checked on top: alignment, extensionsUsed, extensionsRequired. Throws Error(cannotRead) only.
CheckReport checkFile(const std::filesystem::path& path);

std::string describe(const CheckReport& report);
std::string describeJson(const CheckReport& report);

}  // namespace tg
