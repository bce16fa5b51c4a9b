// SPDX-License-Identifier: Apache-2.0
// SPZ comes back within its bits in both versions, and says what they could not hold.
#include "converter/formats/spz.h"

#include <cmath>

#include "converter/scenes.h"
#include "converter/splat_files.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/scenes.h"

using namespace tg;
using test::messageOf;

namespace {

std::string spz(const GaussianModel& model, int version = kNewestSpz) {
  SpzReport report;
  const std::vector<std::uint8_t> bytes = formatSpz(model, "a.spz", report, version);
  return {bytes.begin(), bytes.end()};
}

Bundle parse(const std::string& bytes) {
  return parseSpz({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, "a.spz");
}

// What the stored file says, and nothing that its numbers round: written again it has the same payload.
SpzParts exactParts() {
  SpzParts parts(3);
  ByteWriter positions, rotations;
  for (int value : {32768, -8192, 2048, -1, 0, 4095}) positions.fixed24(value);      // 8: 12 bits for the rest
  rotations.add(std::uint32_t{3u << 30});                                            // x = y = z = 0
  rotations.add(std::uint32_t{1u << 30 | 0x2FFu << 20 | 100u << 10 | 0x200u | 7u});  // x and w negative, y the largest
  parts.streams[0] = positions.bytes;
  parts.streams[4] = rotations.bytes;
  return parts;
}

}  // namespace

TEST_CASE("a model comes back from SPZ within the steps of its numbers, at every degree") {
  for (int degree = 0; degree <= 3; ++degree) {
    const GaussianModel in = randomSplats(degree, 50, 20.0, degree + 70);
    SpzReport report;
    const GaussianModel out = parseSpz(formatSpz(in, "a.spz", report), "a.spz").model;
    REQUIRE(out.size() == in.size());
    REQUIRE(out.sh_degree == degree);
    CHECK(report.fractional_bits == 12);
    CHECK(report.clipped_scales + report.clipped_colors + report.clipped_sh == 0);
    const std::size_t k = in.shCount();
    for (std::size_t i = 0; i < in.size(); ++i) {
      CAPTURE(degree, i);
      CHECK(largest(in.mean[i] - out.mean[i]) <= 0.5 / 4096 + 2e-6);
      CHECK(largest(in.log_scale[i] - out.log_scale[i]) <= 1.0 / 32 + 1e-6);
      CHECK(std::abs(opacityOf(in, i) - opacityOf(out, i)) <= 0.5 / 255 + 1e-6);
      const glm::dvec4 a = glm::normalize(glm::dvec4(in.rotation[i])), b = glm::normalize(glm::dvec4(out.rotation[i]));
      CHECK(std::abs(glm::dot(a, b)) > 1.0 - 3e-6);
      CHECK(largest(in.sh[i * k] - out.sh[i * k]) <= 0.5 / 255 / 0.15 + 1e-5);
      for (std::size_t c = 1; c < k; ++c) {
        CHECK(largest(in.sh[i * k + c] - out.sh[i * k + c]) <= (c < 4 ? 4.5 : 8.5) / 128);
      }
    }
  }
}

TEST_CASE("SPZ: the same model gives the same bytes") {
  const GaussianModel model = randomSplats(2, 30, 5.0, 2 + 70);
  SpzReport report;
  CHECK(formatSpz(model, "a.spz", report) == formatSpz(model, "b.spz", report));
}

TEST_CASE("SPZ: positions get the bits that the scene's size asks for") {
  const auto bits = [](double extent) {
    GaussianModel model = randomSplats(0, 2, 1.0, 0 + 70);
    model.mean = {glm::vec3(static_cast<float>(extent), 0, 0), glm::vec3(0.0f)};
    SpzReport report;
    const GaussianModel out = parseSpz(formatSpz(model, "a.spz", report), "a.spz").model;
    CHECK(out.mean[0].x == Approx(extent).epsilon(1e-4));
    return report.fractional_bits;
  };
  CHECK(bits(10.0) == 12);
  CHECK(bits(2000.0) == 12);
  CHECK(bits(3000.0) == 11);
  CHECK(bits(0.1) == 19);  // 2^-19 is 1/52429 of it
  CHECK(bits(8e6) == 0);
  GaussianModel model = randomSplats(0, 1, 1.0, 0 + 70);
  model.mean[0].y = -9e6f;
  SpzReport report;
  CHECK_THROWS_AS(formatSpz(model, "a.spz", report), Error);
}

TEST_CASE("SPZ: what the bytes cannot hold is clipped and counted") {
  GaussianModel model = randomSplats(1, 4, 1.0, 1 + 70);
  model.log_scale[0].y = -12.0f;
  model.log_scale[1].x = 7.0f;
  model.sh[2 * 4].z = 4.0f;
  model.sh[3 * 4 + 2].x = -1.5f;
  SpzReport report;
  const GaussianModel out = parseSpz(formatSpz(model, "a.spz", report), "a.spz").model;
  CHECK(report.clipped_scales == 2);
  CHECK(report.clipped_colors == 1);
  CHECK(report.clipped_sh == 1);
  CHECK(out.log_scale[0].y == -10.0f);
  CHECK(out.log_scale[1].x == 5.9375f);
  CHECK(out.sh[3 * 4 + 2].x == -127.0f / 128.0f);  // its sign changes in the file's axes
}

TEST_CASE("SPZ 3, where it is asked for, is the bytes of its layout in one gzip stream") {
  const std::string bytes = gzipped(exactParts().whole());
  CHECK(spz(parse(bytes).model, 3) == bytes);
}

TEST_CASE("SPZ 4: every byte of header and table is where the published layout has it") {
  const SpzParts parts = exactParts();
  const std::string bytes = spz(parse(gzipped(parts.whole())).model);
  ByteWriter expected;
  expected.bytes = "NGSP";
  expected.add(std::uint32_t{4}).add(std::uint32_t{2});
  expected.add(std::uint8_t{1}).add(std::uint8_t{12}).add(std::uint8_t{0}).add(std::uint8_t{6});  // 6 streams
  expected.add(std::uint32_t{32}).bytes += std::string(12, '\0');
  CHECK(bytes.substr(0, 32) == expected.bytes);
  std::size_t at = 32 + 6 * 16;
  for (std::size_t s = 0; s < 6; ++s) {
    CAPTURE(s);
    std::uint64_t packed = 0, size = 0;
    std::memcpy(&packed, bytes.data() + 32 + 16 * s, 8);
    std::memcpy(&size, bytes.data() + 32 + 16 * s + 8, 8);
    CHECK(size == parts.streams[s].size());
    // A frame of its own: magic number, then in two bytes a single segment with a checksum and its size.
    CHECK(bytes.substr(at, 4) == "\x28\xB5\x2F\xFD");
    CHECK(static_cast<std::uint8_t>(bytes[at + 4]) == 0x24);
    CHECK(static_cast<std::uint8_t>(bytes[at + 5]) == size);
    at += packed;
  }
  CHECK(at == bytes.size());
  // Of degree 0 there is no stream of SH, and the table has a row less.
  const std::string flat = spz(randomSplats(0, 3, 1.0, 75));
  CHECK(flat[12] == 0);
  CHECK(flat[15] == 5);
  CHECK(flat.substr(32 + 5 * 16, 4) == "\x28\xB5\x2F\xFD");
}

TEST_CASE("SPZ 3 and 4 of a model hold the same numbers") {
  for (int degree = 0; degree <= 3; ++degree) {
    CAPTURE(degree);
    const GaussianModel model = randomSplats(degree, 300, 20.0, degree + 80);
    const GaussianModel third = parse(spz(model, 3)).model, fourth = parse(spz(model, 4)).model;
    CHECK(third.mean == fourth.mean);
    CHECK(third.log_scale == fourth.log_scale);
    CHECK(third.rotation == fourth.rotation);
    CHECK(third.opacity_logit == fourth.opacity_logit);
    CHECK(third.sh == fourth.sh);
  }
}

TEST_CASE("SPZ 4 is the same bytes for any number of threads") {
  const GaussianModel model = randomSplats(3, 2000, 20.0, 84);
  const std::string bytes = spz(model);
  setThreadCount(1);
  CHECK(spz(model) == bytes);
  setThreadCount(0);
}

TEST_CASE("SPZ 4 of one splat a hundred thousand times is read again, however well it packs") {
  GaussianModel model = randomSplats(3, 1, 1.0, 85);
  model = select(model, std::vector<std::uint32_t>(100000, 0));
  const std::string bytes = spz(model);
  CHECK(bytes.size() < 6500000 / 1000);
  CHECK(parse(bytes).model.size() == 100000);
}

TEST_CASE("SPZ 4 that is cut or spoilt is refused, or where only its header is spoilt a sound model") {
  const std::string good = spz(randomSplats(1, 20, 5.0, 86));
  for (std::size_t length = 0; length < good.size(); ++length) {
    CAPTURE(length);
    CHECK_THROWS_AS(parse(good.substr(0, length)), Error);
  }
  for (std::size_t bit = 0; bit < good.size() * 8; ++bit) {
    std::string bad = good;
    bad[bit / 8] = static_cast<char>(bad[bit / 8] ^ (1 << bit % 8));
    CAPTURE(bit);
    const std::string message = messageOf([&] { checkModel(parse(bad).model, "a.spz"); });
    CHECK(message.find('\n') == std::string::npos);
  }
}

TEST_CASE("SPZ 4: sizes that lie are refused in one line before memory is taken for them") {
  const std::string good = SpzParts(4).version4();
  const auto refused = [](const std::string& bytes) { return messageOf([&] { parse(bytes); }); };
  CHECK(refused(good + "more") == "a.spz: SPZ: 4 bytes follow the splats (expected none)");
  // A count with a table that agrees with it, and no bytes behind it that could say so much.
  ByteWriter huge;
  huge.bytes = "NGSP";
  huge.add(std::uint32_t{4}).add(std::uint32_t{64000000});
  huge.add(std::uint8_t{3}).add(std::uint8_t{12}).add(std::uint8_t{0}).add(std::uint8_t{6});
  huge.add(std::uint32_t{32}).bytes += std::string(12, '\0');
  for (const std::uint64_t size : {9, 1, 3, 3, 4, 45}) huge.add(std::uint64_t{0}).add(size * 64000000);
  CHECK(refused(huge.bytes) ==
        "a.spz: SPZ: the file is too short for its 64000000 splats (expected at least 4160000 bytes, found 128)");
  // A stream that holds other than its row of the table says.
  const auto lying = [](std::size_t stream, const std::string& content) {
    SpzParts parts(4);
    const std::uint64_t said = parts.streams[stream].size();
    parts.streams[stream] = content;
    std::string bytes = parts.version4();
    std::memcpy(bytes.data() + 32 + 16 * stream + 8, &said, 8);
    return bytes;
  };
  CHECK(refused(lying(1, std::string(100000, 'x'))) ==
        "a.spz: SPZ: the stream of alphas is too long (expected 2 bytes, found more)");
  CHECK(refused(lying(3, "abc")) == "a.spz: SPZ: the stream of scales ends early (expected 6 bytes, found 3)");
  std::string leaving = good;
  leaving[32 + 16 + 2] = '\x01';
  CHECK(refused(leaving).find("the stream of alphas leaves the file, which may be cut off (expected at least ") !=
        std::string::npos);
  CHECK(refused(good.substr(0, good.size() - 1))
            .ends_with("leaves the file, which may be cut off (expected at least " + std::to_string(good.size()) +
                       " bytes, found " + std::to_string(good.size() - 1) + ")"));
}
