// SPDX-License-Identifier: Apache-2.0
// In the place of a fuzzer: gives a target every file of the command line and of the folders there, in the order of
// their names. Fails where there is none, so that a test without its corpus does not pass.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <vector>

#include "core/file/file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

int main(int argc, char** argv) {
  constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 20;
  std::vector<std::filesystem::path> files;
  try {
    for (int k = 1; k < argc; ++k) {
      if (!std::filesystem::is_directory(argv[k])) {
        files.emplace_back(argv[k]);
        continue;
      }
      for (const auto& entry : std::filesystem::directory_iterator(argv[k])) files.push_back(entry.path());
    }
    std::ranges::sort(files);
    for (const std::filesystem::path& file : files) {
      const std::vector<std::uint8_t> bytes = tg::readFile(file, kMostBytes);
      LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", argv[0], error.what());
    return 3;
  }
  std::printf("%zu files\n", files.size());
  return files.empty() ? 2 : 0;
}
