// SPDX-License-Identifier: Apache-2.0
// NumPy .npy files of unsigned integers, as numpy.save writes them. Private to core.
#pragma once
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {

// "{'descr': '<u2', 'fortran_order': False, 'shape': (7, 4), }". columns = 0: one dimension.
template <std::unsigned_integral T>
std::string npyDescription(std::size_t rows, std::size_t columns) {
  const std::string shape =
      columns == 0 ? std::to_string(rows) + "," : std::to_string(rows) + ", " + std::to_string(columns);
  return std::string("{'descr': '") + (sizeof(T) == 1 ? "|u" : "<u") + std::to_string(sizeof(T)) +
         "', 'fortran_order': False, 'shape': (" + shape + "), }";
}

template <std::unsigned_integral T>
std::vector<std::uint8_t> formatNpy(std::span<const T> values, std::size_t rows, std::size_t columns) {
  TG_ASSERT(values.size() == rows * (columns == 0 ? 1 : columns), "the values fill the array");
  std::string header = npyDescription<T>(rows, columns);
  header.resize((10 + header.size() + 1 + 63) / 64 * 64 - 11, ' ');  // data starts at a multiple of 64
  header += '\n';
  const std::uint8_t prefix[] = {0x93,
                                 'N',
                                 'U',
                                 'M',
                                 'P',
                                 'Y',
                                 1,
                                 0,
                                 static_cast<std::uint8_t>(header.size() & 255),
                                 static_cast<std::uint8_t>(header.size() >> 8)};
  std::vector<std::uint8_t> bytes(sizeof(prefix) + header.size() + values.size_bytes());
  std::memcpy(bytes.data(), prefix, sizeof(prefix));
  std::memcpy(bytes.data() + sizeof(prefix), header.data(), header.size());
  if (!values.empty()) std::memcpy(bytes.data() + sizeof(prefix) + header.size(), values.data(), values.size_bytes());
  return bytes;
}

// Throws Error(badData) unless the file holds exactly this type and shape.
template <std::unsigned_integral T>
std::vector<T> parseNpy(std::span<const std::uint8_t> bytes, std::size_t rows, std::size_t columns,
                        const std::string& path) {
  const auto fail = [&](const std::string& what) -> Error { return Error(ErrorKind::badData, path, what); };
  constexpr std::uint8_t magic[] = {0x93, 'N', 'U', 'M', 'P', 'Y', 1};
  if (bytes.size() < 10 || std::memcmp(bytes.data(), magic, sizeof(magic)) != 0) {
    throw fail("not a NumPy file (expected version 1)");
  }
  const std::size_t header_size = static_cast<std::size_t>(bytes[8] | bytes[9] << 8);
  if (bytes.size() < 10 + header_size) throw fail("NumPy header ends early");
  const auto withoutSpace = [](std::string_view text) {
    std::string kept;
    for (char c : text) {
      if (c != ' ' && c != '\n') kept += c;
    }
    return kept;
  };
  const std::string expected = npyDescription<T>(rows, columns);
  const std::string found(bytes.begin() + 10, bytes.begin() + 10 + static_cast<std::ptrdiff_t>(header_size));
  if (withoutSpace(found) != withoutSpace(expected)) {
    std::string shown;
    for (char c : found.substr(0, 120)) shown += c >= ' ' && c <= '~' ? c : ' ';
    throw fail("wrong NumPy array (expected " + expected + ", found " +
               shown.substr(0, shown.find_last_not_of(' ') + 1) + ")");
  }
  const std::size_t count = rows * (columns == 0 ? 1 : columns);
  const std::span<const std::uint8_t> body = bytes.subspan(10 + header_size);
  if (body.size() != count * sizeof(T)) {
    throw fail("wrong length of NumPy data (expected " + std::to_string(count * sizeof(T)) + " bytes, found " +
               std::to_string(body.size()) + ")");
  }
  std::vector<T> values(count);
  if (count > 0) std::memcpy(values.data(), body.data(), body.size());
  return values;
}

}  // namespace tg
