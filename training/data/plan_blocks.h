// SPDX-License-Identifier: Apache-2.0
// Which part of a scene each block trains: cells of the ground, the cameras that see them, and what that takes.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/bundle/blocks.h"
#include "training/data/dataset.h"

namespace tg {

struct BlockOptions {
  glm::ivec2 grid{0};         // columns and rows of cells; 0: as few as `memory` allows
  std::uint64_t memory = 0;   // [bytes] of a training; 0: any
  std::size_t gaussians = 0;  // of the whole scene; 0: as many as it has points
  double padding = 0.2;       // of a cell's sides
  std::size_t least = 100;    // training views of a block, where so many see it
  std::size_t most = 1500;    // training views of a block
  // Most Gaussians that a training of so many textured ones has before it has textures; none: as many.
  std::function<std::size_t(std::size_t)> grown{};
};

struct PlannedBlock {
  SceneBlock block;
  std::vector<std::size_t> views;     // of the data set, ascending
  std::size_t train_views = 0;        // of them
  std::vector<std::uint32_t> points;  // in the padded cell, ascending
  std::size_t gaussians = 0;          // the padded cell's share by points
  // [bytes] that training takes, by estimate: 4 x 4 RGBA textures and SH degree 3, or what grows before
  std::uint64_t memory = 0;
};

// The share of `memory` that photographs may take; what is beyond is read when it is needed.
constexpr std::uint64_t imageMemoryOf(std::uint64_t memory) { return memory / 4; }

// Rounded up or down: "12.3 KB", from 0.1 MB on "12.3 MB", from 0.1 GB on "7.11 GB".
std::string memoryText(std::uint64_t bytes, bool up = true);

// Columns have equally many points, and so have the cells of each. Cameras as in Hierarchical 3DGS (Kerbl et al. 2024):
// those in a cell that see more than 50 of its points, half of those in the cell grown by half its sides, others by
// the share of its points in what they see; filled up to `least` with those that see most, and thinned to `most` by
// chance. Points count as seen where they lie in the picture, hidden or not, and 100,000 of them stand for all.
// Held-out views belong to the blocks that they stand in or see half of their points in. `up`: a unit vector. The same
// data set and options, the same blocks. Throws Error(usage) for more cells than points and for memory that no grid
// fits into, Error(badData) without points, and where no training view sees a block.
std::vector<PlannedBlock> planBlocks(const Dataset& dataset, const glm::dvec3& up, const BlockOptions& options);

// Where cameras do not say which way is up: the axis along which points spread least.
glm::dvec3 upOfPoints(const PointCloud& points);

// Of each view: whether more than a fifth of the points that it sees lie in other cells than the one of most of them.
// [views]
std::vector<bool> viewsAtSeams(const Dataset& dataset, std::span<const SceneBlock> blocks);

// A folder a block, with block.json and points3d.ply, then blocks.json. `whole`: the data set's folder. On an error
// what was written is removed. Throws Error(cannotWrite), also where `folder` holds anything.
void writePlan(const std::filesystem::path& folder, const std::filesystem::path& whole, const Dataset& dataset,
               std::span<const PlannedBlock> plan);

}  // namespace tg
