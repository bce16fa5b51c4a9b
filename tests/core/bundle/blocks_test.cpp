// SPDX-License-Identifier: Apache-2.0
// Cells that cover the ground once, out and in, and files that describe none.
#include "core/bundle/blocks.h"

#include <fstream>
#include <limits>

#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace fs = std::filesystem;

namespace {

constexpr double kOpen = std::numeric_limits<double>::infinity();

std::vector<tg::SceneBlock> twoBlocks() {
  tg::Cell left, right;
  left.low = right.low = {-kOpen, -kOpen};
  left.high = right.high = {kOpen, kOpen};
  left.high.x = right.low.x = 0.1;
  return {{"left", left, 0.5}, {"right", right, 0.25}};
}

void write(const fs::path& file, const std::string& text) { std::ofstream(file) << text; }

}  // namespace

TEST_CASE("blocks survive their file, and a point lies in one of them", "[blocks]") {
  const tg::TemporaryFolder folder;
  tg::writeBlocks(folder.path, twoBlocks());
  const std::vector<tg::SceneBlock> blocks = tg::readBlocks(folder.path);
  REQUIRE(blocks.size() == 2);
  CHECK(blocks[1].name == "right");
  CHECK(blocks[1].padding == 0.25);
  CHECK(blocks[0].cell.high.x == 0.1);
  CHECK(blocks[0].cell.low.x == -kOpen);
  for (const double x : {-1e30, -1.0, 0.1, 0.2, 1e30}) {
    CHECK(blocks[0].cell.contains({x, 7, -3}) != blocks[1].cell.contains({x, 7, -3}));
  }
  CHECK(blocks[1].cell.contains({0.1, 0, 0}));
  CHECK(blocks[0].cell.padded(0.5).contains({0.55, 0, 0}));

  CHECK_FALSE(tg::readBlock(folder.path));
  tg::writeBlock(folder.path, {blocks[0], "../scene", "colmap", {"images/a.jpg", "images/b.jpg"}});
  const std::optional<tg::BlockFile> block = tg::readBlock(folder.path);
  REQUIRE(block);
  CHECK(block->dataset == "../scene");
  CHECK(block->layout == "colmap");
  CHECK(block->views == std::vector<std::string>{"images/a.jpg", "images/b.jpg"});
  CHECK(block->block.cell.high.x == 0.1);
  CHECK_THROWS_WITH(tg::writeBlock(folder.path, {blocks[0], "../scene", "colmap", {"images/caf\xe9.jpg"}}),
                    Contains("is no UTF-8"));

  const fs::path moved = folder / "moved";
  CHECK(tg::test::messageOf([&] { tg::wholeDataset(moved, *block); }, tg::ErrorKind::cannotRead) ==
        (moved / "block.json").string() + ": its data set ../scene is not there");
  fs::create_directory(folder / "scene");  // as a share that is not mounted
  CHECK_THAT(tg::test::messageOf([&] { tg::wholeDataset(moved, *block); }, tg::ErrorKind::cannotRead),
             Contains((moved / "block.json").string() + ": its data set ../scene is an empty folder"));
  fs::create_directory(folder / "scene/images");
  CHECK(tg::wholeDataset(moved, *block) == folder / "scene");
}

TEST_CASE("what is no scene in blocks is named", "[blocks]") {
  const tg::TemporaryFolder folder;
  const auto message = [&] { return tg::test::messageOf([&] { tg::readBlocks(folder.path); }); };
  CHECK_THAT(tg::test::messageOf([&] { tg::readBlocks(folder.path); }, tg::ErrorKind::cannotRead),
             Contains("blocks.json: cannot open"));
  tg::writeBlocks(folder.path, twoBlocks());
  std::ifstream stream(folder / "blocks.json");
  const std::string good{std::istreambuf_iterator<char>(stream), {}};
  for (std::size_t size = 0; size + 2 < good.size(); size += 7) {
    write(folder / "blocks.json", good.substr(0, size));
    CHECK_THAT(message(), Contains("blocks.json: "));
  }
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    const std::size_t at = text.find(from);
    REQUIRE(at != text.npos);
    write(folder / "blocks.json", text.replace(at, from.size(), to));
    return message();
  };
  CHECK_THAT(changed("\"version\": 1", "\"version\": 2"), Contains("unknown version (expected 1, found 2)"));
  CHECK_THAT(changed("tgtrain-blocks", "tgtrain-farm"), Contains("is not of a scene in blocks"));
  CHECK_THAT(changed("\"right\"", "\"left\""), Contains("block 1: \"name\" is another block's already"));
  for (const char* name : {"../left", "", "a/", "a.", "a:", "a@", "a[", "a^", "a`", "a{"}) {  // next to what may be
    CHECK_THAT(changed("\"left\"", std::string("\"") + name + "\""),
               Contains("block 0: \"name\": is no name of a folder"));
  }
  CHECK(changed("\"left\"", "\"azAZ09_-\"") == "accepted");
  CHECK_THAT(changed("0.1", "0.2"), Contains("block 1: its cell overlaps that of block 0"));
  CHECK_THAT(changed("0.1", "1e999"), Contains("blocks.json: "));
  CHECK_THAT(changed("1.0", "2.0"), Contains("two unit vectors at right angles"));
  write(folder / "blocks.json", "{\"format\": \"tgtrain-blocks\", \"version\": 1, \"blocks\": []}");
  CHECK_THAT(message(), Contains("lists no block"));
  tg::writeBlock(folder.path, {twoBlocks()[0], "../scene", "colmap", {}});
  CHECK_THAT(tg::test::messageOf([&] { tg::readBlock(folder.path); }),
             Contains("block.json: has no photographs (expected one at least)"));
}
