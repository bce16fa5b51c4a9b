// SPDX-License-Identifier: Apache-2.0
// Builds the splat files of other programs byte by byte, so that tests know every number in them.
#pragma once
#include <zlib.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

// Little-endian bytes.
struct ByteWriter {
  std::string bytes;
  template <typename T>
  ByteWriter& add(T value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
    return *this;
  }
  ByteWriter& fixed24(int value) {
    for (int shift : {0, 8, 16}) add(static_cast<std::uint8_t>(value >> shift));
    return *this;
  }
};

inline std::string gzipped(const std::string& bytes) {
  z_stream stream{};
  deflateInit2(&stream, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
  std::string packed(deflateBound(&stream, bytes.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

// A Zstandard frame of stored blocks: one segment, size in the header, no checksum.
inline std::string zstandard(const std::string& bytes) {
  ByteWriter out;
  out.add(std::uint32_t{0xFD2FB528}).add(std::uint8_t{0xA0}).add(static_cast<std::uint32_t>(bytes.size()));
  const std::uint32_t header = static_cast<std::uint32_t>(bytes.size()) << 3 | 1;  // the last block, raw
  out.fixed24(static_cast<int>(header));
  return out.bytes + bytes;
}

// Two splats of SH degree 1 as SPZ; the payload of versions 2 and 3.
struct SpzParts {
  std::uint32_t version = 3;
  std::uint32_t count = 2;
  std::uint8_t degree = 1, fraction = 12, flags = 0;
  std::vector<std::string> streams;

  explicit SpzParts(std::uint32_t v) : version(v) {
    ByteWriter positions, alphas, colors, scales, rotations, sh;
    for (int value : {4096, -8192, 2048, -1, 0, 8388607}) positions.fixed24(value);
    for (int value : {255, 51}) alphas.add(static_cast<std::uint8_t>(value));
    for (int value : {255, 0, 128, 128, 128, 128}) colors.add(static_cast<std::uint8_t>(value));
    for (int value : {160, 144, 128, 0, 255, 16}) scales.add(static_cast<std::uint8_t>(value));
    if (version == 2) {
      for (int value : {255, 128, 128, 128, 0, 128}) rotations.add(static_cast<std::uint8_t>(value));
    } else {
      rotations.add(std::uint32_t{0xC0000000});               // x = y = z = 0, w = 1
      rotations.add(std::uint32_t{1u << 30 | 0x3FFu << 20});  // y the largest, x = -sqrt(1/2)
    }
    for (int value = 0; value < 18; ++value) sh.add(static_cast<std::uint8_t>(64 + value * 8));
    streams = {positions.bytes, alphas.bytes, colors.bytes, scales.bytes, rotations.bytes, sh.bytes};
  }

  std::string header() const {
    ByteWriter out;
    out.add(std::uint32_t{0x5053474e}).add(version).add(count).add(degree).add(fraction).add(flags);
    return out.bytes;
  }
  std::string whole() const {
    std::string bytes = header() + '\0';
    for (const std::string& stream : streams) bytes += stream;
    return bytes;
  }
  std::string version4(const std::string& extensions = "") const {
    ByteWriter out;
    out.bytes = header();
    out.add(static_cast<std::uint8_t>(streams.size())).add(static_cast<std::uint32_t>(32 + extensions.size()));
    out.bytes += std::string(12, '\0') + extensions;
    std::string packed;
    for (const std::string& stream : streams) {
      const std::string frame = zstandard(stream);
      out.add(std::uint64_t{frame.size()}).add(std::uint64_t{stream.size()});
      packed += frame;
    }
    return out.bytes + packed;
  }
};

// 300 splats of SH degree 1 in two chunks as compressed PLY; splat i holds patterns that depend on i.
inline std::string compressedPly(bool colored = true, bool sh = true, std::size_t count = 300) {
  const std::size_t chunks = (count + 255) / 256;
  std::string header = "ply\nformat binary_little_endian 1.0\nelement chunk " + std::to_string(chunks) + "\n";
  for (const char* group : {"", "scale_"}) {
    for (const char* side : {"min_", "max_"}) {
      for (const char* axis : {"x", "y", "z"}) header += std::string("property float ") + side + group + axis + "\n";
    }
  }
  if (colored) {
    for (const char* side : {"min_", "max_"}) {
      for (const char* axis : {"r", "g", "b"}) header += std::string("property float ") + side + axis + "\n";
    }
  }
  header += "element vertex " + std::to_string(count) + "\n";
  for (const char* name : {"position", "rotation", "scale", "color"}) {
    header += std::string("property uint packed_") + name + "\n";
  }
  if (sh) {
    header += "element sh " + std::to_string(count) + "\n";
    for (int k = 0; k < 9; ++k) header += "property uchar f_rest_" + std::to_string(k) + "\n";
  }
  ByteWriter out;
  out.bytes = header + "end_header\n";
  for (std::size_t c = 0; c < chunks; ++c) {
    const float base = static_cast<float>(c) * 10.0f;
    for (float value : {-1.0f, -2.0f, -3.0f, 1.0f, 2.0f, 3.0f}) out.add(base + value);
    for (float value : {-6.0f, -5.0f, -4.0f, -1.0f, -2.0f, -3.0f}) out.add(value);
    if (colored) {
      for (float value : {-0.5f, 0.0f, 0.5f, 1.5f, 1.0f, 0.75f}) out.add(value);
    }
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    out.add(2047u << 21 | 0u << 11 | (i & 2047u));
    out.add((i % 4) << 30 | 1023u << 20 | 512u << 10 | 511u);
    out.add(0u << 21 | 1023u << 11 | 2047u);
    out.add(255u << 24 | 0u << 16 | 51u << 8 | (i & 255u));
  }
  if (sh) {
    for (std::uint32_t i = 0; i < count; ++i) {
      for (std::uint32_t k = 0; k < 9; ++k) out.add(static_cast<std::uint8_t>(k == 0 ? 0 : k == 8 ? 255 : 120 + k));
    }
  }
  return out.bytes;
}

struct SplatRecord {
  float position[3];
  float scale[3];
  std::uint8_t color[4];
  std::uint8_t rotation[4];
};
