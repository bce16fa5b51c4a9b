// SPDX-License-Identifier: Apache-2.0
// SOG version 2, bundled: a ZIP archive of meta.json and lossless WebP images, a pixel of each a Gaussian, and our
// textures beside them (docs/sog.md).
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "converter/gltf/write_gltf.h"
#include "converter/sog/zip.h"
#include "core/bundle/bundle.h"

namespace tg {

// The numbers as stored: those of the PLY the file was made from (docs/formats.md). base_only: what other readers show.
// Throws Error(cannotRead / badData).
Bundle readSog(const std::filesystem::path& path, bool base_only = false);
Bundle parseSog(std::span<const std::uint8_t> bytes, const std::string& path, bool base_only = false);

// The bytes of a file of a SOG by its name, meta.json first, at most so many. Throws Error.
using SogFiles = std::function<std::vector<std::uint8_t>(const std::string& name, std::uint64_t most)>;
// Of a SOG that is not bundled: of at most `most` Gaussians. `path`, of meta.json, starts messages.
Bundle parseSogFiles(const SogFiles& files, const std::string& path, std::uint64_t most, bool base_only = false);

struct SogOptions {
  // So many times as wide are the steps of SH and texels, and those of positions, opacities, rotations and scales as
  // far as they are more than what all their bits give (docs/sog.md). kLeastSteps to kMostSteps.
  float steps = 1;
  // Of the colours in a texture's middle, where a Gaussian is opaque; elsewhere they may be coarser as they weigh less.
  float texture_step = kTextureStep;
};

struct SogReport {
  std::uint64_t texels = 0;          // that are stored, those of shared textures once for each Gaussian; 0: no textures
  std::uint64_t clipped_texels = 0;  // of them, how many are further from neutral than the widest steps reach
};

// Along a Hilbert curve, in the order that is returned: Gaussian j of the file is Gaussian order[j] of the model. Axes
// of Gaussians without a texture may come back renamed (core/model/equivalent_axes.h). Textured models keep their
// textures but for those that the steps leave nothing of, which come back as what stands in for them; the base that
// other readers show is bakeFallback's. Same model in, same bytes out. Atomic. Throws Error(cannotWrite),
// Error(badData) for a texture of more than 255 texels a side and for more Gaussians or texels than images of 16383
// pixels a side hold. `report` may be null.
std::vector<std::uint32_t> writeSog(const std::filesystem::path& path, const GaussianModel& model,
                                    const SogOptions& options = {}, SogReport* report = nullptr);
// meta.json and the images, Gaussians in the model's order: what an archive or a folder holds. `path` starts messages.
// Throws as writeSog.
std::vector<ZipEntry> sogFiles(GaussianModel model, const std::string& path, const SogOptions& options = {},
                               SogReport* report = nullptr);
// How far apart coordinates near x are in such a file, if those of all its Gaussians reach from low to high [world
// units].
double sogStep(double low, double high, double x);

}  // namespace tg
