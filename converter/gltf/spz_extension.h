// SPDX-License-Identifier: Apache-2.0
// KHR_gaussian_splatting_compression_spz_2 (draft): a primitive whose splats are an SPZ file in a buffer view.
#pragma once
#include <string_view>

#include "converter/gltf/accessor.h"
#include "core/model/model.h"

namespace tg {

inline constexpr std::string_view kSpzExtension = "KHR_gaussian_splatting_compression_spz_2";

// The extension's object inside `splatting`, the Khronos extension's; null where there is none.
const tinygltf::Value* findSpzExtension(const tinygltf::Value& splatting);

// The splats in glTF's axes (rotations w, x, y, z): SPZ's x right, y up, z backward turned half around y, as the draft
// asks for. `splats.count` is POSITION's. Throws Error(badData) at a JSON pointer for a view that is not there, for
// what is no SPZ, and where the counts differ. The document names the primitive's view; `extension`: null where the
// library has dropped it.
GaussianModel readSpzPrimitive(GltfDocument& document, const SplatPrimitive& splats, const tinygltf::Value* extension);

}  // namespace tg
