// SPDX-License-Identifier: Apache-2.0
// EXT_meshopt_compression by way of libmeshoptimizer.
#include "converter/gltf/meshopt.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/shortened.h"

#ifdef TG_MESHOPT
#include <meshoptimizer.h>
#endif

namespace tg {

std::string_view missingMeshopt() {
  return "this program was built without libmeshoptimizer (Debian: libmeshoptimizer-dev)";
}

namespace {

constexpr int kMantissaBits = 24;  // of the filter, with its sign

// Of the steps that a number has: wider where the mantissa has too few bits for it.
int exponentOf(double number, int exponent) {
  return number == 0 ? exponent : std::max(exponent, std::ilogb(number) + 3 - kMantissaBits);
}

}  // namespace

void roundToSteps(std::span<std::uint8_t> floats, int exponent) {
  for (std::size_t at = 0; at < floats.size(); at += sizeof(float)) {
    float number;
    std::memcpy(&number, floats.data() + at, sizeof(number));
    const int own = exponentOf(number, exponent);
    const double most = std::ldexp(1.0, std::numeric_limits<float>::max_exponent - own) - 1;  // that a float holds
    const double wanted = std::nearbyint(std::ldexp(static_cast<double>(number), -own));
    const double whole = std::clamp(wanted, -most, most) + 0.0;  // the filter has one zero
    number = static_cast<float>(std::ldexp(whole, own));
    std::memcpy(floats.data() + at, &number, sizeof(number));
  }
}

#ifdef TG_MESHOPT

namespace {

// The codec packs each byte of an element by its difference from the element before. Numbers of few bits therefore
// stand in the mantissa's highest bytes: below them are zeros, and no byte is a mere sign, which would cost 2 bits.
void encodeFixed(std::uint8_t* to, std::span<const std::uint8_t> floats, int exponent) {
  struct Number {
    std::int32_t whole;
    int exponent;
  };
  std::vector<Number> numbers(floats.size() / sizeof(float));
  std::int32_t most = 0;  // of those that have no exponent of their own
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    float number;
    std::memcpy(&number, floats.data() + i * sizeof(number), sizeof(number));
    const int own = exponentOf(number, exponent);
    const auto whole = static_cast<std::int32_t>(std::lround(std::ldexp(static_cast<double>(number), -own)));
    if (own == exponent) most = std::max(most, whole < 0 ? -(whole + 1) : whole);
    numbers[i] = {whole, own};
  }
  int common = 0;
  while (common + 8 < kMantissaBits && most < 1 << (kMantissaBits - 9 - common)) common += 8;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const int shift = numbers[i].exponent == exponent ? common : 0;
    const std::uint32_t mantissa = static_cast<std::uint32_t>(numbers[i].whole) << shift;
    const std::uint32_t word =
        static_cast<std::uint32_t>(numbers[i].exponent - shift) << kMantissaBits | (mantissa & 0xFFFFFFu);
    std::memcpy(to + i * sizeof(word), &word, sizeof(word));
  }
}

// The same of quaternions, whose numbers all have 16 bits for the filter: multiples of 2^(16 - bits) of its unit.
void roundComponents(std::span<std::uint8_t> elements, int bits) {
  const int unit = 1 << (16 - bits), most = 32767 / unit * unit;
  for (std::size_t at = 0; at < elements.size(); at += 8) {
    std::int16_t components[3];  // the fourth says which one is left out
    std::memcpy(components, elements.data() + at, sizeof(components));
    for (std::int16_t& c : components) {
      c = static_cast<std::int16_t>(
          std::clamp(static_cast<int>(std::lround(c / static_cast<double>(unit))) * unit, -most, most));
    }
    std::memcpy(elements.data() + at, components, sizeof(components));
  }
}

constexpr unsigned kVertexStream = 0xA0, kTriangleStream = 0xE0, kIndexStream = 0xD0;  // the first byte, and a version
constexpr unsigned kVertexVersion = MESHOPTIMIZER_VERSION >= 230 ? 1 : 0, kIndexVersion = 1;  // that the library knows

// Why the library does not take a stream.
std::string refusalOf(std::span<const std::uint8_t> stream, unsigned kind, unsigned known) {
  const unsigned first = stream.empty() ? 0u : stream[0], version = first & 0xF;
  if ((first & 0xF0) != kind || version <= known) return "the packed stream is broken";
  return "the packed stream is of version " + std::to_string(version) + ", which libmeshoptimizer " +
         std::to_string(MESHOPTIMIZER_VERSION / 1000) + "." + std::to_string(MESHOPTIMIZER_VERSION % 1000 / 10) +
         " of this program does not know (expected at most " + std::to_string(known) + ")";
}

// An exponent for every float.
void encodeSingleFloats(void* to, std::size_t count, int bits, const float* from) {
#if MESHOPTIMIZER_VERSION >= 200
  meshopt_encodeFilterExp(to, count, sizeof(float), bits, from, meshopt_EncodeExpSeparate);
#else
  meshopt_encodeFilterExp(to, count, sizeof(float), bits, from);
#endif
}

}  // namespace

bool hasMeshopt() { return true; }

FilteredView filterForMeshopt(std::vector<std::uint8_t> bytes, std::size_t stride, const MeshoptFilter& filter) {
  TG_ASSERT(stride > 0 && bytes.size() % stride == 0, "the elements fill the bytes");
  if (filter.kind == MeshoptFilter::Kind::none) return {std::move(bytes), stride, "NONE"};
  const std::size_t count = bytes.size() / stride;
  const auto* floats = reinterpret_cast<const float*>(bytes.data());
  FilteredView view{{}, stride, "EXPONENTIAL"};
  if (filter.kind == MeshoptFilter::Kind::quaternion) {
    view.stride = 4 * sizeof(std::int16_t);
    view.filter = "QUATERNION";
    view.bytes.resize(count * view.stride);
    meshopt_encodeFilterQuat(view.bytes.data(), count, view.stride, filter.rounded ? 16 : filter.bits, floats);
    if (filter.rounded) roundComponents(view.bytes, filter.bits);
  } else if (filter.kind == MeshoptFilter::Kind::exponential) {
    // A power of 2 that no rounding of a mantissa makes infinite.
    std::vector<float> within(floats, floats + bytes.size() / sizeof(float));
    for (float& number : within) number = std::clamp(number, -0x1p127f, 0x1p127f);
    view.bytes.resize(bytes.size());
    encodeSingleFloats(view.bytes.data(), within.size(), filter.bits, within.data());
  } else {
    view.bytes.resize(bytes.size());
    encodeFixed(view.bytes.data(), bytes, filter.exponent);
  }
  return view;
}

std::vector<std::uint8_t> packMeshopt(std::span<const std::uint8_t> elements, std::size_t stride) {
  TG_ASSERT(stride % 4 == 0 && stride > 0 && stride <= 256, "strides are multiples of 4, up to 256");
  TG_ASSERT(elements.size() % stride == 0, "the elements fill the bytes");
  const std::size_t count = elements.size() / stride;
  meshopt_encodeVertexVersion(0);  // what the extension knows
  std::vector<std::uint8_t> packed(meshopt_encodeVertexBufferBound(count, stride));
  packed.resize(meshopt_encodeVertexBuffer(packed.data(), packed.size(), elements.data(), count, stride));
  return packed;
}

std::vector<std::uint8_t> unpackMeshopt(std::span<const std::uint8_t> bytes, std::size_t count, std::size_t stride,
                                        std::string_view mode, std::string_view filter, const std::string& path) {
  const auto fail = [&](const std::string& what) -> Error { return Error(ErrorKind::badData, path, shortened(what)); };
  const auto quoted = [](std::string_view text) { return "\"" + std::string(text) + "\""; };
  const auto wrongStride = [&](const std::string& of, const std::string& expected) -> Error {
    return fail("wrong \"byteStride\"" + of + expectedFound(expected, std::to_string(stride)));
  };
  if (mode == "TRIANGLES" || mode == "INDICES") {  // of a mesh beside the splats
    if (stride != 2 && stride != 4) throw wrongStride(" of indices", "2 or 4");
    if (mode == "TRIANGLES" && count % 3 != 0) {
      throw fail("wrong \"count\" of triangles' indices" + expectedFound("a multiple of 3", std::to_string(count)));
    }
    if (filter != "NONE") throw fail("a filter of indices" + expectedFound("\"NONE\"", quoted(filter)));
    std::vector<std::uint8_t> indices(count * stride);
    const int code = mode == "TRIANGLES"
                         ? meshopt_decodeIndexBuffer(indices.data(), count, stride, bytes.data(), bytes.size())
                         : meshopt_decodeIndexSequence(indices.data(), count, stride, bytes.data(), bytes.size());
    if (code != 0) {
      throw fail(refusalOf(bytes, mode == "TRIANGLES" ? kTriangleStream : kIndexStream, kIndexVersion));
    }
    return indices;
  }
  if (mode != "ATTRIBUTES") {
    throw fail("unknown \"mode\"" + expectedFound("\"ATTRIBUTES\", \"TRIANGLES\" or \"INDICES\"", quoted(mode)));
  }
  if (stride == 0 || stride % 4 != 0 || stride > 256) throw wrongStride("", "a multiple of 4 up to 256");
  std::vector<std::uint8_t> out(count * stride);
  if (meshopt_decodeVertexBuffer(out.data(), count, stride, bytes.data(), bytes.size()) != 0) {
    throw fail(refusalOf(bytes, kVertexStream, kVertexVersion));
  }
  if (filter == "OCTAHEDRAL") {
    if (stride != 4 && stride != 8) throw wrongStride(" for the filter", "4 or 8");
    meshopt_decodeFilterOct(out.data(), count, stride);
  } else if (filter == "QUATERNION") {
    if (stride != 8) throw wrongStride(" for the filter", "8");
    meshopt_decodeFilterQuat(out.data(), count, stride);
  } else if (filter == "EXPONENTIAL") {
    meshopt_decodeFilterExp(out.data(), count, stride);
  } else if (filter != "NONE") {
    constexpr const char* kFilters = "NONE, OCTAHEDRAL, QUATERNION or EXPONENTIAL";
    if (filter == "COLOR") throw fail(std::string("the filter COLOR is not supported (expected ") + kFilters + ")");
    throw fail("unknown \"filter\"" + expectedFound(kFilters, quoted(filter)));
  }
  return out;
}

#else

bool hasMeshopt() { return false; }

FilteredView filterForMeshopt(std::vector<std::uint8_t>, std::size_t, const MeshoptFilter&) {
  throw Error(ErrorKind::usage, std::string(missingMeshopt()));
}

std::vector<std::uint8_t> packMeshopt(std::span<const std::uint8_t>, std::size_t) {
  throw Error(ErrorKind::usage, std::string(missingMeshopt()));
}

std::vector<std::uint8_t> unpackMeshopt(std::span<const std::uint8_t>, std::size_t, std::size_t, std::string_view,
                                        std::string_view, const std::string& path) {
  throw Error(ErrorKind::badData, path, "is packed with meshopt, and " + std::string(missingMeshopt()));
}

#endif

}  // namespace tg
