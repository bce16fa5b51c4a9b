// SPDX-License-Identifier: Apache-2.0
// Writes a model as GLB or glTF: KHR_gaussian_splatting for everybody, our texture extension inside it (docs/gltf.md).
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "converter/formats/spz.h"
#include "core/model/camera.h"
#include "core/model/model.h"
#include "core/system/names.h"

namespace tg {

class GaussianBlocks;

enum class AtlasFormat {
  png8,   // 8 bits a channel
  png16,  // 16 bits
  exr,    // half floats, with 8-bit PNG beside them for readers without EXR
  webp    // 8 bits a channel, lossless, by EXT_texture_webp
};
constexpr auto namesOf(AtlasFormat) { return enumNames("png8", "png16", "exr", "webp"); }

constexpr float kLeastSteps = 1.0f / 8, kMostSteps = 64;
constexpr float kTextureStep = 1.0f / 32, kLeastTextureStep = 1.0f / 1024, kMostTextureStep = 1.0f / 2;
constexpr double kLeastTargetPsnr = 1, kMostTargetPsnr = 100;  // [dB]

// What a writer is asked for. A format that has no such thing passes over it.
struct WriteOptions {
  bool lean = false;  // without the source numbers of converter/gltf/numbers.h
  AtlasFormat atlas = AtlasFormat::png8;
  // Integers for rotations, opacities and COLOR_0; with meshopt fewer bits for scales and SH; lean.
  bool quantize = false;
  bool meshopt = false;  // EXT_meshopt_compression, which readers must then know
  // Times as wide are the steps of all numbers: of sog (converter/sog/sog.h; without one: 1); of glb, gltf with
  // quantize and meshopt, without COLOR_0, along a Hilbert curve (converter/gltf/attribute_filters.h). kLeastSteps to
  // kMostSteps.
  std::optional<float> steps = {};
  // Between a texture's colours, coarser where they weigh less. sog, and glb, gltf with `steps`: without one
  // kTextureStep. kLeastTextureStep to kMostTextureStep.
  std::optional<float> texture_step = {};
  int spz_version = kNewestSpz;  // spz: or kOldestSpz (converter/formats/spz.h)
  bool replace = true;           // gltf, png: the files beside it where they are there already
  // glb, gltf with textures: what readers without them get, of the same Gaussians; null: their means.
  const GaussianModel* base = nullptr;
  // glb, gltf: where each primitive but the last ends, ascending; some viewers draw one after the other.
  std::vector<std::size_t> parts = {};
  const GaussianBlocks* gaussians = nullptr;  // instead of the model's: untextured ones, read while they are written
};

struct GltfContent {
  const GaussianModel& model;  // the toolchain's axes; without Gaussians where `options.gaussians` are given
  std::span<const Camera> cameras;
  glm::vec3 background{0.0f};
  WriteOptions options = {};
  std::span<const Camera> views = {};  // Bundle's
  bool knows_background = true;        // false: `background` is not written
};

struct GltfReport {
  std::uint64_t output_bytes = 0;
  int atlases = 0;
  int atlas_width = 0;  // [texels]
  int atlas_height = 0;
  std::uint64_t texels = 0;          // in rectangles
  std::uint64_t clipped_texels = 0;  // with a channel outside what the atlas's scale and offset can say
  std::uint64_t clipped_scales = 0;  // Gaussians with a scale that no float holds
  bool dropped_source = false;       // the source numbers did not fit a GLB beside the rest
  // Gaussian j of the file is Gaussian order[j] of the model; empty: theirs are one.
  std::vector<std::uint32_t> order = {};
};

// Same model in, same bytes out. Atomic. Memory beyond the model's: its atlases, not its Gaussians (all of them with
// meshopt). Throws Error(badData) for a model beyond GLB's 4 GiB or the atlas's limits, Error(cannotWrite),
// Error(usage) for meshopt without the library.
GltfReport writeGlb(const std::filesystem::path& path, const GltfContent& content);
// Whether `other` may be one of the files beside NAME.gltf: NAME.bin or NAME_atlas_N*.
bool isBesideGltf(const std::filesystem::path& gltf, const std::filesystem::path& other);
// The same as NAME.gltf with NAME.bin and NAME_atlas_* beside it.
GltfReport writeGltf(const std::filesystem::path& path, const GltfContent& content);
// The textures alone, for programs that know neither glTF nor the bundle: NAME.png and NAME_alpha.png as far as the
// mode has them (NAME_1.png, ... for further atlases), and NAME.json: mode, intersection, extent, atlases with file
// names, scale and offset as in the glTF extension, a rectangle per Gaussian, and `outside` where it is not base.
// content.options.atlas: png8 or png16.
// Throws Error(badData) for a model without textures, Error(usage) for exr and webp.
GltfReport writeAtlas(const std::filesystem::path& path, const GltfContent& content);

}  // namespace tg
