// SPDX-License-Identifier: Apache-2.0
// The header is JSON from a stranger: every number is checked before it is used.
#include "core/file/safetensors.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/file/file.h"
#include "core/system/error.h"

namespace tg {
namespace {

using Json = nlohmann::json;

constexpr std::uint64_t kMaxFileBytes = std::uint64_t{2} << 30;
constexpr std::uint64_t kMaxHeaderBytes = std::uint64_t{16} << 20;
constexpr std::size_t kMaxDimensions = 8;
constexpr std::size_t kMaxNameShown = 80;

static_assert(std::endian::native == std::endian::little, "tensors are copied as they lie in the file");

std::size_t elementBytes(const std::string& type) {
  for (const auto& [name, bytes] : std::initializer_list<std::pair<const char*, std::size_t>>{{"F64", 8},
                                                                                              {"I64", 8},
                                                                                              {"U64", 8},
                                                                                              {"F32", 4},
                                                                                              {"I32", 4},
                                                                                              {"U32", 4},
                                                                                              {"F16", 2},
                                                                                              {"BF16", 2},
                                                                                              {"I16", 2},
                                                                                              {"U16", 2},
                                                                                              {"I8", 1},
                                                                                              {"U8", 1},
                                                                                              {"BOOL", 1},
                                                                                              {"F8_E4M3", 1},
                                                                                              {"F8_E5M2", 1}}) {
    if (type == name) return bytes;
  }
  return 0;
}

float floatFromHalf(std::uint16_t half) {
  const float sign = half & 0x8000 ? -1.0f : 1.0f;
  const int exponent = half >> 10 & 31;
  const float mantissa = static_cast<float>(half & 1023);
  if (exponent == 31) return mantissa == 0 ? sign * std::numeric_limits<float>::infinity() : std::nanf("");
  return exponent == 0 ? sign * std::ldexp(mantissa, -24) : sign * std::ldexp(mantissa + 1024, exponent - 25);
}

// A non-negative integer that fits; JSON floats do not count.
bool readCount(const Json& json, std::int64_t& value) {
  if (!json.is_number_integer()) return false;
  if (json.is_number_unsigned() && json.get<std::uint64_t>() > std::numeric_limits<std::int64_t>::max()) return false;
  value = json.get<std::int64_t>();
  return value >= 0;
}

std::string shownTensor(const std::string& name) { return "tensor '" + name.substr(0, kMaxNameShown) + "'"; }

}  // namespace

void Safetensors::fail(const std::string& what) const { throw Error(ErrorKind::badData, path_, what); }

Safetensors Safetensors::read(const std::filesystem::path& path) {
  return parse(readFile(path, kMaxFileBytes), path.string());
}

Safetensors Safetensors::parse(std::vector<std::uint8_t> bytes, const std::string& path) {
  Safetensors file;
  file.path_ = path;
  file.bytes_ = std::move(bytes);
  std::uint64_t header = 0;
  if (file.bytes_.size() < sizeof header) file.fail("not a safetensors file (expected at least 8 bytes)");
  std::memcpy(&header, file.bytes_.data(), sizeof header);
  const std::uint64_t rest = file.bytes_.size() - sizeof header;
  if (header > kMaxHeaderBytes || header > rest) {
    file.fail("not a safetensors file (expected a header of at most " +
              std::to_string(std::min(rest, kMaxHeaderBytes)) + " bytes, found " + std::to_string(header) + ")");
  }
  const auto begin = file.bytes_.begin() + sizeof header;
  const Json json = Json::parse(begin, begin + static_cast<std::ptrdiff_t>(header), nullptr, false);
  if (!json.is_object()) file.fail("the header is not a JSON object");
  const std::uint64_t data = sizeof header + header;
  const std::uint64_t length = file.bytes_.size() - data;

  for (const auto& [name, description] : json.items()) {
    if (name == "__metadata__") continue;
    const auto part = [&, &fields = description](const char* key) -> const Json& {
      static const Json kNone;
      if (!fields.is_object()) return kNone;
      const auto found = fields.find(key);
      return found == fields.end() ? kNone : *found;
    };
    Entry entry;
    const Json& type = part("dtype");
    const std::size_t element = type.is_string() ? elementBytes(type.get<std::string>()) : 0;
    if (element == 0) file.fail(shownTensor(name) + ": unknown dtype");
    entry.type = type.get<std::string>();
    const Json& shape = part("shape");
    if (!shape.is_array() || shape.size() > kMaxDimensions) {
      file.fail(shownTensor(name) + ": 'shape' is not a short list");
    }
    std::uint64_t elements = 1;
    for (const Json& side : shape) {
      std::int64_t value = 0;
      if (!readCount(side, value)) file.fail(shownTensor(name) + ": 'shape' holds something that is not a size");
      // Sizes that multiply to more than the file holds are refused at once: no product overflows.
      if (value > 0 && elements > length / element / static_cast<std::uint64_t>(value)) {
        file.fail(shownTensor(name) + ": the file is too short for its shape");
      }
      elements *= static_cast<std::uint64_t>(value);
      entry.shape.push_back(value);
    }
    const Json& offsets = part("data_offsets");
    std::int64_t first = 0, last = 0;
    if (!offsets.is_array() || offsets.size() != 2 || !readCount(offsets[0], first) || !readCount(offsets[1], last) ||
        first > last || static_cast<std::uint64_t>(last) > length) {
      file.fail(shownTensor(name) + ": 'data_offsets' do not lie inside the file's " + std::to_string(length) +
                " bytes");
    }
    if (static_cast<std::uint64_t>(last - first) != elements * element) {
      file.fail(shownTensor(name) + ": shape and data differ in length (expected " +
                std::to_string(elements * element) + " bytes, found " + std::to_string(last - first) + ")");
    }
    entry.begin = data + static_cast<std::uint64_t>(first);
    entry.end = data + static_cast<std::uint64_t>(last);
    file.entries_.emplace(name, std::move(entry));
  }
  return file;
}

const Safetensors::Entry& Safetensors::entry(const std::string& name) const {
  const auto found = entries_.find(name);
  if (found == entries_.end()) fail(shownTensor(name) + " is missing");
  return found->second;
}

std::vector<std::string> Safetensors::names() const {
  std::vector<std::string> names;
  for (const auto& [name, entry] : entries_) names.push_back(name);
  return names;
}

const std::vector<std::int64_t>& Safetensors::shape(const std::string& name) const { return entry(name).shape; }

Tensor Safetensors::tensor(const std::string& name) const {
  const Entry& source = entry(name);
  Tensor tensor;
  tensor.shape = source.shape;
  const std::uint8_t* from = bytes_.data() + source.begin;
  const std::size_t bytes = source.end - source.begin;
  if (source.type == "F32") {
    tensor.values.resize(bytes / 4);
    if (bytes > 0) std::memcpy(tensor.values.data(), from, bytes);
  } else if (source.type == "F16") {
    tensor.values.resize(bytes / 2);
    for (std::size_t i = 0; i < tensor.values.size(); ++i) {
      std::uint16_t half = 0;
      std::memcpy(&half, from + 2 * i, sizeof half);
      tensor.values[i] = floatFromHalf(half);
    }
  } else {
    fail(shownTensor(name) + ": cannot use this dtype (expected F32 or F16, found " + source.type + ")");
  }
  for (float value : tensor.values) {
    if (!std::isfinite(value)) fail(shownTensor(name) + " holds a value that is not finite");
  }
  return tensor;
}

}  // namespace tg
