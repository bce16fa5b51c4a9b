// SPDX-License-Identifier: Apache-2.0
// Cells by quantiles of points, cameras by what they see.
#include "training/data/plan_blocks.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <numeric>
#include <optional>
#include <ranges>
#include <string>
#include <system_error>

#include "core/model/fields.h"
#include "core/model/model.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "core/system/random.h"
#include "training/data/write_dataset.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kCountedPoints = 100'000;  // stand for all where views are chosen
constexpr int kMostCells = 4096;
constexpr int kLongestSide = 256;   // of a grid
constexpr double kSeenInside = 50;  // points of the cell: the rule of Hierarchical 3DGS, as the next four
constexpr double kSeenAnywhere = 10;
constexpr double kNearChance = 0.5;
constexpr double kFullShare = 0.5;  // of what a view sees: then it is always chosen
constexpr double kSeamShare = 0.2;  // of the points that a view sees
constexpr double kNearReach = 0.5;  // of a cell's sides
constexpr double kWorking = 2.6;    // times parameters and moments is what training takes (docs/lab/training-speed.md)
constexpr std::size_t kTexelFloats = 4 * 4 * 4;
constexpr double kOpen = std::numeric_limits<double>::infinity();

// A cell, and its sides as far as there are points.
struct GridCell {
  Cell cell;
  glm::dvec2 low, high;
  int column = 0, row = 0;
};

Cell groundOf(const glm::dvec3& up) {
  // Along the axis of the world that is most level: x for the usual ones.
  int level = 0;
  for (int axis = 1; axis < 3; ++axis) {
    if (std::abs(up[axis]) < std::abs(up[level]) - 1e-9) level = axis;
  }
  glm::dvec3 u(0.0);
  u[level] = 1;
  Cell cell;
  cell.u = glm::normalize(u - glm::dot(u, up) * up);
  cell.v = glm::normalize(glm::cross(up, cell.u));
  cell.low = glm::dvec2(-kOpen);
  cell.high = glm::dvec2(kOpen);
  return cell;
}

// Where `count` parts of equally many values are cut: count + 1 bounds, the outer ones those of the values.
std::vector<double> cuts(std::vector<double> values, int count) {
  std::ranges::sort(values);
  std::vector<double> bounds = {values.front()};
  for (int i = 1; i < count; ++i) {
    const std::size_t at = values.size() * static_cast<std::size_t>(i) / static_cast<std::size_t>(count);
    bounds.push_back((values[at - 1] + values[at]) / 2);
  }
  bounds.push_back(values.back());
  return bounds;
}

// Empty where too many points lie at one place.
std::vector<GridCell> makeGrid(const std::vector<glm::dvec2>& points, const Cell& ground, glm::ivec2 grid) {
  const auto coordinate = [&](const std::vector<std::uint32_t>& of, int axis) {
    std::vector<double> values;
    for (const std::uint32_t i : of) values.push_back(points[i][axis]);
    return values;
  };
  const auto ascend = [](const std::vector<double>& bounds) {
    return std::ranges::adjacent_find(bounds, std::greater_equal<>()) == bounds.end();
  };
  std::vector<std::uint32_t> all(points.size());
  std::iota(all.begin(), all.end(), 0u);
  std::vector<GridCell> cells;
  const std::vector<double> columns = cuts(coordinate(all, 0), grid.x);
  if (!ascend(columns)) return {};
  for (int column = 0; column < grid.x; ++column) {
    const double left = column > 0 ? columns[static_cast<std::size_t>(column)] : -kOpen;
    const double right = column + 1 < grid.x ? columns[static_cast<std::size_t>(column) + 1] : kOpen;
    std::vector<std::uint32_t> inside;
    for (const std::uint32_t i : all) {
      if (points[i].x >= left && points[i].x < right) inside.push_back(i);
    }
    if (inside.size() < static_cast<std::size_t>(grid.y)) return {};
    const std::vector<double> rows = cuts(coordinate(inside, 1), grid.y);
    if (!ascend(rows)) return {};
    for (int row = 0; row < grid.y; ++row) {
      GridCell cell{ground,
                    {columns[static_cast<std::size_t>(column)], rows[static_cast<std::size_t>(row)]},
                    {columns[static_cast<std::size_t>(column) + 1], rows[static_cast<std::size_t>(row) + 1]},
                    column,
                    row};
      cell.cell.low = {left, row > 0 ? cell.low.y : -kOpen};
      cell.cell.high = {right, row + 1 < grid.y ? cell.high.y : kOpen};
      cells.push_back(cell);
    }
  }
  return cells;
}

// How many points each view sees in each cell and in all, of a choice of them that stands for all.
struct Sight {
  std::vector<double> all;                  // [views]
  std::vector<std::vector<double>> inside;  // [views][cells]
};
Sight lookAround(const Dataset& dataset, const std::vector<Cell>& cells) {
  const std::size_t count = dataset.points.position.size(), stride = (count + kCountedPoints - 1) / kCountedPoints;
  std::vector<std::uint32_t> counted, cell_of;
  for (std::size_t i = 0; i < count; i += stride) {
    counted.push_back(static_cast<std::uint32_t>(i));
    const glm::dvec3 point(dataset.points.position[i]);
    const auto holds = [&](const Cell& cell) { return cell.contains(point); };
    cell_of.push_back(static_cast<std::uint32_t>(std::ranges::find_if(cells, holds) - cells.begin()));
  }
  Sight sight{std::vector<double>(dataset.views.size()),
              std::vector<std::vector<double>>(dataset.views.size(), std::vector<double>(cells.size()))};
  parallelFor(static_cast<std::int64_t>(dataset.views.size()), 1, [&](std::size_t view) {
    const Camera& camera = dataset.views[view];
    for (std::size_t i = 0; i < counted.size(); ++i) {
      const glm::dvec3 at = cameraFromWorld(camera, glm::dvec3(dataset.points.position[counted[i]]));
      if (!(at.z > 0)) continue;
      const glm::dvec2 pixel = project(camera, at);
      if (!(pixel.x >= 0 && pixel.y >= 0 && pixel.x < camera.size.x && pixel.y < camera.size.y)) continue;
      sight.all[view] += static_cast<double>(stride);
      if (cell_of[i] < cells.size()) sight.inside[view][cell_of[i]] += static_cast<double>(stride);
    }
  });
  return sight;
}

std::vector<std::size_t> chooseViews(const Dataset& dataset, const GridCell& cell, std::size_t index,
                                     const Sight& sight, const BlockOptions& options) {
  std::vector<std::size_t> train, test, others;
  std::vector<std::uint64_t> luck(dataset.views.size());
  const glm::dvec2 reach = kNearReach * (cell.high - cell.low);
  for (std::size_t view = 0; view < dataset.views.size(); ++view) {
    const Camera& camera = dataset.views[view];
    Random random(Random((std::uint64_t{index} << 32) + view).bits());
    const double near_chance = random.uniform(), far_chance = random.uniform();
    luck[view] = random.bits();
    const double seen = sight.inside[view][index], share = seen / std::max(sight.all[view], 1.0);
    const glm::dvec2 at = cell.cell.at(camera.position());
    const bool inside = cell.cell.contains(camera.position());
    const bool near = at.x >= cell.low.x - reach.x && at.x < cell.high.x + reach.x && at.y >= cell.low.y - reach.y &&
                      at.y < cell.high.y + reach.y;
    if (camera.test) {
      if (seen > kSeenInside && (inside || share >= kFullShare)) test.push_back(view);
      continue;
    }
    const bool chosen = (seen > kSeenInside && (inside || (near && near_chance < kNearChance))) ||
                        (seen > kSeenAnywhere && far_chance * kFullShare < share);
    if (chosen) {
      train.push_back(view);
    } else if (seen > 0) {
      others.push_back(view);
    }
  }
  std::ranges::stable_sort(
      others, [&](std::size_t a, std::size_t b) { return sight.inside[a][index] > sight.inside[b][index]; });
  for (std::size_t i = 0; i < others.size() && train.size() < options.least; ++i) train.push_back(others[i]);
  if (train.size() > options.most) {
    std::ranges::sort(train,
                      [&](std::size_t a, std::size_t b) { return std::pair(luck[a], a) < std::pair(luck[b], b); });
    train.resize(options.most);
  }
  train.insert(train.end(), test.begin(), test.end());
  std::ranges::sort(train);
  return train;
}

std::uint64_t trainingMemory(std::size_t gaussians, std::uint64_t photographs, const BlockOptions& options) {
  const auto bytes = [](std::size_t count, std::size_t floats) {
    const double numbers = 3.0 * static_cast<double>(floats * sizeof(float));  // a parameter and two moments
    return static_cast<std::uint64_t>(kWorking * numbers * static_cast<double>(count));
  };
  if (options.memory > 0) photographs = std::min(photographs, imageMemoryOf(options.memory));
  const std::size_t floats = gaussianFloats(shCountOf(3));
  const std::size_t grown = options.grown ? options.grown(gaussians) : gaussians;
  return std::max(bytes(gaussians, floats + kTexelFloats), bytes(grown, floats)) + photographs;
}

std::uint64_t photographBytes(const Dataset& dataset, const std::vector<std::size_t>& views) {
  std::uint64_t bytes = 0;
  for (const std::size_t view : views) {
    bytes += 3 * static_cast<std::uint64_t>(dataset.views[view].size.x) *
             static_cast<std::uint64_t>(dataset.views[view].size.y);
  }
  return bytes;
}

// Points in the padded cells, and what follows from their number.
std::vector<PlannedBlock> blocksOf(const std::vector<GridCell>& cells, const std::vector<glm::dvec2>& places,
                                   std::size_t gaussians, const BlockOptions& options) {
  std::vector<PlannedBlock> plan(cells.size());
  parallelFor(static_cast<std::int64_t>(cells.size()), 1, [&](std::size_t i) {
    PlannedBlock& planned = plan[i];
    SceneBlock& block = planned.block;
    block.name = "block_" + std::to_string(cells[i].column) + "_" + std::to_string(cells[i].row);
    block.cell = cells[i].cell;
    const glm::dvec2 sides = cells[i].high - cells[i].low;
    block.padding = options.padding * std::max(sides.x, sides.y);
    const Cell wide = block.cell.padded(block.padding);
    for (std::uint32_t p = 0; p < places.size(); ++p) {
      const glm::dvec2 at = places[p];
      if (at.x >= wide.low.x && at.x < wide.high.x && at.y >= wide.low.y && at.y < wide.high.y) {
        planned.points.push_back(p);
      }
    }
    const double share = static_cast<double>(planned.points.size()) / static_cast<double>(places.size());
    planned.gaussians =
        std::max<std::size_t>(1, static_cast<std::size_t>(std::llround(share * static_cast<double>(gaussians))));
  });
  return plan;
}

}  // namespace

std::string memoryText(std::uint64_t bytes, bool up) {
  if (bytes < 1000) return std::to_string(bytes) + " bytes";
  const bool tiny = bytes < 100'000, small = bytes < 100'000'000;
  const double digits = static_cast<double>(bytes) / (tiny    ? 1e2
                                                      : small ? 1e5
                                                              : 1e7),
               whole = up ? std::ceil(digits) : std::floor(digits);
  char text[32];
  std::snprintf(text, sizeof text, tiny ? "%.1f KB" : small ? "%.1f MB" : "%.2f GB", whole / (small ? 10 : 100));
  return text;
}

glm::dvec3 upOfPoints(const PointCloud& points) {
  glm::dvec3 spread(0.0);
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<float> values;
    for (const glm::vec3& point : points.position) values.push_back(point[axis]);
    if (values.empty()) break;
    std::ranges::sort(values);
    spread[axis] = double{values[values.size() * 9 / 10]} - double{values[values.size() / 10]};
  }
  glm::dvec3 up(0.0);
  up[spread.x <= spread.y && spread.x <= spread.z ? 0 : spread.y <= spread.z ? 1 : 2] = 1;
  return up;
}

std::vector<PlannedBlock> planBlocks(const Dataset& dataset, const glm::dvec3& up, const BlockOptions& options) {
  const std::size_t count = dataset.points.position.size();
  if (count == 0) throw Error(ErrorKind::badData, dataset.name, "has no points, which blocks are cut by");
  const Cell ground = groundOf(up);
  std::vector<glm::dvec2> places;
  for (const glm::vec3& point : dataset.points.position) places.push_back(ground.at(glm::dvec3(point)));
  const std::size_t gaussians = options.gaussians > 0 ? options.gaussians : count;
  std::uint64_t largest_view = 0;
  for (std::size_t view = 0; view < dataset.views.size(); ++view) {
    largest_view = std::max(largest_view, photographBytes(dataset, {view}));
  }

  std::vector<GridCell> cells;
  std::vector<PlannedBlock> plan;
  const auto plan_of = [&](glm::ivec2 grid) {
    cells = makeGrid(places, ground, grid);
    plan = blocksOf(cells, places, gaussians, options);
  };
  const std::vector<GridCell> whole = makeGrid(places, ground, {1, 1});
  if (whole.empty()) throw Error(ErrorKind::badData, dataset.name, "its points lie on a line or at one place");
  if (options.grid.x > 0) {
    const std::size_t wanted = static_cast<std::size_t>(options.grid.x) * static_cast<std::size_t>(options.grid.y);
    if (wanted > count) {
      throw Error(ErrorKind::usage, "--blocks: more cells than points" + atMost(count, wanted));
    }
    plan_of(options.grid);
    if (cells.empty()) {
      throw Error(ErrorKind::badData, dataset.name,
                  "too many points lie at one place for so many cells (expected a coarser grid)");
    }
  } else {
    const glm::dvec2 sides = whole.front().high - whole.front().low;
    const double aspect = sides.x / sides.y;
    const std::uint64_t photographs = largest_view * std::min(options.most, dataset.views.size());
    // What is the least with which a block fits: all its photographs, or as many as imageMemoryOf() it allows.
    const auto needed = [&](const PlannedBlock& block) {
      const std::uint64_t numbers = trainingMemory(block.gaussians, 0, options);
      return std::min(numbers + photographs, numbers + numbers / 3 + 1);
    };
    std::optional<std::uint64_t> least;
    bool fits = false;
    for (int number = 1; number <= kMostCells && !fits; ++number) {
      const int columns = std::clamp(static_cast<int>(std::lround(std::sqrt(number * aspect))), 1, kLongestSide);
      const int rows = (number + columns - 1) / columns;
      if (rows > kLongestSide || static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows) > count) break;
      if (!cells.empty() && columns * rows == static_cast<int>(cells.size())) continue;
      plan_of({columns, rows});
      if (cells.empty()) break;
      const std::uint64_t most = std::ranges::max(plan | std::views::transform(needed));
      least = std::min(least.value_or(most), most);
      fits = most <= options.memory;
    }
    if (!fits) {
      throw Error(ErrorKind::usage, "--memory: no grid of blocks fits into it" +
                                        expectedFound(least ? "at least " + memoryText(*least) : "more",
                                                      memoryText(options.memory, false)));
    }
  }

  std::vector<Cell> bare;
  for (const GridCell& cell : cells) bare.push_back(cell.cell);
  const Sight sight = lookAround(dataset, bare);
  for (std::size_t i = 0; i < plan.size(); ++i) {
    PlannedBlock& block = plan[i];
    block.views = chooseViews(dataset, cells[i], i, sight, options);
    const auto trains = [&](std::size_t view) { return !dataset.views[view].test; };
    block.train_views = static_cast<std::size_t>(std::ranges::count_if(block.views, trains));
    if (block.train_views == 0) {
      throw Error(ErrorKind::badData, dataset.name,
                  block.block.name + " has no cameras: no training view sees its points (expected a coarser grid)");
    }
    block.memory = trainingMemory(block.gaussians, photographBytes(dataset, block.views), options);
  }
  return plan;
}

std::vector<bool> viewsAtSeams(const Dataset& dataset, std::span<const SceneBlock> blocks) {
  std::vector<Cell> cells;
  for (const SceneBlock& block : blocks) cells.push_back(block.cell);
  const Sight sight = lookAround(dataset, cells);
  std::vector<bool> at_seams;
  for (std::size_t view = 0; view < dataset.views.size(); ++view) {
    const double most = *std::ranges::max_element(sight.inside[view]);
    at_seams.push_back(most < (1 - kSeamShare) * sight.all[view]);
  }
  return at_seams;
}

void writePlan(const fs::path& folder, const fs::path& whole, const Dataset& dataset,
               std::span<const PlannedBlock> plan) {
  std::error_code error;
  const auto refuse = [&](const fs::path& path, const std::string& problem) {
    throw Error(ErrorKind::cannotWrite, path.string(), problem);
  };
  const bool made = fs::create_directory(folder, error);
  if (error) refuse(folder, "cannot make this folder: " + error.message());
  if (!made && !fs::is_empty(folder, error)) refuse(folder, "exists already, and is not empty");
  try {
    std::vector<SceneBlock> blocks;
    for (const PlannedBlock& planned : plan) {
      const fs::path place = folder / planned.block.name;
      fs::create_directory(place, error);
      if (error) refuse(place, "cannot make this folder: " + error.message());
      BlockFile file{planned.block,
                     fs::proximate(fs::absolute(whole), fs::absolute(place)).string(),
                     std::string(name(dataset.layout)),
                     {}};
      for (const std::size_t view : planned.views) file.views.push_back(dataset.files[view]);
      PointCloud points;
      for (const std::uint32_t i : planned.points) {
        points.position.push_back(dataset.points.position[i]);
        points.color.push_back(dataset.points.color[i]);
      }
      writePoints(place / "points3d.ply", points);
      writeBlock(place, file);
      blocks.push_back(planned.block);
    }
    writeBlocks(folder, blocks);
  } catch (...) {
    for (const PlannedBlock& planned : plan) fs::remove_all(folder / planned.block.name, error);
    if (made) fs::remove(folder, error);
    throw;
  }
}

}  // namespace tg
