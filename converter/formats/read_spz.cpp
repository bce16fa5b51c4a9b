// SPDX-License-Identifier: Apache-2.0
// Reads SPZ.
#include "converter/formats/read_spz.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string_view>
#include <vector>

#include "converter/formats/inflate.h"
#include "converter/formats/little_endian.h"
#include "converter/formats/repair.h"
#include "converter/formats/spz.h"
#include "core/bundle/ply.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/error.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxBytesPerSplat = 9 + 1 + 3 + 3 + 4 + 72;
constexpr std::uint64_t kMaxExtensionBytes = std::uint64_t{16} << 20;
constexpr int kMaxModelDegree = 3;  // of the model
constexpr int kMaxSpzDegree = 4;  // of the format
constexpr int kMaxFraction = 23;  // bits: positions have 24, one of them the sign
constexpr std::uint64_t kTocEntryBytes = 16;
constexpr std::array<const char*, kSpzStreams> kStreamNames = {"the stream of positions", "the stream of alphas",
                                                               "the stream of colours",   "the stream of scales",
                                                               "the stream of rotations", "the stream of SH"};

using Streams = std::array<std::span<const std::uint8_t>, kSpzStreams>;

// The fields that all versions share. `bytes` holds at least kSpzHeaderBytes.
SpzHeader readHeader(std::span<const std::uint8_t> bytes, const std::string& path) {
  const auto fail = [&](const std::string& what) { throw Error(ErrorKind::badData, path, "SPZ: " + what); };
  if (readU32(bytes, 0) != kSpzMagic) fail("the header does not start with NGSP");
  SpzHeader header;
  header.version = readU32(bytes, 4);
  header.count = readU32(bytes, 8);
  header.sh_degree = bytes[12];
  header.fractional_bits = bytes[13];
  header.flags = bytes[14];
  if (header.version < 2 || header.version > 4) {
    fail("version " + std::to_string(header.version) + " is not supported (expected 2, 3 or 4)");
  }
  if (header.count == 0 || header.count > kMaxGaussians) {
    fail("wrong number of splats (expected 1 to " + std::to_string(kMaxGaussians) + ", found " +
         std::to_string(header.count) + ")");
  }
  if (header.sh_degree > kMaxSpzDegree) {
    fail("wrong SH degree (expected 0 to 4, found " + std::to_string(header.sh_degree) + ")");
  }
  if (header.fractional_bits > kMaxFraction) {
    fail("wrong number of fractional bits (expected 0 to " + std::to_string(kMaxFraction) + ", found " +
         std::to_string(header.fractional_bits) + ")");
  }
  return header;
}

float positionFrom(const std::uint8_t* from, int fractional_bits) {
  const std::uint32_t bits = from[0] | std::uint32_t{from[1]} << 8 | std::uint32_t{from[2]} << 16;
  const std::int32_t fixed = static_cast<std::int32_t>(bits << 8) >> 8;  // the sign is bit 23
  return std::ldexp(static_cast<float>(fixed), -fractional_bits);
}

// w, x, y, z. Version 2: x, y, z in 8 bits each, w >= 0.
glm::vec4 rotationFrom3(const std::uint8_t* from) {
  glm::vec4 q(0.0f);
  for (int k = 0; k < 3; ++k) q[k + 1] = static_cast<float>(from[k]) / 127.5f - 1.0f;
  q.x = std::sqrt(std::max(0.0f, 1.0f - glm::dot(q, q)));
  return q;
}

// Versions 3 and 4: of x, y, z, w the largest one's index in the top two bits, below it the others, each a sign and 9
// bits.
glm::vec4 rotationFrom4(std::span<const std::uint8_t> from) {
  constexpr std::uint32_t mask = (1u << kSpzRotationBits) - 1;
  std::uint32_t bits = readU32(from, 0);
  const int largest = static_cast<int>(bits >> 30);
  std::array<float, 4> xyzw{};
  float rest = 1.0f;
  for (int k = 3; k >= 0; --k) {
    if (k == largest) continue;
    const float magnitude = std::sqrt(0.5f) * static_cast<float>(bits & mask) / static_cast<float>(mask);
    xyzw[k] = (bits >> kSpzRotationBits & 1u) != 0 ? -magnitude : magnitude;
    rest -= magnitude * magnitude;
    bits >>= kSpzRotationBits + 1;
  }
  xyzw[largest] = std::sqrt(std::max(0.0f, rest));
  return {xyzw[3], xyzw[0], xyzw[1], xyzw[2]};
}

GaussianModel decode(const SpzHeader& header, const Streams& streams) {
  GaussianModel model;
  const std::size_t n = header.count;
  resizeGaussians(model, n, std::min(header.sh_degree, kMaxModelDegree));
  const std::size_t coefficients = model.shCount();
  const std::size_t stored = static_cast<std::size_t>((header.sh_degree + 1) * (header.sh_degree + 1) - 1);
  const std::size_t rotation_bytes = header.version == 2 ? 3 : 4;
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint8_t* position = streams[kSpzPositions].data() + i * 9;
    glm::vec3* sh = model.sh.data() + i * coefficients;
    for (int k = 0; k < 3; ++k) {
      const std::size_t at = i * 3 + static_cast<std::size_t>(k);
      model.mean[i][k] = positionFrom(position + 3 * k, header.fractional_bits);
      model.log_scale[i][k] = static_cast<float>(streams[kSpzScales][at]) * kSpzScaleStep + kSpzLowestScale;
      sh[0][k] = (static_cast<float>(streams[kSpzColors][at]) / 255.0f - 0.5f) / kSpzColorScale;
      for (std::size_t c = 1; c < coefficients; ++c) {
        const float byte = streams[kSpzSh][(i * stored + c - 1) * 3 + static_cast<std::size_t>(k)];
        sh[c][k] = (byte - 128.0f) * kSpzShStep;
      }
    }
    const std::span<const std::uint8_t> rotation = streams[kSpzRotations].subspan(i * rotation_bytes, rotation_bytes);
    model.rotation[i] = header.version == 2 ? rotationFrom3(rotation.data()) : rotationFrom4(rotation);
    model.opacity_logit[i] = logitFromOpacity(streams[kSpzAlphas][i] / 255.0);
  }
  return model;
}

Bundle finish(const SpzHeader& header, const Streams& streams, const std::string& path) {
  Bundle loaded;
  loaded.model = decode(header, streams);
  if (header.sh_degree > kMaxModelDegree) loaded.warnings.push_back("SH of degree 4 is left out");
  if ((header.flags & kSpzAntialiased) != 0) {
    loaded.warnings.push_back("trained with antialiasing, which the model has no word for");
  }
  if ((header.flags & kSpzExtensions) != 0) loaded.warnings.push_back("vendor extensions are left out");
  checkModel(loaded.model, path);
  return loaded;
}

// Versions 2 and 3: header and streams in one piece.
Bundle parseWhole(const SpzHeader& header, std::span<const std::uint8_t> payload, const std::string& path) {
  Streams streams;
  std::size_t at = 0;
  const auto sizes = header.sizes();
  for (int s = 0; s < kSpzStreams; at += sizes[s], ++s) streams[s] = payload.subspan(at, sizes[s]);
  return finish(header, streams, path);
}

std::uint64_t payloadBytes(const SpzHeader& header) {
  const auto sizes = header.sizes();
  return std::accumulate(sizes.begin(), sizes.end(), std::uint64_t{0});
}

void checkTrailer(const SpzHeader& header, std::uint64_t bytes, const std::string& path) {
  if (bytes == 0 || (header.flags & kSpzExtensions) != 0) return;
  throw Error(ErrorKind::badData, path, "SPZ: " + std::to_string(bytes) + " bytes follow the splats (expected none)");
}

Bundle parseGzip(std::span<const std::uint8_t> bytes, const std::string& path) {
  GzipBytes gzip(bytes, path);
  const SpzHeader header = readHeader(gzip.take(kSpzHeaderBytes, "the SPZ header"), path);
  if (header.version > 3) {
    throw Error(ErrorKind::badData, path,
                "SPZ: a gzip stream of version " + std::to_string(header.version) + " (expected 2 or 3)");
  }
  const std::vector<std::uint8_t> payload = gzip.take(payloadBytes(header), "the SPZ payload");
  checkTrailer(header, gzip.skipRest(kMaxExtensionBytes), path);
  return parseWhole(header, payload, path);
}

// Version 4: header, extensions, a table of stream sizes, streams.
Bundle parseStreams(const SpzHeader& header, std::span<const std::uint8_t> bytes, const std::string& path) {
  const auto fail = [&](const std::string& what) { throw Error(ErrorKind::badData, path, "SPZ: " + what); };
  if (bytes.size() < kSpz4HeaderBytes) fail("the file ends inside the header");
  const std::size_t streams = bytes[15];
  const std::size_t expected = header.sh_degree > 0 ? kSpzStreams : kSpzStreams - 1;
  if (streams != expected) {
    fail("wrong number of streams (expected " + std::to_string(expected) + ", found " + std::to_string(streams) + ")");
  }
  const std::uint64_t table = readU32(bytes, 16);
  std::uint64_t at = table + streams * kTocEntryBytes;
  if (table < kSpz4HeaderBytes || at > bytes.size()) {
    fail("the table of streams leaves the file (found at byte " + std::to_string(table) + " of " +
         std::to_string(bytes.size()) + ")");
  }
  const auto sizes = header.sizes();
  std::array<std::vector<std::uint8_t>, kSpzStreams> unpacked;
  Streams views;
  for (std::size_t s = 0; s < streams; ++s) {
    const std::uint64_t packed = readU64(bytes, table + s * kTocEntryBytes);
    const std::uint64_t size = readU64(bytes, table + s * kTocEntryBytes + 8);
    const std::string what = kStreamNames[s];
    if (size != sizes[s]) {
      fail(what + " has a wrong size (expected " + std::to_string(sizes[s]) + " bytes, found " + std::to_string(size) +
           ")");
    }
    if (packed > bytes.size() - at) {
      fail(what + " leaves the file (expected at most " + std::to_string(bytes.size() - at) + " bytes, found " +
           std::to_string(packed) + ")");
    }
    unpacked[s] = unpackZstandard(bytes.subspan(at, packed), size, path, "SPZ: " + what);
    views[s] = unpacked[s];
    at += packed;
  }
  return finish(header, views, path);
}

}  // namespace

Bundle parseSpz(std::span<const std::uint8_t> bytes, const std::string& path) {
  if (bytes.size() >= 2 && bytes[0] == 0x1f && bytes[1] == 0x8b) return parseGzip(bytes, path);
  if (bytes.size() < kSpzHeaderBytes) throw Error(ErrorKind::badData, path, "SPZ: the file ends inside the header");
  const SpzHeader header = readHeader(bytes, path);
  if (header.version > 3) return parseStreams(header, bytes, path);
  const std::uint64_t expected = payloadBytes(header);
  if (expected > bytes.size() - kSpzHeaderBytes) {
    throw Error(ErrorKind::badData, path,
                "SPZ: the file is too short for its " + std::to_string(header.count) + " splats (expected " +
                    std::to_string(kSpzHeaderBytes + expected) + " bytes, found " + std::to_string(bytes.size()) + ")");
  }
  checkTrailer(header, bytes.size() - kSpzHeaderBytes - expected, path);
  return parseWhole(header, bytes.subspan(kSpzHeaderBytes), path);
}

Bundle readSpz(const std::filesystem::path& path) {
  return parseSpz(readFile(path, kMaxGaussians * kMaxBytesPerSplat + kMaxExtensionBytes), path.string());
}

}  // namespace tg
