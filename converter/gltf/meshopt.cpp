// SPDX-License-Identifier: Apache-2.0
// EXT_meshopt_compression by way of libmeshoptimizer.
#include "converter/gltf/meshopt.h"

#include "core/system/assert.h"
#include "core/system/error.h"

#ifdef TG_MESHOPT
#include <meshoptimizer.h>
#endif

namespace tg {

std::string_view missingMeshopt() {
  return "this program was built without libmeshoptimizer (Debian: libmeshoptimizer-dev)";
}

#ifdef TG_MESHOPT

namespace {

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

PackedView packMeshopt(std::span<const std::uint8_t> bytes, std::size_t count, std::size_t stride,
                       const MeshoptFilter& filter) {
  TG_ASSERT(stride % 4 == 0 && stride > 0 && stride <= 256, "strides are multiples of 4, up to 256");
  TG_ASSERT(bytes.size() == count * stride, "the elements fill the bytes");
  PackedView packed;
  packed.stride = stride;
  std::vector<std::uint8_t> filtered;
  std::span<const std::uint8_t> from = bytes;
  const auto* floats = reinterpret_cast<const float*>(bytes.data());
  if (filter.kind == MeshoptFilter::Kind::quaternion) {
    packed.stride = 4 * sizeof(std::int16_t);
    filtered.resize(count * packed.stride);
    meshopt_encodeFilterQuat(filtered.data(), count, packed.stride, filter.bits, floats);
    from = filtered;
  } else if (filter.kind == MeshoptFilter::Kind::exponential) {
    filtered.resize(count * stride);
    encodeSingleFloats(filtered.data(), count * stride / sizeof(float), filter.bits, floats);
    from = filtered;
  }
  meshopt_encodeVertexVersion(0);  // what the extension knows
  packed.bytes.resize(meshopt_encodeVertexBufferBound(count, packed.stride));
  packed.bytes.resize(
      meshopt_encodeVertexBuffer(packed.bytes.data(), packed.bytes.size(), from.data(), count, packed.stride));
  return packed;
}

std::vector<std::uint8_t> unpackMeshopt(std::span<const std::uint8_t> bytes, std::size_t count, std::size_t stride,
                                        std::string_view mode, std::string_view filter, const std::string& path) {
  const auto fail = [&](const std::string& what) -> Error { return Error(ErrorKind::badData, path, what); };
  if (mode != "ATTRIBUTES") throw fail("wrong \"mode\" for an attribute (expected \"ATTRIBUTES\")");
  if (stride == 0 || stride % 4 != 0 || stride > 256) {
    throw fail("wrong \"byteStride\" (expected a multiple of 4 up to 256)");
  }
  std::vector<std::uint8_t> out(count * stride);
  if (meshopt_decodeVertexBuffer(out.data(), count, stride, bytes.data(), bytes.size()) != 0) {
    throw fail("the packed stream is broken");
  }
  if (filter == "OCTAHEDRAL") {
    if (stride != 4 && stride != 8) throw fail("wrong \"byteStride\" for the filter (expected 4 or 8)");
    meshopt_decodeFilterOct(out.data(), count, stride);
  } else if (filter == "QUATERNION") {
    if (stride != 8) throw fail("wrong \"byteStride\" for the filter (expected 8)");
    meshopt_decodeFilterQuat(out.data(), count, stride);
  } else if (filter == "EXPONENTIAL") {
    meshopt_decodeFilterExp(out.data(), count, stride);
  } else if (filter != "NONE") {
    throw fail("unknown \"filter\" (expected NONE, OCTAHEDRAL, QUATERNION or EXPONENTIAL)");
  }
  return out;
}

#else

bool hasMeshopt() { return false; }

PackedView packMeshopt(std::span<const std::uint8_t>, std::size_t, std::size_t, const MeshoptFilter&) {
  throw Error(ErrorKind::usage, std::string(missingMeshopt()));
}

std::vector<std::uint8_t> unpackMeshopt(std::span<const std::uint8_t>, std::size_t, std::size_t, std::string_view,
                                        std::string_view, const std::string& path) {
  throw Error(ErrorKind::badData, path, "is packed with meshopt, and " + std::string(missingMeshopt()));
}

#endif

}  // namespace tg
