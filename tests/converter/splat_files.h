// SPDX-License-Identifier: Apache-2.0
// Builds the splat files of other programs byte by byte, so that tests know every number in them.
#pragma once
#include <zlib.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <glm/gtc/packing.hpp>
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

// Two sections of three and two splats as .ksplat: the first with a full bucket of two splats and one that is not full,
// the second with an empty bucket and one of two. Splat i of the file is at (i, -i, i / 2) at every level.
struct KsplatParts {
  int level = 0;
  int degree = 0;  // of the first section; the second one has none
  std::uint32_t sections = 2, splats = 5;
  float sh_low = -1.0f, sh_high = 1.55f;  // bytes of SH are steps of 0.01
  std::uint32_t bucket_size = 2, full = 1, bucket_bytes = 12;
  std::uint32_t first_length = 1;                 // of the bucket that is not full
  float scale[3] = {1.0f, 0.5f, 0.25f};           // of every splat
  float rotation[4] = {0.5f, -0.5f, 0.0f, 1.0f};  // w, x, y, z
  float first_sh = 1.0f / 32;

  // Red, green and blue of coefficient k - 1 of a Gaussian of the first section.
  static float sh(int level, std::size_t k, std::size_t c) {
    const std::size_t stored = k < 4 ? 3 * c + k - 1 : 9 + 5 * c + k - 4;
    return level < 2 ? static_cast<float>(stored + 1) / 32.0f : static_cast<float>(stored) * 0.1f - 1.0f;
  }

  std::string whole() const {
    ByteWriter out;
    out.add(std::uint8_t{0}).add(std::uint8_t{1}).add(std::uint16_t{0});
    out.add(sections).add(sections).add(splats).add(splats);
    out.add(static_cast<std::uint16_t>(level)).add(std::uint16_t{0});
    for (const float value : {7.0f, 8.0f, 9.0f, sh_low, sh_high})
      out.add(value);  // the scene's centre is of no use here
    out.bytes.resize(4096);
    const std::string first = section(out, 3, degree, 1), second = section(out, 2, 0, 2);
    return out.bytes + first + second;
  }

 private:
  void number(ByteWriter& out, float value) const {
    if (level == 0) out.add(value);
    if (level != 0) out.add(glm::packHalf1x16(value));
  }
  // Appends the header; the section itself.
  std::string section(ByteWriter& file, std::uint32_t count, int sh_degree, int which) const {
    const std::uint32_t full_buckets = which == 1 ? full : 0, partial = which == 1 ? 1 : 2;
    const std::uint32_t range = which == 1 ? 1000 : 0;  // 0: 32767
    const float block = which == 1 ? 20.0f : 32.767f;   // steps of 0.01 and 0.0005
    ByteWriter header;
    header.add(count).add(count);
    if (level > 0) {
      header.add(bucket_size).add(full_buckets + partial).add(block).add(bucket_bytes).add(range);
    } else {
      header.bytes.resize(28);
    }
    header.add(std::uint32_t{0});  // the section's size, which follows from the rest
    header.add(level > 0 ? full_buckets : 0).add(level > 0 ? partial : 0).add(static_cast<std::uint16_t>(sh_degree));
    header.bytes.resize(1024);
    file.bytes += header.bytes;

    ByteWriter out;
    const auto center = [&](std::uint32_t bucket) { return static_cast<float>(which == 1 ? bucket : 3 + bucket); };
    if (level > 0) {
      if (which == 1) out.add(first_length);
      if (which == 2) out.add(std::uint32_t{0}).add(std::uint32_t{2});
      for (std::uint32_t b = 0; b < full_buckets + partial; ++b) {
        for (const float value : {center(b), -center(b), 0.0f}) out.add(value);
      }
    }
    for (std::uint32_t i = 0; i < count; ++i) {
      const float at = static_cast<float>(which == 1 ? i : 3 + i);
      const std::uint32_t bucket = which == 1 ? i / 2 : 1;
      const float mean[] = {at, -at, 0.5f * at}, middle[] = {center(bucket), -center(bucket), 0.0f};
      for (int k = 0; k < 3; ++k) {
        const float steps = (mean[k] - middle[k]) / (which == 1 ? 0.01f : 0.0005f);
        if (level == 0) out.add(mean[k]);
        if (level != 0) out.add(static_cast<std::uint16_t>(std::lround(steps) + (which == 1 ? 1000 : 32767)));
      }
      for (const float value : scale) number(out, value);
      for (const float value : rotation) number(out, value);
      for (const int byte : {255, 0, 128, 51}) out.add(static_cast<std::uint8_t>(byte));
      for (std::size_t k = 0; k < (sh_degree == 0 ? 0u : sh_degree == 1 ? 9u : 24u); ++k) {
        if (level < 2) number(out, k == 0 ? first_sh : static_cast<float>(k + 1) / 32.0f);
        if (level == 2) out.add(static_cast<std::uint8_t>(10 * k));
      }
    }
    return out.bytes;
  }
};
