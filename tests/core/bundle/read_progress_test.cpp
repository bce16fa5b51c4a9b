// SPDX-License-Identifier: Apache-2.0
// Reading in pieces: the same model and messages as from memory, progress, parts to look at, and the way to stop.
#include "core/bundle/read_progress.h"
#include "core/bundle/splat_rows.h"

#include <cmath>
#include <fstream>
#include <random>

#include "core/bundle/bundle.h"
#include "core/bundle/ply.h"
#include "core/file/file.h"
#include "core/system/error.h"
#include "core/tiny_model.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

using tg::test::messageOf;
using Bytes = std::vector<std::uint8_t>;

namespace {

void write(const std::filesystem::path& path, const Bytes& bytes) {
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

// Numbers that gzip cannot shorten much.
tg::GaussianModel noise(std::size_t count) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> number(-1.0f, 1.0f);
  tg::GaussianModel model;
  model.sh_degree = 3;
  for (std::size_t i = 0; i < count; ++i) {
    model.mean.emplace_back(number(random), number(random), number(random));
    model.rotation.emplace_back(1.0f, number(random), number(random), number(random));
    model.log_scale.emplace_back(number(random), number(random), number(random));
    model.opacity_logit.push_back(number(random));
    for (int k = 0; k < 16; ++k) model.sh.emplace_back(number(random), number(random), number(random));
  }
  return model;
}

}  // namespace

TEST_CASE("a file read in blocks is the model that its bytes are, and all of it counts as progress") {
  const tg::TemporaryFolder folder;
  const tg::GaussianModel model = noise(9001);
  tg::writeSplatPly(folder / "a.ply", model);
  tg::ReadProgress progress;
  const tg::GaussianModel read = tg::readSplatPly(folder / "a.ply", &progress);
  CHECK(read == model);
  CHECK(progress.total == std::filesystem::file_size(folder / "a.ply"));
  CHECK(progress.done == 9001u * 62 * 4);
}

TEST_CASE("a cut or broken file is refused in the words that its bytes are refused in") {
  const tg::TemporaryFolder folder;
  const Bytes whole = tg::formatSplatPly(noise(3));
  const std::string path = (folder / "a.ply").string();
  for (std::size_t length = 0; length < whole.size(); length += 7) {
    const Bytes bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length));
    write(path, bytes);
    const std::string message = messageOf([&] { (void)tg::readSplatPly(path); });
    REQUIRE(message != "accepted");
    REQUIRE(message == messageOf([&] { (void)tg::parseSplatPly(bytes, path); }));
  }
  tg::GaussianModel broken = noise(5000);
  broken.sh[4200 * 16 + 3].y = NAN;
  write(path, tg::formatSplatPly(broken));
  CHECK_THROWS_WITH(tg::readSplatPly(path), path + ": Gaussian 4200: f_rest_17 is not finite");
  broken = noise(5000);
  broken.rotation[4500] = glm::vec4(0.0f);
  write(path, tg::formatSplatPly(broken));
  CHECK_THROWS_WITH(
      tg::readSplatPly(path),
      path + ": Gaussian 4500: rotation has no usable length (expected a quaternion of a length from 1e-22 to 1e19)");
}

TEST_CASE("reading stops when it is told to, a PLY as well as a bundle") {
  const tg::TemporaryFolder folder;
  tg::writeSplatPly(folder / "a.ply", noise(100));
  tg::Bundle bundle;
  bundle.model = tg::tinyTexturedModel(20);
  tg::writeBundle(folder / "a.tgz", bundle);
  tg::ReadProgress progress;
  progress.cancel = true;
  CHECK_THROWS_AS(tg::readSplatPly(folder / "a.ply", &progress), tg::ReadCancelled);
  CHECK_THROWS_AS(tg::readBundle(folder / "a.tgz", {}, &progress), tg::ReadCancelled);
  progress.cancel = false;
  CHECK(tg::readBundle(folder / "a.tgz", {}, &progress).model.size() == 20);
}

TEST_CASE("a large bundle shows a part of itself while it is read, wide enough to stand for the rest") {
  const tg::TemporaryFolder folder;
  tg::Bundle bundle;
  bundle.model = noise(150'000);
  tg::writeBundle(folder / "a.tgz", bundle);
  tg::ReadProgress progress;
  std::vector<tg::GaussianModel> parts;
  progress.preview = [&](tg::GaussianModel part) { parts.push_back(std::move(part)); };
  const tg::Bundle read = tg::readBundle(folder / "a.tgz", {}, &progress);
  CHECK(read.model == bundle.model);
  CHECK(progress.done == progress.total);
  REQUIRE(parts.size() == 1);
  const tg::GaussianModel& part = parts.front();
  REQUIRE(part.size() > 50'000);
  REQUIRE(part.size() <= tg::kPreviewGaussians);
  CHECK(part.mean[1] == bundle.model.mean[2]);  // every other one of what was there
  CHECK(part.log_scale[1].x - bundle.model.log_scale[2].x ==
        Approx(0.5 * std::log(150'000.0 / static_cast<double>(part.size()))).epsilon(1e-3));
}

TEST_CASE("a PLY that arrives in pieces of any size is the model that its bytes are") {
  const tg::GaussianModel model = noise(37);
  const Bytes plain = tg::formatSplatPly(model);
  // Two faces before the vertices, so that the rows do not start where the header ends, and lines after them.
  const std::string text(plain.begin(), plain.end());
  const std::size_t vertex = text.find("element vertex"), end = text.find("end_header\n") + 11;
  const std::string around =
      text.substr(0, vertex) + "element face 2\nproperty double area\n" + text.substr(vertex, end - 11 - vertex) +
      "element line 3\nproperty uchar kind\nend_header\n" + std::string(16, 'x') + text.substr(end) + "abc";
  const Bytes surrounded(around.begin(), around.end());
  Bytes swapped(text.begin(), text.end());  // big endian: kept until the end
  const std::string little = "little", big = "big";
  const auto at = std::search(swapped.begin(), swapped.end(), little.begin(), little.end());
  const auto body = static_cast<std::size_t>(at - swapped.begin());
  swapped.erase(at, at + 6);
  swapped.insert(swapped.begin() + static_cast<std::ptrdiff_t>(body), big.begin(), big.end());
  for (std::size_t i = end - 3; i < swapped.size(); i += 4) std::reverse(&swapped[i], &swapped[i] + 4);
  for (const Bytes& bytes : {plain, surrounded, swapped}) {
    for (const std::size_t piece :
         {std::size_t{1}, std::size_t{100}, std::size_t{248}, std::size_t{5000}, bytes.size()}) {
      tg::SplatStream stream(bytes.size(), "a.ply");
      for (std::size_t i = 0; i < bytes.size(); i += piece) {
        stream.add(std::span(bytes).subspan(i, std::min(piece, bytes.size() - i)));
      }
      REQUIRE(stream.finish() == model);
    }
  }
}

TEST_CASE("a broken PLY that arrives in pieces is refused") {
  tg::GaussianModel broken = noise(5);
  broken.sh[3 * 16 + 2].y = NAN;
  const Bytes bytes = tg::formatSplatPly(broken);
  tg::SplatStream stream(bytes.size(), "a.ply");
  stream.add(bytes);
  CHECK_THROWS_WITH(stream.finish(), "a.ply: Gaussian 3: sh coefficient 2 is not finite");
  tg::SplatStream none(0, "b.ply");
  CHECK_THROWS_WITH(none.finish(), "b.ply: not a PLY file");
  const std::string head = tg::splatHeader(60'000'000, 3);
  tg::SplatStream hostile(head.size() + 100,
                          "c.ply");  // a count that the bytes cannot hold: refused before anything is made
  CHECK_THROWS_WITH(
      [&] {
        hostile.add({reinterpret_cast<const std::uint8_t*>(head.data()), head.size()});
        hostile.finish();
      }(),
      Contains("too short for its counts"));
}
