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
  std::size_t more = 0;  // places where the same is to be said, numbers aside
};

struct CheckReport {
  std::string file;
  std::string format;  // the name of its Format; "" when not even that could be told
  std::size_t gaussians = 0;
  std::vector<Finding> errors;    // a reader refuses or puts right the file or its texture layer, or glTF forbids it
  std::vector<Finding> warnings;  // a reader ignores or guesses what is allowed
};

// Of glTF files every error of the base and of the texture layer is listed that does not hang on another one; of a
// broken structure (container, JSON, references, sizes) the first. What a reader can overlook is checked on top:
// alignment, extensionsUsed, extensionsRequired, glTF's core rules. Of other formats the first error. Throws
// Error(cannotRead) only.
CheckReport checkFile(const std::filesystem::path& path);

std::string describe(const CheckReport& report);
std::string describeJson(const CheckReport& report);

}  // namespace tg
