// SPDX-License-Identifier: Apache-2.0
// Textures that several Gaussians share, texel for texel: what a file then holds once.
#pragma once
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/model/model.h"

namespace tg {

constexpr std::size_t kMostSharedTextures = 65536;  // textures that a model's Gaussians share
// shareTextures()'s for files (docs/lab/quality.md, "Textures that Gaussians share").
constexpr double kBitCost = 0.03;

// [N] The same number for Gaussians whose textures are equal in size and every texel, from 0 in the order of the first
// Gaussian of each; those without a texture have one of their own.
std::vector<std::uint32_t> textureGroups(const TextureAtlas& atlas);

// The first Gaussian of each group.
std::vector<std::uint32_t> firstOfGroups(std::span<const std::uint32_t> groups);
// Whether at least two Gaussians share a texture, in the mean of those that have one, and not more textures are
// different than kMostSharedTextures: what files hold once. groups: textureGroups().
bool areShared(const TextureAtlas& atlas, std::span<const std::uint32_t> groups);

// Each group's texture once, that of its first Gaussian, where the rectangles of the whole group lie; in groups' order.
TextureAtlas heldOnce(const TextureAtlas& atlas, std::span<const std::uint32_t> groups);
// For what only reads: that of textureGroups(), or nothing where they are not areShared().
std::optional<TextureAtlas> heldOnce(const TextureAtlas& atlas);

// What shareTextures() shares: squares of one size, of all Gaussians, or none at all. Throws Error(usage) for others.
void requireShareable(const TextureAtlas& atlas);
// Leaves at most `entries` (1 to kMostSharedTextures) different textures, by k-means over those that there are: squared
// distances weighted with each texel's share in a texture's mean (core/model/atlas.h) and with [N] `weights` >= 0 of
// the Gaussians. A texture lies on its Gaussian in eight ways, by the signs and the order of its axes, which change
// nothing else: Gaussians are turned to the way that is nearest. `bit_cost` >= 0: each bit that a file needs to say
// which texture a Gaussian has and how it lies, by how many others have the same, counts as that part of what a texture
// changes in the mean of all Gaussians. The same seed gives the same result, with any number of threads. False, with
// the model as it was, where `stop` was set meanwhile, which may be null. Throws what requireShareable() throws.
bool shareTextures(GaussianModel& model, std::size_t entries, std::span<const double> weights, double bit_cost,
                   std::uint64_t seed, const std::atomic<bool>* stop = nullptr);

}  // namespace tg
