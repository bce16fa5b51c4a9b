// SPDX-License-Identifier: Apache-2.0
// Reads named float tensors from .safetensors files: an 8-byte length, that much JSON, then the raw little-endian data.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace tg {

struct Tensor {
  std::vector<std::int64_t> shape;  // outermost first; empty: a scalar
  std::vector<float> values;
};

class Safetensors {
 public:
  // Throws Error(cannotRead / badData): a header longer than the file or 16 MiB, entries that are not {dtype, shape,
  // data_offsets}, data outside the file, a shape that disagrees with the data's length.
  static Safetensors read(const std::filesystem::path& path);
  static Safetensors parse(std::vector<std::uint8_t> bytes, const std::string& path);

  std::vector<std::string> names() const;
  bool contains(const std::string& name) const { return entries_.contains(name); }
  const std::vector<std::int64_t>& shape(const std::string& name) const;  // throws as tensor does
  // F32 or F16, converted to float. Throws Error(badData) for other types, a missing name and values not finite.
  Tensor tensor(const std::string& name) const;
  const std::string& path() const { return path_; }

 private:
  struct Entry {
    std::string type;
    std::vector<std::int64_t> shape;
    std::size_t begin = 0, end = 0;  // in bytes_
  };
  const Entry& entry(const std::string& name) const;
  [[noreturn]] void fail(const std::string& what) const;

  std::string path_;
  std::vector<std::uint8_t> bytes_;
  std::map<std::string, Entry> entries_;
};

}  // namespace tg
