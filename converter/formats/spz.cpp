// SPDX-License-Identifier: Apache-2.0
// SPZ in and out.
#include "converter/formats/spz.h"

#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <new>
#include <numeric>

#include "converter/formats/inflate.h"
#include "converter/formats/little_endian.h"
#include "converter/formats/repair.h"
#include "core/bundle/ply.h"
#include "core/bundle/splat_rows.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

constexpr std::uint32_t kSpzMagic = 0x5053474e;  // "NGSP"
constexpr std::size_t kSpzHeaderBytes = 16;      // versions 2 and 3, the first bytes inside the gzip stream
constexpr std::size_t kSpz4HeaderBytes = 32;     // version 4, in the clear
constexpr float kSpzColorScale = 0.15f;          // byte = (DC coefficient * 0.15 + 0.5) * 255
constexpr float kSpzScaleStep = 1.0f / 16.0f;    // log scale = byte / 16 - 10
constexpr float kSpzLowestScale = -10.0f;
constexpr float kSpzShStep = 1.0f / 128.0f;  // SH coefficient = (byte - 128) / 128
constexpr int kSpzRotationBits = 9;          // magnitude of a component of at most sqrt(1/2), version 3 and later

enum SpzFlags : std::uint8_t { kSpzAntialiased = 1, kSpzExtensions = 2 };

// Attributes in file order.
enum SpzStream { kSpzPositions, kSpzAlphas, kSpzColors, kSpzScales, kSpzRotations, kSpzSh, kSpzStreams };

struct SpzHeader {
  std::uint32_t version = 0;
  std::uint32_t count = 0;
  int sh_degree = 0;        // 0..4
  int fractional_bits = 0;  // of the 24-bit positions
  std::uint8_t flags = 0;

  // [bytes] of each stream.
  std::array<std::uint64_t, kSpzStreams> sizes() const {
    const std::uint64_t n = count;
    return {9 * n, n, 3 * n, 3 * n, (version == 2 ? 3 : 4) * n, 3 * (shCountOf(sh_degree) - 1) * n};
  }
};

constexpr std::uint64_t kMaxBytesPerSplat = 9 + 1 + 3 + 3 + 4 + 72;
constexpr std::uint64_t kMaxExtensionBytes = std::uint64_t{16} << 20;
constexpr int kMaxModelDegree = 3;  // of the model
constexpr int kMaxSpzDegree = 4;    // of the format
constexpr int kMaxFraction = 23;    // bits: positions have 24, one of them the sign
constexpr std::uint64_t kTocEntryBytes = 16;
// Of version 4: a file may deliver so many times its bytes, or so many bytes however short it is. Attributes that are
// one number throughout pack 30,000 : 1, positions of different Gaussians hardly at all.
constexpr std::uint64_t kMaxRatio = 1000;
constexpr std::uint64_t kRatioFreeBytes = std::uint64_t{64} << 20;
constexpr std::array<const char*, kSpzStreams> kStreamNames = {"the stream of positions", "the stream of alphas",
                                                               "the stream of colours",   "the stream of scales",
                                                               "the stream of rotations", "the stream of SH"};

using Streams = std::array<std::span<const std::uint8_t>, kSpzStreams>;

// Of degree 0 there is no stream of SH.
std::size_t streamsOf(const SpzHeader& header) { return header.sh_degree > 0 ? kSpzStreams : kSpzStreams - 1; }

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

// What turns the numbers of a file's axes to another's: the sign of each axis.
using Signs = glm::vec3;

constexpr Signs kModelFromRub(1.0f, -1.0f, -1.0f);  // its own inverse, as every Signs

// Of a quaternion w, x, y, z; no handedness is lost: a Gaussian's mirror image is one turned so.
glm::vec4 turned(glm::vec4 q, Signs s) { return {q.x, q.y * s.y * s.z, q.z * s.x * s.z, q.w * s.x * s.y}; }

// Of SH of degrees 0 to 3, order -l to l: what each turns into where x, y or z changes its sign.
std::array<float, 16> shSigns(Signs s) {
  const float x = s.x, y = s.y, z = s.z, xyz = x * y * z;
  return {1, y, z, x, x * y, y * z, 1, x * z, 1, y, xyz, y, z, x, z, x};
}

// SPZ_ADOBE_coordinate_system numbers the axes of x, y, z from 1 on: in its bits whether x is right (else left), y up
// (down), z front (back), and whether y and z have changed places.
Signs modelFromNamed(std::uint32_t system, const std::string& path) {
  constexpr std::array<const char*, 16> names = {"LDB", "RDB", "LUB", "RUB", "LDF", "RDF", "LUF", "RUF",
                                                 "LFD", "RFD", "LFU", "RFU", "LBD", "RBD", "LBU", "RBU"};
  const auto fail = [&](const std::string& found) {
    throw Error(ErrorKind::badData, path,
                "SPZ: axes that are not supported" + expectedFound("LDB to RUF, 1 to 8", found));
  };
  if (system == 0 || system > names.size()) fail(std::to_string(system));
  const std::uint32_t bits = system - 1;
  if ((bits & 8) != 0) fail(names[bits]);
  return {(bits & 1) != 0 ? 1.0f : -1.0f, (bits & 2) != 0 ? -1.0f : 1.0f, (bits & 4) != 0 ? 1.0f : -1.0f};
}

constexpr std::uint32_t kAxesExtension = 0xADBE0003;

struct Extensions {
  std::optional<std::uint32_t> axes;  // of SPZ_ADOBE_coordinate_system
  bool others = false;
};

// Records of type, length and content. What is cut is nobody's: it counts as another's.
Extensions readExtensions(std::span<const std::uint8_t> bytes) {
  Extensions found;
  const std::uint8_t* padding = bytes.data() + bytes.size();  // looked for once: hostile records are empty, and many
  while (padding != bytes.data() && padding[-1] == 0) --padding;
  while (bytes.data() < padding) {
    const std::uint64_t length = bytes.size() < 8 ? 0 : readU32(bytes, 4);
    if (bytes.size() < 8 || length > bytes.size() - 8) {
      found.others = true;
      break;
    }
    if (readU32(bytes, 0) == kAxesExtension && length == 4) {
      found.axes = readU32(bytes, 8);
    } else {
      found.others = true;
    }
    bytes = bytes.subspan(8 + static_cast<std::size_t>(length));
  }
  return found;
}

GaussianModel decode(const SpzHeader& header, const Streams& streams, Signs signs) {
  const std::array<float, 16> sh_signs = shSigns(signs);
  GaussianModel model;
  const std::size_t n = header.count;
  resizeGaussians(model, n, std::min(header.sh_degree, kMaxModelDegree));
  const std::size_t coefficients = model.shCount();
  const std::size_t stored = shCountOf(header.sh_degree) - 1;
  const std::size_t rotation_bytes = header.version == 2 ? 3 : 4;
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint8_t* position = streams[kSpzPositions].data() + i * 9;
    glm::vec3* sh = model.sh.data() + i * coefficients;
    for (int k = 0; k < 3; ++k) {
      const std::size_t at = i * 3 + static_cast<std::size_t>(k);
      model.mean[i][k] = signs[k] * positionFrom(position + 3 * k, header.fractional_bits);
      model.log_scale[i][k] = static_cast<float>(streams[kSpzScales][at]) * kSpzScaleStep + kSpzLowestScale;
      sh[0][k] = (static_cast<float>(streams[kSpzColors][at]) / 255.0f - 0.5f) / kSpzColorScale;
      for (std::size_t c = 1; c < coefficients; ++c) {
        const float byte = streams[kSpzSh][(i * stored + c - 1) * 3 + static_cast<std::size_t>(k)];
        sh[c][k] = sh_signs[c] * (byte - 128.0f) * kSpzShStep;
      }
    }
    const std::span<const std::uint8_t> rotation = streams[kSpzRotations].subspan(i * rotation_bytes, rotation_bytes);
    model.rotation[i] = turned(header.version == 2 ? rotationFrom3(rotation.data()) : rotationFrom4(rotation), signs);
    model.opacity_logit[i] = logitFromOpacity(streams[kSpzAlphas][i] / 255.0);
  }
  return model;
}

// What a file of other axes than the format's own says of them, and what the caller knows better.
struct Asked {
  const std::string& path;
  std::optional<SpzAxes> axes;
};

Bundle finish(const SpzHeader& header, const Streams& streams, std::span<const std::uint8_t> extension_bytes,
              const Asked& asked) {
  const std::string& path = asked.path;
  Extensions extensions;
  if ((header.flags & kSpzExtensions) != 0) extensions = readExtensions(extension_bytes);
  Signs signs = kModelFromRub;
  if (asked.axes) {
    signs = *asked.axes == SpzAxes::rdf ? Signs(1.0f) : kModelFromRub;
  } else if (extensions.axes && *extensions.axes != 0) {  // 0: nothing is said
    signs = modelFromNamed(*extensions.axes, path);
  }
  Bundle loaded;
  loaded.model = decode(header, streams, signs);
  if (signs != kModelFromRub) loaded.axes = signs;
  if (header.sh_degree > kMaxModelDegree) loaded.warnings.push_back("SH of degree 4 is left out");
  if ((header.flags & kSpzAntialiased) != 0) {
    loaded.warnings.emplace_back(kAntialiasedWarning);
  }
  if (extensions.others) loaded.warnings.push_back("vendor extensions are left out");
  checkModel(loaded.model, path);
  return loaded;
}

// The streams in one piece, as they follow the header in versions 2 and 3.
Streams split(const SpzHeader& header, std::span<const std::uint8_t> payload) {
  Streams streams;
  std::size_t at = 0;
  const auto sizes = header.sizes();
  for (int s = 0; s < kSpzStreams; at += sizes[s], ++s) streams[s] = payload.subspan(at, sizes[s]);
  return streams;
}

std::uint64_t payloadBytes(const SpzHeader& header) {
  const auto sizes = header.sizes();
  return std::accumulate(sizes.begin(), sizes.end(), std::uint64_t{0});
}

void checkTrailer(const SpzHeader& header, std::span<const std::uint8_t> bytes, const std::string& path) {
  if (isPadding(bytes) || (header.flags & kSpzExtensions) != 0) return;
  throw Error(ErrorKind::badData, path,
              "SPZ: " + std::to_string(bytes.size()) + " bytes follow the splats (expected none)");
}

Bundle parseGzip(std::span<const std::uint8_t> bytes, const Asked& asked) {
  const std::string& path = asked.path;
  GzipBytes gzip(bytes, path);
  const SpzHeader header = readHeader(gzip.take(kSpzHeaderBytes, "the SPZ header"), path);
  if (header.version > 3) {
    throw Error(ErrorKind::badData, path,
                "SPZ: a gzip stream of version " + std::to_string(header.version) + " (expected 2 or 3)");
  }
  const std::vector<std::uint8_t> payload = gzip.take(payloadBytes(header), "the SPZ payload");
  const std::vector<std::uint8_t> rest = gzip.takeRest(kMaxExtensionBytes);
  checkTrailer(header, rest, path);
  return finish(header, split(header, payload), rest, asked);
}

// Version 4: header, extensions, a table of stream sizes, streams.
Bundle parseStreams(const SpzHeader& header, std::span<const std::uint8_t> bytes, const Asked& asked) {
  const std::string& path = asked.path;
  const auto fail = [&](const std::string& what) { throw Error(ErrorKind::badData, path, "SPZ: " + what); };
  if (bytes.size() < kSpz4HeaderBytes) fail("the file ends inside the header");
  const std::size_t streams = bytes[15];
  if (streams != streamsOf(header)) fail("wrong number of streams" + expectedFound(streamsOf(header), streams));
  const std::uint64_t payload = payloadBytes(header);
  if (payload > kRatioFreeBytes && payload / kMaxRatio > bytes.size()) {
    fail("the file is too short for its " + std::to_string(header.count) + " splats (expected at least " +
         std::to_string(payload / kMaxRatio) + " bytes, found " + std::to_string(bytes.size()) + ")");
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
      const std::uint64_t end = at + std::min(packed, std::numeric_limits<std::uint64_t>::max() - at);
      fail(what + " leaves the file, which may be cut off (expected at least " + std::to_string(end) +
           " bytes, found " + std::to_string(bytes.size()) + ")");
    }
    unpacked[s] = unpackZstandard(bytes.subspan(at, packed), size, path, "SPZ: " + what);
    views[s] = unpacked[s];
    at += packed;
  }
  checkTrailer({}, bytes.subspan(at), path);
  return finish(header, views, bytes.subspan(kSpz4HeaderBytes, static_cast<std::size_t>(table) - kSpz4HeaderBytes),
                asked);
}

constexpr int kUsualFraction = 12;  // bits: 0.24 mm where the unit is a metre
constexpr int kExtentBits = 16;     // but at least so many of the largest coordinate, for small scenes
constexpr double kLargestFixed = 8388607.0;
constexpr int kSh1Bits = 5;  // of degree 1, as the format's own library has it: fewer bits pack better
constexpr int kShRestBits = 4;

using Bytes = std::vector<std::uint8_t>;

int fractionalBits(const GaussianModel& model, const std::string& path) {
  double extent = 0.0;
  for (const glm::vec3& p : model.mean) {
    for (int k = 0; k < 3; ++k) extent = std::max(extent, std::abs(static_cast<double>(p[k])));
  }
  if (extent > kLargestFixed) {
    throw Error(
        ErrorKind::badData, path,
        "a mean is too far out for SPZ (expected coordinates below 8388607, found " + std::to_string(extent) + ")");
  }
  if (extent == 0.0) return kUsualFraction;
  int exponent = 0;  // extent < 2^exponent
  std::frexp(extent * (1.0 + 1e-6), &exponent);
  return std::clamp(std::max(kUsualFraction, kExtentBits - exponent), 0, std::clamp(23 - exponent, 0, 23));
}

// Rounds to a byte; counts what does not fit by setting `clipped`.
std::uint8_t toByte(double value, bool& clipped) {
  const double rounded = std::floor(value + 0.5);
  if (rounded < 0.0 || rounded > 255.0) clipped = true;
  return static_cast<std::uint8_t>(std::clamp(rounded, 0.0, 255.0));
}

// Only the upper bits of the byte are used; 128 stays 0.
std::uint8_t shByte(float coefficient, int bits, bool& clipped) {
  const int step = 1 << (8 - bits);
  if (std::abs(coefficient) > 1.0f) clipped = true;
  const double clamped = std::clamp(static_cast<double>(coefficient), -1.0, 1.0);
  const int byte = static_cast<int>(std::floor(clamped * 128.0 + 0.5)) + 128;
  return static_cast<std::uint8_t>(std::clamp((byte + step / 2) / step * step, 0, 255));
}

std::uint32_t packRotation(glm::vec4 wxyz) {
  const glm::dvec4 q = glm::normalize(glm::dvec4(wxyz));
  const std::array<double, 4> xyzw = {q.y, q.z, q.w, q.x};
  int largest = 0;
  for (int k = 1; k < 4; ++k) {
    if (std::abs(xyzw[k]) > std::abs(xyzw[largest])) largest = k;
  }
  constexpr double mask = (1u << kSpzRotationBits) - 1;
  std::uint32_t bits = static_cast<std::uint32_t>(largest);
  for (int k = 0; k < 4; ++k) {
    if (k == largest) continue;
    const bool negative = (xyzw[k] < 0.0) != (xyzw[largest] < 0.0);
    const double magnitude = std::min(std::floor(std::abs(xyzw[k]) * std::sqrt(2.0) * mask + 0.5), mask);
    bits = bits << (kSpzRotationBits + 1) | std::uint32_t{negative} << kSpzRotationBits |
           static_cast<std::uint32_t>(magnitude);
  }
  return bits;
}

Bytes gzip(std::span<const std::uint8_t> bytes) {
  z_stream stream{};
  // The best level makes trained models 0 to 2.3 % smaller in four to seven times the time.
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK) {
    throw std::bad_alloc();
  }
  Bytes packed;
  std::array<std::uint8_t, 1 << 16> piece;
  std::size_t done = 0;
  for (int result = Z_OK; result != Z_STREAM_END;) {
    if (stream.avail_in == 0) {
      const std::size_t next = std::min<std::size_t>(bytes.size() - done, std::numeric_limits<uInt>::max());
      stream.next_in = const_cast<std::uint8_t*>(bytes.data() + done);
      stream.avail_in = static_cast<uInt>(next);
      done += next;
    }
    stream.next_out = piece.data();
    stream.avail_out = static_cast<uInt>(piece.size());
    result = deflate(&stream, done == bytes.size() ? Z_FINISH : Z_NO_FLUSH);
    packed.insert(packed.end(), piece.data(), piece.data() + piece.size() - stream.avail_out);
  }
  deflateEnd(&stream);
  return packed;
}

// One frame with its size at the front and, as gzip has one, a checksum at the end.
Bytes zstandard(std::span<const std::uint8_t> bytes) {
  constexpr int level = 12;  // see docs/lab/converter.md
  const std::unique_ptr<ZSTD_CCtx, std::size_t (*)(ZSTD_CCtx*)> context(ZSTD_createCCtx(), ZSTD_freeCCtx);
  if (!context) throw std::bad_alloc();
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, level);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
  Bytes packed(ZSTD_compressBound(bytes.size()));
  const std::size_t size = ZSTD_compress2(context.get(), packed.data(), packed.size(), bytes.data(), bytes.size());
  if (ZSTD_isError(size)) throw std::bad_alloc();  // with room for the worst case nothing else is left to fail
  packed.resize(size);
  return packed;
}

// Version 4. `start` and `payload` are what version 3 holds in one gzip stream.
Bytes packStreams(const SpzHeader& header, std::span<const std::uint8_t> start, std::span<const std::uint8_t> payload) {
  const std::size_t count = streamsOf(header);
  const Streams streams = split(header, payload);
  std::array<Bytes, kSpzStreams> packed;
  parallelFor(static_cast<std::int64_t>(count), 1, [&](std::int64_t s) { packed[s] = zstandard(streams[s]); });
  Bytes bytes(start.begin(), start.end());
  bytes.back() = static_cast<std::uint8_t>(count);
  appendU32(bytes, kSpz4HeaderBytes);  // where the table begins
  bytes.resize(kSpz4HeaderBytes);
  for (std::size_t s = 0; s < count; ++s) {
    appendU64(bytes, packed[s].size());
    appendU64(bytes, streams[s].size());
  }
  for (const Bytes& stream : packed) bytes.insert(bytes.end(), stream.begin(), stream.end());
  return bytes;
}

}  // namespace

Bundle parseSpz(std::span<const std::uint8_t> bytes, const std::string& path, std::optional<SpzAxes> axes) {
  const Asked asked{path, axes};
  if (bytes.size() >= 2 && bytes[0] == 0x1f && bytes[1] == 0x8b) return parseGzip(bytes, asked);
  if (bytes.size() < kSpzHeaderBytes) throw Error(ErrorKind::badData, path, "SPZ: the file ends inside the header");
  const SpzHeader header = readHeader(bytes, path);
  if (header.version > 3) return parseStreams(header, bytes, asked);
  const std::uint64_t expected = payloadBytes(header);
  if (expected > bytes.size() - kSpzHeaderBytes) {
    throw Error(ErrorKind::badData, path,
                "SPZ: the file is too short for its " + std::to_string(header.count) + " splats (expected " +
                    std::to_string(kSpzHeaderBytes + expected) + " bytes, found " + std::to_string(bytes.size()) + ")");
  }
  const std::span<const std::uint8_t> rest = bytes.subspan(kSpzHeaderBytes + static_cast<std::size_t>(expected));
  checkTrailer(header, rest, path);
  return finish(header, split(header, bytes.subspan(kSpzHeaderBytes)), rest, asked);
}

Bundle readSpz(const std::filesystem::path& path, std::optional<SpzAxes> axes) {
  return parseSpz(readFile(path, kMaxGaussians * kMaxBytesPerSplat + kMaxExtensionBytes), path.string(), axes);
}

Bytes formatSpz(const GaussianModel& model, const std::string& path, SpzReport& report, int version) {
  TG_ASSERT(version == kOldestSpz || version == kNewestSpz, "a version that is written");
  if (model.size() == 0) throw Error(ErrorKind::badData, path, "the model has no Gaussians");
  SpzHeader header;
  header.version = static_cast<std::uint32_t>(version);
  header.count = static_cast<std::uint32_t>(model.size());
  header.sh_degree = model.sh_degree;
  header.fractional_bits = report.fractional_bits = fractionalBits(model, path);
  const std::size_t coefficients = model.shCount();

  Bytes bytes;
  appendU32(bytes, kSpzMagic);
  appendU32(bytes, header.version);
  appendU32(bytes, header.count);
  for (int value : {header.sh_degree, header.fractional_bits, 0, 0}) bytes.push_back(static_cast<std::uint8_t>(value));
  for (const glm::vec3& p : model.mean) {
    for (int k = 0; k < 3; ++k) {
      const double turned = static_cast<double>(p[k]) * kModelFromRub[k];
      const double fixed = std::floor(std::ldexp(turned, header.fractional_bits) + 0.5);
      const auto bits = static_cast<std::int32_t>(std::clamp(fixed, -kLargestFixed, kLargestFixed));
      for (int shift : {0, 8, 16}) bytes.push_back(static_cast<std::uint8_t>(bits >> shift));
    }
  }
  bool inside = false;  // alphas always fit
  for (float logit : model.opacity_logit) {
    bytes.push_back(toByte(sigmoid(logit, 255.0), inside));
  }
  for (std::size_t i = 0; i < model.size(); ++i) {
    bool clipped = false;
    for (int k = 0; k < 3; ++k) {
      bytes.push_back(toByte((model.sh[i * coefficients][k] * double{kSpzColorScale} + 0.5) * 255.0, clipped));
    }
    report.clipped_colors += clipped;
  }
  for (const glm::vec3& log_scale : model.log_scale) {
    bool clipped = false;
    for (int k = 0; k < 3; ++k) {
      bytes.push_back(toByte((static_cast<double>(log_scale[k]) - kSpzLowestScale) / kSpzScaleStep, clipped));
    }
    report.clipped_scales += clipped;
  }
  for (const glm::vec4& rotation : model.rotation) appendU32(bytes, packRotation(turned(rotation, kModelFromRub)));
  const std::array<float, 16> sh_signs = shSigns(kModelFromRub);
  for (std::size_t i = 0; i < model.size() && coefficients > 1; ++i) {
    bool clipped = false;
    for (std::size_t k = 1; k < coefficients; ++k) {
      for (int c = 0; c < 3; ++c) {
        const float coefficient = sh_signs[k] * model.sh[i * coefficients + k][c];
        bytes.push_back(shByte(coefficient, k < 4 ? kSh1Bits : kShRestBits, clipped));
      }
    }
    report.clipped_sh += clipped;
  }
  if (version == kOldestSpz) return gzip(bytes);
  const std::span<const std::uint8_t> whole(bytes);
  return packStreams(header, whole.first(kSpzHeaderBytes), whole.subspan(kSpzHeaderBytes));
}

SpzReport writeSpz(const std::filesystem::path& path, const GaussianModel& model, int version) {
  SpzReport report;
  writeFileAtomically(path, formatSpz(model, path.string(), report, version));
  return report;
}

}  // namespace tg
