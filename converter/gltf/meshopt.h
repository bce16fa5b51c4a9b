// SPDX-License-Identifier: Apache-2.0
// EXT_meshopt_compression by way of libmeshoptimizer, which the build may lack.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "converter/gltf/builder.h"

namespace tg {

bool hasMeshopt();
// "built without libmeshoptimizer ..."
std::string_view missingMeshopt();

// Finite floats to the nearest multiples of 2^exponent, which the filter `fixed` keeps; those that its mantissa has too
// few bits for, to multiples of larger powers of 2, each of its own.
void roundToSteps(std::span<std::uint8_t> floats, int exponent);

// What a view holds in the extension's words, before the codec.
struct FilteredView {
  std::vector<std::uint8_t> bytes;
  std::size_t stride = 0;  // of an element
  std::string_view filter;
};
// `bytes`: elements of `stride` bytes each. With a filter they are floats: 4 a quaternion x y z w (that become 4
// normalised shorts), or any number of them; with `fixed` rounded already. Throws Error(usage) without the library.
FilteredView filterForMeshopt(std::vector<std::uint8_t> bytes, std::size_t stride, const MeshoptFilter& filter);
// Elements of `stride` (a multiple of 4, at most 256) bytes each, packed. Throws likewise.
std::vector<std::uint8_t> packMeshopt(std::span<const std::uint8_t> elements, std::size_t stride);

// The unpacked view, [count * stride]. `mode` and `filter` as the extension spells them. Throws Error(badData, path,
// ...) for a stream that is broken, a mode or filter that does not exist, and without the library. The caller bounds
// count * stride.
std::vector<std::uint8_t> unpackMeshopt(std::span<const std::uint8_t> bytes, std::size_t count, std::size_t stride,
                                        std::string_view mode, std::string_view filter, const std::string& path);

}  // namespace tg
