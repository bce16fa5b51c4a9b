// SPDX-License-Identifier: Apache-2.0
// Cells as JSON; null stands for a side without an end.
#include "core/bundle/blocks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <system_error>

#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/error.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxBytes = std::uint64_t{256} << 20;
constexpr std::size_t kMaxBlocks = 1 << 16;
constexpr std::size_t kMaxViews = 1 << 20;
constexpr double kUnitTolerance = 1e-6;
constexpr const char* kBlocksFormat = "tgtrain-blocks";
constexpr const char* kBlockFormat = "tgtrain-block";
constexpr int kVersion = 1;

nlohmann::ordered_json bound(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
}

nlohmann::ordered_json jsonOf(const SceneBlock& block) {
  const Cell& cell = block.cell;
  return {{"name", block.name},
          {"u", {cell.u.x, cell.u.y, cell.u.z}},
          {"v", {cell.v.x, cell.v.y, cell.v.z}},
          {"low", {bound(cell.low.x), bound(cell.low.y)}},
          {"high", {bound(cell.high.x), bound(cell.high.y)}},
          {"padding", block.padding}};
}

glm::dvec2 bounds(const JsonNode& node, const char* key, double open) {
  const nlohmann::json& pair = node.array(key, 2);
  glm::dvec2 values;
  for (int i = 0; i < 2; ++i) {
    const nlohmann::json& value = pair[static_cast<std::size_t>(i)];
    values[i] = value.is_null() ? open : node.finite(value, key);
  }
  return values;
}

SceneBlock blockIn(const JsonNode& node) {
  SceneBlock block;
  block.name = node.string("name");
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  };
  if (block.name.empty() || block.name.size() > 100 || !std::ranges::all_of(block.name, plain)) {
    node.fail("\"name\": is no name of a folder (expected up to 100 letters, digits, _ and -)");
  }
  const std::array<double, 3> u = node.numbers<3>("u"), v = node.numbers<3>("v");
  Cell& cell = block.cell;
  cell.u = {u[0], u[1], u[2]};
  cell.v = {v[0], v[1], v[2]};
  const auto off = [](double value, double expected) { return !(std::abs(value - expected) <= kUnitTolerance); };
  if (off(glm::dot(cell.u, cell.u), 1) || off(glm::dot(cell.v, cell.v), 1) || off(glm::dot(cell.u, cell.v), 0)) {
    node.fail("\"u\", \"v\": expected two unit vectors at right angles");
  }
  constexpr double kOpen = std::numeric_limits<double>::infinity();
  cell.low = bounds(node, "low", -kOpen);
  cell.high = bounds(node, "high", kOpen);
  if (!(cell.low.x < cell.high.x && cell.low.y < cell.high.y)) node.fail("\"low\" is not below \"high\"");
  block.padding = node.number("padding", 0, 1e9);
  return block;
}

nlohmann::json readRoot(const fs::path& file, const char* format) {
  nlohmann::json json = parseJson(readRegularFile(file, kMaxBytes), file.string());
  const std::string path = file.string();
  const JsonNode root{json, path, ""};
  if (!json.is_object() || !root.has("format") || root.string("format") != format) {
    root.fail(std::string("is not of a scene in blocks (expected format ") + format + ")");
  }
  if (const std::int64_t version = root.integer("version", 0, 1'000'000); version != kVersion) {
    root.fail("unknown version" + expectedFound(std::uint64_t{kVersion}, static_cast<std::uint64_t>(version)));
  }
  return json;
}

bool overlap(const Cell& a, const Cell& b) {
  return a.low.x < b.high.x && b.low.x < a.high.x && a.low.y < b.high.y && b.low.y < a.high.y;
}

}  // namespace

void writeBlocks(const fs::path& folder, const std::vector<SceneBlock>& blocks) {
  nlohmann::ordered_json json = {{"format", kBlocksFormat}, {"version", kVersion}};
  json["blocks"] = nlohmann::ordered_json::array();
  for (const SceneBlock& block : blocks) json["blocks"].push_back(jsonOf(block));
  writeTextAtomically(folder / kBlocksName, dumpJson(json, 1) + "\n");
}

void writeBlock(const fs::path& folder, const BlockFile& file) {
  requireUtf8(file.dataset, kBlockName);
  for (const std::string& view : file.views) requireUtf8(view, kBlockName);
  nlohmann::ordered_json json = {{"format", kBlockFormat}, {"version", kVersion}};
  json["dataset"] = file.dataset;
  json["layout"] = file.layout;
  json["block"] = jsonOf(file.block);
  json["views"] = file.views;
  writeTextAtomically(folder / kBlockName, dumpJson(json, 1) + "\n");
}

std::vector<SceneBlock> readBlocks(const fs::path& folder) {
  const fs::path file = folder / kBlocksName;
  const nlohmann::json json = readRoot(file, kBlocksFormat);
  const std::string path = file.string();
  const JsonNode root{json, path, ""};
  std::vector<SceneBlock> blocks;
  std::set<std::string> names;
  for (const nlohmann::json& entry : root.list("blocks", kMaxBlocks)) {
    const JsonNode node{entry, path, "block " + std::to_string(blocks.size())};
    if (!entry.is_object()) node.fail("expected an object");
    blocks.push_back(blockIn(node));
    const SceneBlock& block = blocks.back();
    if (!names.insert(block.name).second) node.fail("\"name\" is another block's already");
    if (block.cell.u != blocks.front().cell.u || block.cell.v != blocks.front().cell.v) {
      node.fail("\"u\", \"v\": expected those of block 0");
    }
    for (std::size_t i = 0; i + 1 < blocks.size(); ++i) {
      if (overlap(blocks[i].cell, block.cell)) node.fail("its cell overlaps that of block " + std::to_string(i));
    }
  }
  if (blocks.empty()) root.fail("lists no block");
  return blocks;
}

std::optional<BlockFile> readBlock(const fs::path& folder) {
  const fs::path file = folder / kBlockName;
  if (!isFile(file)) return std::nullopt;
  const nlohmann::json json = readRoot(file, kBlockFormat);
  const std::string path = file.string();
  const JsonNode root{json, path, ""};
  BlockFile block;
  block.dataset = root.string("dataset");
  block.layout = root.string("layout");
  const nlohmann::json& entry = root.member("block");
  const JsonNode node{entry, path, "block"};
  if (!entry.is_object()) node.fail("expected an object");
  block.block = blockIn(node);
  for (const nlohmann::json& view : root.list("views", kMaxViews)) {
    if (!view.is_string()) root.fail("\"views\": expected texts");
    block.views.push_back(view.get<std::string>());
  }
  if (block.views.empty()) root.fail("has no photographs (expected one at least)");
  return block;
}

fs::path wholeDataset(const fs::path& folder, const BlockFile& block) {
  const fs::path whole = (folder / block.dataset).lexically_normal();
  std::error_code error;
  if (!fs::is_directory(whole, error)) {
    throw Error(ErrorKind::cannotRead, (folder / kBlockName).string(),
                "its data set " + block.dataset + " is not there");
  }
  if (fs::is_empty(whole, error)) {
    throw Error(
        ErrorKind::cannotRead, (folder / kBlockName).string(),
        "its data set " + block.dataset + " is an empty folder (expected photographs, or its share to be there)");
  }
  return whole;
}

}  // namespace tg
