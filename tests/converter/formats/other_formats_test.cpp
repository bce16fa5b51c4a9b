// SPDX-License-Identifier: Apache-2.0
// .splat, SPZ and compressed PLY: every number where it belongs, and nothing but errors from broken files.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "converter/convert.h"
#include "converter/formats/read_compressed_ply.h"
#include "converter/formats/splat.h"
#include "converter/formats/spz.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "converter/splat_files.h"
#include "core/bundle/ply.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"

using namespace tg;
using tg::test::messageOf;

namespace {

std::span<const std::uint8_t> bytesOf(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

Bundle spz(const std::string& bytes) { return parseSpz(bytesOf(bytes), "a.spz"); }

// Every shorter file is refused, and every file with one bit turned is a sound model or an Error.
template <typename Parse>
void spoil(const std::string& good, Parse parse, std::size_t step = 1) {
  for (std::size_t length = 0; length < good.size(); length += step) {
    CAPTURE(length);
    CHECK_THROWS_AS(parse(good.substr(0, length)), Error);
  }
  for (std::size_t bit = 0; bit < good.size() * 8; bit += 3 * step) {
    std::string bad = good;
    bad[bit / 8] = static_cast<char>(bad[bit / 8] ^ (1 << bit % 8));
    CAPTURE(bit);
    try {
      parse(bad);
    } catch (const Error&) {
    }
  }
}

void checkCloseTo(glm::vec3 found, glm::vec3 expected, float tolerance = 1e-6f) {
  CAPTURE(found.x, found.y, found.z, expected.x, expected.y, expected.z);
  CHECK(glm::length(found - expected) < tolerance);
}
void checkCloseTo(glm::vec4 found, glm::vec4 expected, float tolerance) {
  CAPTURE(found.x, found.y, found.z, found.w);
  CHECK(glm::length(found - expected) < tolerance);
}

}  // namespace

// The file's axes are x right, y up, z back.
TEST_CASE("SPZ of every version: every number where it belongs") {
  for (std::uint32_t version : {2u, 3u, 4u}) {
    const SpzParts parts(version);
    const Bundle loaded = spz(version == 4 ? parts.version4() : gzipped(parts.whole()));
    const GaussianModel& model = loaded.model;
    CAPTURE(version);
    REQUIRE(model.size() == 2);
    REQUIRE(model.sh_degree == 1);
    CHECK(loaded.warnings.empty());
    checkCloseTo(model.mean[0], {1.0f, 2.0f, -0.5f});
    checkCloseTo(model.mean[1], {-1.0f / 4096, 0.0f, -8388607.0f / 4096}, 1e-3f);
    checkCloseTo(model.log_scale[0], {0.0f, -1.0f, -2.0f});
    checkCloseTo(model.log_scale[1], {-10.0f, 5.9375f, -9.0f});
    CHECK(model.opacity_logit[0] == 20.0f);
    CHECK(model.opacity_logit[1] == Approx(std::log(0.25)));
    checkCloseTo(model.sh[0], {0.5f / 0.15f, -0.5f / 0.15f, (128 / 255.0f - 0.5f) / 0.15f}, 1e-5f);
    checkCloseTo(model.sh[1], {0.5f, 0.4375f, 0.375f});
    checkCloseTo(model.sh[2], {0.3125f, 0.25f, 0.1875f});
    checkCloseTo(model.sh[3], {-0.125f, -0.0625f, 0.0f});
    if (version == 2) {
      checkCloseTo(model.rotation[0], {0, 1, 0, 0}, 6e-3f);
      checkCloseTo(model.rotation[1], {0, 0, 1, 0}, 6e-3f);
    } else {
      const float half = std::sqrt(0.5f);
      checkCloseTo(model.rotation[0], {1, 0, 0, 0}, 1e-6f);
      checkCloseTo(model.rotation[1], {0, -half, -half, 0}, 1e-6f);
    }
  }
}

TEST_CASE("SPZ: axes are those that the caller names, else the file, else the format") {
  const auto axes = [](std::uint32_t system) {
    ByteWriter record;
    record.add(std::uint32_t{0xADBE0003}).add(std::uint32_t{4}).add(system);
    return record.bytes;
  };
  const auto read = [&](const std::string& extensions, std::optional<SpzAxes> asked = {}) {
    SpzParts parts(4);
    parts.flags = extensions.empty() ? 0 : 2;
    return parseSpz(bytesOf(parts.version4(extensions)), "a.spz", asked);
  };
  const GaussianModel stored = read("", SpzAxes::rdf).model;
  checkCloseTo(stored.mean[0], {1.0f, -2.0f, 0.5f});
  const GaussianModel usual = read("").model;
  checkCloseTo(usual.mean[0], {1.0f, 2.0f, -0.5f});
  CHECK(read(axes(6)).model.mean == stored.mean);  // RDF
  CHECK(read(axes(6)).model.sh == stored.sh);
  CHECK(read(axes(6)).model.rotation == stored.rotation);
  CHECK(read(axes(6)).warnings.empty());
  CHECK(read(axes(4)).model.mean == usual.mean);  // RUB
  CHECK(read(axes(0)).model.mean == usual.mean);  // nothing said
  CHECK(read(axes(6), SpzAxes::rub).model.mean == usual.mean);
  checkCloseTo(read(axes(7)).model.mean[0], {-1.0f, 2.0f, 0.5f});  // LUF
  const std::string other("\x02\0\xbe\xad\4\0\0\0abcd", 12);
  CHECK(read(other + axes(6)).model.mean == stored.mean);
  CHECK(read(other + axes(6)).warnings.size() == 1);
  CHECK(messageOf([&] { read(axes(10)); }) ==
        "a.spz: SPZ: axes that are not supported (expected LDB to RUF, 1 to 8, found RFD)");
  CHECK(messageOf([&] { read(axes(99)); }) ==
        "a.spz: SPZ: axes that are not supported (expected LDB to RUF, 1 to 8, found 99)");
  // In one gzip stream they stand behind the splats.
  SpzParts third(3);
  third.flags = 2;
  CHECK(spz(gzipped(third.whole() + axes(6))).model.mean == stored.mean);
  CHECK(spz(third.whole() + axes(6)).model.mean == stored.mean);
}

TEST_CASE("SPZ: every coefficient of SH turns as the functions do") {
  SpzParts parts(4);
  parts.degree = 3;
  parts.streams[5] = std::string(2 * 45, '\x90');  // all 1/8
  const auto read = [&](SpzAxes axes) { return parseSpz(bytesOf(parts.version4()), "a.spz", axes).model; };
  const GaussianModel stored = read(SpzAxes::rdf), turned = read(SpzAxes::rub);
  // y: 1, 9, 11 have an odd power of it, z, xy, ... of the two together (docs/math.md's order).
  const std::vector<int> flipped = {1, 2, 4, 7, 9, 11, 12, 14};
  for (int k = 1; k < 16; ++k) {
    CAPTURE(k);
    const bool flips = std::ranges::find(flipped, k) != flipped.end();
    CHECK(turned.sh[static_cast<std::size_t>(k)].x == (flips ? -stored.sh[static_cast<std::size_t>(k)].x : 0.125f));
  }
}

TEST_CASE("SPZ in several gzip members is read as in one, and nothing else may follow them") {
  const std::string whole = SpzParts(3).whole();
  const GaussianModel model = spz(gzipped(whole)).model;
  for (std::size_t cut = 0; cut <= whole.size(); ++cut) {
    CAPTURE(cut);
    CHECK(spz(gzipped(whole.substr(0, cut)) + gzipped("") + gzipped(whole.substr(cut))).model == model);
  }
  const auto refusal = [](const std::string& bytes) { return messageOf([&] { spz(bytes); }); };
  const std::string packed = gzipped(whole);
  CHECK(refusal(packed + "junk") == "a.spz: 4 bytes follow the gzip stream (expected none)");
  CHECK(refusal(packed + "\x1f") == "a.spz: 1 bytes follow the gzip stream (expected none)");
  CHECK_THAT(refusal(packed + "\x1f\x8b" + "junk"), Contains("a.spz: broken gzip stream: "));
  CHECK(refusal(packed + packed.substr(0, 12)) == "a.spz: gzip stream ends early");
  CHECK(refusal(packed + gzipped("more")) == "a.spz: SPZ: 4 bytes follow the splats (expected none)");
  CHECK(refusal(packed + gzipped(std::string(100 << 20, '\0'))).starts_with("a.spz: too many bytes after the splats"));
}

TEST_CASE("SPZ: zeros that fill the file up are passed over and other bytes are not") {
  SpzParts extended(3);
  extended.flags = 2;
  const std::string axes("\x03\0\xbe\xad\4\0\0\0\6\0\0\0", 12), whole = SpzParts(3).whole();
  for (const std::string& bytes :
       {gzipped(whole), whole, SpzParts(4).version4(), gzipped(extended.whole() + axes), extended.whole() + axes}) {
    const Bundle loaded = spz(bytes);
    for (const std::size_t zeros : {1, 3, 7, 8, 512}) {
      CAPTURE(bytes.size(), zeros);
      const Bundle padded = spz(bytes + std::string(zeros, '\0'));
      CHECK(padded.model == loaded.model);
      CHECK(padded.warnings.empty());
    }
  }
  CHECK(messageOf([&] { spz(gzipped(whole) + std::string(3, '\0') + "x"); }) ==
        "a.spz: 4 bytes follow the gzip stream (expected none)");
  CHECK(messageOf([&] { spz(SpzParts(4).version4() + std::string(3, '\0') + "x"); }) ==
        "a.spz: SPZ: 4 bytes follow the splats (expected none)");
  // Extensions that the header tells of stand in the stream, or before the table of version 4, and nowhere else.
  CHECK(messageOf([&] { spz(gzipped(extended.whole()) + axes); }) ==
        "a.spz: 12 bytes follow the gzip stream (expected none)");
  SpzParts fourth(4);
  fourth.flags = 2;
  CHECK(messageOf([&] { spz(fourth.version4(axes) + axes); }) ==
        "a.spz: SPZ: 12 bytes follow the splats (expected none)");
  // Half a million empty records of type 0: a search for padding at each would take minutes.
  CHECK(spz(extended.whole() + std::string(std::size_t{4} << 20, '\0') + "x").warnings.size() == 1);
}

TEST_CASE("SPZ without gzip around it is read, as some tools write it") {
  CHECK(spz(SpzParts(2).whole()).model.size() == 2);
}

TEST_CASE("SPZ: what the model cannot hold is left out with a warning") {
  SpzParts parts(4);
  parts.flags = 1 | 2;
  const Bundle flagged = spz(parts.version4(std::string("\x02\0\xbe\xad\0\0\0\0", 8)));
  REQUIRE(flagged.warnings.size() == 2);
  CHECK(flagged.warnings[0].find("antialiasing") != std::string::npos);
  CHECK(flagged.warnings[1].find("extensions") != std::string::npos);

  SpzParts fourth(4);
  fourth.degree = 4;
  fourth.streams[5] = std::string(2 * 72, '\x90');
  const Bundle cut = spz(fourth.version4());
  CHECK(cut.model.sh_degree == 3);
  CHECK(cut.model.sh[16 + 15].x == Approx(0.125));
  REQUIRE(cut.warnings.size() == 1);
  CHECK(cut.warnings[0] == "SH of degree 4 is left out");
}

TEST_CASE("SPZ headers that lie are refused before memory is taken") {
  const auto refused = [](SpzParts parts) { return messageOf([&] { spz(gzipped(parts.whole())); }); };
  SpzParts parts(3);
  parts.version = 1;
  CHECK(refused(parts) == "a.spz: SPZ: version 1 is not supported (expected 2, 3 or 4)");
  parts = SpzParts(3);
  parts.count = 0;
  CHECK(refused(parts) == "a.spz: SPZ: wrong number of splats (expected 1 to 64000000, found 0)");
  parts.count = 0xFFFFFFFF;
  CHECK(refused(parts).find("found 4294967295") != std::string::npos);
  parts.count = 60000000;
  CHECK(refused(parts).find("the SPZ payload ends early (expected 1740000000 bytes, found ") != std::string::npos);
  parts = SpzParts(3);
  parts.degree = 5;
  CHECK(refused(parts) == "a.spz: SPZ: wrong SH degree (expected 0 to 4, found 5)");
  parts = SpzParts(3);
  parts.fraction = 24;
  CHECK(refused(parts) == "a.spz: SPZ: wrong number of fractional bits (expected 0 to 23, found 24)");
  CHECK(messageOf([&] { spz(gzipped(SpzParts(3).whole() + "more")); }) ==
        "a.spz: SPZ: 4 bytes follow the splats (expected none)");

  parts = SpzParts(4);
  parts.count = 60000000;
  CHECK(messageOf([&] { spz(parts.version4()); }).find("the file is too short for its 60000000 splats") !=
        std::string::npos);
  parts.count = 3;
  CHECK(messageOf([&] { spz(parts.version4()); }) ==
        "a.spz: SPZ: the stream of positions has a wrong size (expected 27 bytes, found 18)");
  parts = SpzParts(4);
  parts.streams.pop_back();
  CHECK(messageOf([&] { spz(parts.version4()); }) == "a.spz: SPZ: wrong number of streams (expected 6, found 5)");
  parts = SpzParts(4);
  std::string broken = parts.version4();
  broken[32 + 6 * 16] = 'x';  // the first frame's magic number
  CHECK(messageOf([&] { spz(broken); }).find("the stream of positions is broken") != std::string::npos);
}

TEST_CASE("SPZ: truncated and spoilt files are errors or sound models") {
  const auto parse = [](const std::string& bytes) { checkModel(spz(bytes).model, "a.spz"); };
  spoil(gzipped(SpzParts(2).whole()), parse);
  spoil(gzipped(SpzParts(3).whole()), parse);
  spoil(SpzParts(3).whole(), parse);
  spoil(SpzParts(4).version4(), parse);
}

TEST_CASE("compressed PLY: every number where it belongs") {
  for (const bool colored : {true, false}) {
    const GaussianModel model = parseCompressedPly(bytesOf(compressedPly(colored)), "a.ply");
    REQUIRE(model.size() == 300);
    REQUIRE(model.sh_degree == 1);
    checkCloseTo(model.mean[0], {1.0f, -2.0f, -3.0f});
    checkCloseTo(model.mean[299], {11.0f, 8.0f, 7.0f + 6.0f * 299.0f / 2047.0f}, 1e-5f);  // the second chunk
    checkCloseTo(model.log_scale[7], {-6.0f, -2.0f, -3.0f});
    const glm::vec3 color = colored ? glm::vec3(1.5f, 0.0f, 0.55f) : glm::vec3(1.0f, 0.0f, 0.2f);
    checkCloseTo(model.sh[0], (color - 0.5f) / 0.2820948f, 1e-5f);
    CHECK(model.opacity_logit[0] == -20.0f);
    CHECK(model.opacity_logit[255] == 20.0f);
    CHECK(model.opacity_logit[51] == Approx(std::log(0.25)));
    // 10 bits from -sqrt(1/2) to sqrt(1/2); index 0 is w.
    const float a = std::sqrt(0.5f), b = (512 / 1023.0f - 0.5f) * std::sqrt(2.0f);
    const float c = (511 / 1023.0f - 0.5f) * std::sqrt(2.0f), m = std::sqrt(1 - a * a - b * b - c * c);
    const glm::vec4 expected[] = {{m, a, b, c}, {a, m, b, c}, {a, b, m, c}, {a, b, c, m}};
    for (std::size_t i = 0; i < 4; ++i) checkCloseTo(model.rotation[i], expected[i], 1e-6f);
    // Channel-major bytes: red of the three coefficients, then green, then blue.
    const auto value = [](int byte) { return ((static_cast<float>(byte) + 0.5f) / 256.0f - 0.5f) * 8.0f; };
    checkCloseTo(model.sh[1], {-4.0f, value(123), value(126)});
    checkCloseTo(model.sh[2], {value(121), value(124), value(127)});
    checkCloseTo(model.sh[3], {value(122), value(125), 4.0f});
  }
  CHECK(parseCompressedPly(bytesOf(compressedPly(true, false)), "a.ply").sh_degree == 0);
}

TEST_CASE("compressed PLY: counts that disagree and columns of other types are refused by name") {
  const auto refused = [](std::string bytes, const std::string& from, const std::string& to) {
    const std::size_t at = bytes.find(from);
    REQUIRE(at != std::string::npos);
    bytes.replace(at, from.size(), to);
    return messageOf([&] { parseCompressedPly(bytesOf(bytes), "a.ply"); });
  };
  const std::string good = compressedPly();
  CHECK(refused(good, "element chunk 2", "element chunk 1").find("a.ply: ") == 0);
  CHECK(refused(good, "uint packed_scale", "float packed_scale") ==
        "a.ply: property packed_scale is not stored as it must be (expected uint in a binary file)");
  CHECK(refused(good, "uchar f_rest_3", "char f_rest_3") ==
        "a.ply: property f_rest_3 is not stored as it must be (expected uchar)");
  CHECK(refused(good, "max_scale_y", "max_scale_q") == "a.ply: missing property max_scale_y");
  CHECK(refused(good, "f_rest_8", "f_rust_8") ==
        "a.ply: wrong number of f_rest properties (expected 9, 24 or 45, found 8)");
  CHECK(refused(good, "binary_little_endian", "ascii").find("a.ply: ") == 0);
  CHECK(refused(good, "element vertex 300", "element vertex 63000000").find("too short for its counts") !=
        std::string::npos);
  const Scratch scratch;
  const Bundle longer = readModel(scratch.write("a.ply", good + "xyz"));
  REQUIRE(longer.warnings.size() == 1);
  CHECK(longer.warnings[0] == "3 bytes behind the rows are passed over");
}

TEST_CASE("compressed PLY: truncated and spoilt files are errors or sound models") {
  spoil(
      compressedPly(true, true, 3),
      [](const std::string& bytes) { checkModel(parseCompressedPly(bytesOf(bytes), "a.ply"), "a.ply"); }, 2);
}

TEST_CASE(".splat: every number where it belongs, what has no logarithm is repaired or dropped with a warning") {
  const float infinity = std::numeric_limits<float>::infinity();
  const SplatRecord records[] = {
      {{1, 2, 3}, {1, 0.5f, 0.25f}, {255, 0, 128, 51}, {255, 128, 0, 128}},
      {{infinity, 0, 0}, {1, 1, 1}, {0, 0, 0, 255}, {255, 128, 128, 128}},
      {{0, 0, 0}, {-1, 0, 1}, {0, 0, 0, 255}, {128, 128, 128, 128}},
  };
  const std::string bytes(reinterpret_cast<const char*>(records), sizeof(records));
  const Bundle loaded = parseSplat(bytesOf(bytes), "a.splat");
  const GaussianModel& model = loaded.model;
  REQUIRE(model.size() == 2);
  checkModel(model, "a.splat");
  checkCloseTo(model.mean[0], {1, 2, 3});
  checkCloseTo(model.log_scale[0], {0.0f, std::log(0.5f), std::log(0.25f)});
  checkCloseTo(model.rotation[0], {127 / 128.0f, 0.0f, -1.0f, 0.0f}, 1e-6f);
  checkCloseTo(model.sh[0], glm::vec3(0.5f, -0.5f, 128 / 255.0f - 0.5f) / 0.2820948f, 1e-5f);
  CHECK(model.opacity_logit[0] == Approx(std::log(0.25)));
  CHECK(model.opacity_logit[1] == 20.0f);
  checkCloseTo(model.log_scale[1], {0.0f, std::log(1e-4f), 0.0f});
  CHECK(model.rotation[1] == glm::vec4(1, 0, 0, 0));
  CHECK(loaded.repairs == std::vector<std::string>{"1 splats with values that are not finite: dropped",
                                                   "1 splats with a negative scale: sign dropped",
                                                   "1 splats with a quaternion of length 0: not turned"});

  CHECK(messageOf([&] { parseSplat(bytesOf(bytes.substr(0, 33)), "a.splat"); }) ==
        "a.splat: is no .splat file (expected a multiple of 32 bytes, found 33)");
  CHECK(messageOf([&] { parseSplat(bytesOf(bytes.substr(32, 32)), "a.splat"); }) ==
        "a.splat: no splat is left: none had finite values");
}

TEST_CASE("a PLY of others is mended: numbers that are not finite, opacities of 0 and 1, scales of 0, no direction") {
  const float infinity = std::numeric_limits<float>::infinity();
  GaussianModel model;
  resizeGaussians(model, 9, 1);
  for (std::size_t i = 0; i < model.size(); ++i) {
    model.mean[i] = {1, 2, static_cast<float>(i)};
    model.rotation[i] = {0, 1, 0, 0};
    model.log_scale[i] = {-1, -2, -3};
  }
  model.mean[0].y = -infinity;  // dropped
  model.opacity_logit[1] = infinity;
  model.opacity_logit[2] = -infinity;
  model.log_scale[3].x = -infinity;
  model.log_scale[4] = glm::vec3(-infinity);
  model.log_scale[5].z = infinity;  // dropped
  model.rotation[6] = glm::vec4(0.0f);
  model.rotation[7] = {0, 3e30f, 0, -3e30f};
  model.sh[8 * 4 + 3].y = NAN;  // dropped
  const Scratch scratch;
  const std::vector<std::uint8_t> binary = formatSplatPly(model);
  const std::string plain(reinterpret_cast<const char*>(binary.data()), binary.size());
  const auto rows = plain.begin() + static_cast<std::ptrdiff_t>(plain.find("end_header\n") + 11);
  std::string big = std::string(plain.begin(), rows);  // the same numbers in an order that is not read in bulk
  big.replace(big.find("little"), 6, "big");
  for (auto at = rows; at != plain.end(); at += 4) big.append({at[3], at[2], at[1], at[0]});
  for (const std::string& file : {plain, big}) {
    const Bundle loaded = readModel(scratch.write("a.ply", file));
    CHECK(loaded.warnings == std::vector<std::string>{"3 splats with values that are not finite: dropped",
                                                      "1 splats with a quaternion of length 0: not turned"});
    const GaussianModel& mended = loaded.model;
    REQUIRE(mended.size() == 6);
    checkModel(mended, "a.ply");
    CHECK(mended.mean[5] == glm::vec3(1, 2, 7));
    CHECK(mended.opacity_logit[0] == 20.0f);
    CHECK(mended.opacity_logit[1] == -20.0f);
    checkCloseTo(mended.log_scale[2], {-3.0f + std::log(1e-4f), -2.0f, -3.0f});
    checkCloseTo(mended.log_scale[3], glm::vec3(std::log(1e-10f)));
    CHECK(mended.rotation[3] == glm::vec4(0, 1, 0, 0));
    CHECK(mended.rotation[4] == glm::vec4(1, 0, 0, 0));
    CHECK(mended.rotation[5] == glm::vec4(0, 1, 0, -1));
  }
}

TEST_CASE("a PLY that was trained with antialiasing is told by the last comment that speaks of it") {
  const Scratch scratch;
  const std::vector<std::uint8_t> bytes = formatSplatPly(randomSplats(0, 5, 3.0, 7));
  const std::string plain(bytes.begin(), bytes.end());
  for (const std::string& file : {plain, compressedPly()}) {
    const auto warnings = [&](const std::string& comments) {
      std::string commented = file;
      return readModel(scratch.write("a.ply", commented.insert(commented.find("element"), comments))).warnings;
    };
    const std::vector<std::string> told = {"trained with antialiasing, which the model has no word for"};
    CHECK(warnings("comment SplatRenderMode: mip\n") == told);
    CHECK(warnings("comment antialiased 1\r\n") == told);
    CHECK(warnings("comment SplatRenderMode: default\ncomment antialiased 1\n") == told);
    CHECK(warnings("comment antialiased 1\ncomment SplatRenderMode: default\n").empty());
    CHECK(warnings("comment SplatRenderMode: 2dgs\ncomment antialiased 0\n").empty());
    CHECK(warnings("comment not antialiased 1\nobj_info antialiased 1\n").empty());
  }
  scratch.write("a.ply", std::string(plain).insert(plain.find("element"), "comment antialiased 1\n"));
  const ConvertReport streamed =
      convert(scratch.folder() / "a.ply", scratch.folder() / "a.glb", {.measure = Measure::never});
  CHECK(streamed.warnings.size() == 1);
}

TEST_CASE("readModel finds the reader and names the format") {
  const Scratch scratch;
  const SplatRecord record = {{1, 2, 3}, {1, 0.5f, 0.25f}, {255, 0, 128, 51}, {255, 128, 0, 128}};
  const std::string splat(reinterpret_cast<const char*>(&record), sizeof(record));
  CHECK(readModel(scratch.write("a.splat", splat)).format == "splat");
  CHECK(readModel(scratch.write("b.bin", SpzParts(4).version4())).format == "spz");
  CHECK(readModel(scratch.write("c.tgz", gzipped(SpzParts(3).whole()))).format == "spz");
  CHECK(readModel(scratch.write("d.ply", compressedPly())).format == "compressed.ply");
}
