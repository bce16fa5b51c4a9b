// SPDX-License-Identifier: Apache-2.0
// Recordings on disk, with ffmpeg's place taken by small programs.
#include "viewer/picture/frame_writer.h"

#include <cstdlib>
#include <fstream>
#include <vector>

#include "core/file/file.h"
#include "core/image/drawn.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace tg;

namespace {

std::size_t filesIn(const std::filesystem::path& folder) {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder)) ++count;
  return count;
}

// PATH with one folder in front (or alone) that holds this `ffmpeg`, while it lives.
class FakeFfmpeg {
 public:
  explicit FakeFfmpeg(const std::string& script) : before_(std::getenv("PATH")) {
    if (!script.empty()) {
      std::ofstream(folder_ / "ffmpeg") << "#!/bin/sh\n" << script;
      std::filesystem::permissions(folder_ / "ffmpeg", std::filesystem::perms::owner_all);
    }
    ::setenv("PATH", (folder_.path.string() + (script.empty() ? "" : ":" + before_)).c_str(), 1);
  }
  ~FakeFfmpeg() { ::setenv("PATH", before_.c_str(), 1); }
  FakeFfmpeg& operator=(FakeFfmpeg&&) = delete;

 private:
  const TemporaryFolder folder_;
  const std::string before_;
};

// Writes what comes in to the last argument, which is file:NAME.
const std::string kCopy = "for last; do :; done\ncat > \"${last#file:}\"\n";

}  // namespace

TEST_CASE("a recording's name says what it becomes") {
  const TemporaryFolder folder;
  CHECK(parseRecordTarget("a.mp4", "-o").video);
  CHECK(parseRecordTarget("x/b.webm", "-o").video);
  CHECK(parseRecordTarget("a.MP4", "-o").video);
  CHECK(framePath(parseRecordTarget("x/a_###.png", "-o"), 7) == "x/a_007.png");
  CHECK(framePath(parseRecordTarget("#.jpg", "-o"), 123) == "123.jpg");
  CHECK(framePath(parseRecordTarget("frames", "-o"), 12) == "frames/0012.png");
  CHECK(framePath(parseRecordTarget("frames/", "-o"), 12) == "frames/0012.png");
  CHECK(framePath(parseRecordTarget(folder.path, "-o"), 3) == folder / "0003.png");
  for (const char* bad : {"", "a.png", "a.avi", "a#b#.png", "##.gif", "a.p#g"}) {
    INFO(bad);
    CHECK_THROWS_AS(parseRecordTarget(bad, "--output"), Error);
  }
  CHECK_THROWS_WITH(parseRecordTarget("a.png", "--output"), Contains("--output: expected a video"));
}

TEST_CASE("videos have even sides, pictures any") {
  CHECK(recordSize({"a.mp4", true}, {641, 480}) == glm::ivec2(642, 480));
  CHECK(recordSize({"a.mp4", true}, {1, 1}) == glm::ivec2(2, 2));
  CHECK(recordSize({"#.png", false}, {641, 479}) == glm::ivec2(641, 479));
}

TEST_CASE("pictures are numbered from 0 in a folder that is made for them") {
  const TemporaryFolder folder;
  FrameWriter writer(parseRecordTarget(folder / "new/f##.png", "-o"), {4, 3}, 30, 5);
  for (int i = 0; i < 5; ++i) writer.add(Image(4, 3, 3, 0.2f * static_cast<float>(i)));
  writer.finish();
  CHECK(filesIn(folder / "new") == 5);
  CHECK(readImage(folder / "new/f03.png").at(1, 1, 0) == Approx(0.6f).margin(0.005));
  CHECK(isDrawn(readFile(folder / "new/f03.png", 1 << 20)));
}

TEST_CASE("pictures of a longer recording are not left among those of a shorter one") {
  const TemporaryFolder folder;
  const auto record = [&](std::size_t frames, float grey) {
    FrameWriter writer(parseRecordTarget(folder / "##.png", "-o"), {4, 3}, 30, frames);
    for (std::size_t i = 0; i < frames; ++i) writer.add(Image(4, 3, 3, grey));
    writer.finish();
  };
  record(3, 1.0f);
  CHECK_THROWS_WITH(record(2, 0.0f), Contains("02.png: a picture of a longer recording"));
  CHECK(readImage(folder / "00.png").at(1, 1, 0) == 1.0f);
  record(4, 0.0f);
  CHECK(readImage(folder / "00.png").at(1, 1, 0) == 0.0f);
}

TEST_CASE("the folder of a video is not made") {
  const FakeFfmpeg ffmpeg(kCopy);
  const TemporaryFolder folder;
  CHECK_THROWS_WITH(FrameWriter(parseRecordTarget(folder / "typo/a.mp4", "-o"), {4, 2}, 30, 5),
                    Contains("a.mp4: cannot write here"));
  CHECK(filesIn(folder.path) == 0);
}

TEST_CASE("a video gets every byte of every frame, in order, and appears whole") {
  const FakeFfmpeg ffmpeg(kCopy);
  const TemporaryFolder folder;
  FrameWriter writer(parseRecordTarget(folder / "a.mp4", "-o"), {64, 48}, 25, 6);
  for (int i = 0; i < 6; ++i) {
    writer.add(Image(64, 48, 3, static_cast<float>(i) / 10.0f));
    CHECK_FALSE(std::filesystem::exists(folder / "a.mp4"));
  }
  writer.finish();
  std::ifstream file(folder / "a.mp4", std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  REQUIRE(bytes.size() == 6u * 64 * 48 * 3);
  for (int i = 0; i < 6; ++i) {
    CHECK(static_cast<unsigned char>(bytes[static_cast<std::size_t>(i) * 64 * 48 * 3]) == (255 * i + 5) / 10);
  }
}

TEST_CASE("a recording that is given up leaves no video, and keeps an older one") {
  const FakeFfmpeg ffmpeg(kCopy);
  const TemporaryFolder folder;
  std::ofstream(folder / "a.mp4") << "old";
  {
    FrameWriter writer(parseRecordTarget(folder / "a.mp4", "-o"), {4, 4}, 25, 10);
    writer.add(Image(4, 4, 3));
  }
  CHECK(std::filesystem::file_size(folder / "a.mp4") == 3);
  CHECK(filesIn(folder.path) == 1);
}

TEST_CASE("what ffmpeg says is passed on, and nothing is left") {
  const TemporaryFolder folder;
  struct Case {
    std::string script, message;
  };
  const std::vector<Case> cases = {{"echo 'no such encoder' >&2\nexit 3\n", "ffmpeg failed: no such encoder"},
                                   {"cat >/dev/null\nexit 3\n", "ffmpeg failed: exit code 3"},
                                   {"kill -9 $$\n", "ffmpeg failed: ended by signal 9"}};
  for (const Case& wrong : cases) {
    INFO(wrong.message);
    const FakeFfmpeg ffmpeg(wrong.script);
    const auto record = [&] {
      FrameWriter writer(parseRecordTarget(folder / "a.mp4", "-o"), {640, 480}, 25, 20);
      for (int i = 0; i < 20; ++i) writer.add(Image(640, 480, 3));
      writer.finish();
    };
    CHECK_THROWS_WITH(record(), Contains(wrong.message));
    CHECK(filesIn(folder.path) == 0);
  }
}

TEST_CASE("without ffmpeg the way out is named before any frame is rendered") {
  const FakeFfmpeg none("");
  const TemporaryFolder folder;
  CHECK_THROWS_WITH(FrameWriter(parseRecordTarget(folder / "a.mp4", "-o"), {4, 4}, 25, 10),
                    Contains("needs the ffmpeg program") && Contains("frames/####.png"));
  CHECK(filesIn(folder.path) == 0);
}

TEST_CASE("a place that cannot be written is refused at once, and a late failure by the next frame or the end") {
  const TemporaryFolder folder;
  std::ofstream(folder / "file") << "x";
  CHECK_THROWS_AS(FrameWriter(parseRecordTarget(folder / "file/##.png", "-o"), {4, 4}, 25, 10), Error);
  FrameWriter writer(parseRecordTarget(folder / "f/##.png", "-o"), {4, 4}, 25, 10);
  std::filesystem::remove_all(folder / "f");
  const auto write = [&] {
    for (int i = 0; i < 10; ++i) writer.add(Image(4, 4, 3));
    writer.finish();
  };
  CHECK_THROWS_AS(write(), Error);
}
