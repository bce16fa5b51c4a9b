// SPDX-License-Identifier: Apache-2.0
// Compressed PLY comes back within the steps of its chunks, and says what they could not hold.
#include "converter/formats/write_compressed_ply.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "converter/convert.h"
#include "converter/formats/read_compressed_ply.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "converter/splat_files.h"
#include "core/bundle/ply.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"

using namespace tg;

namespace {

GaussianModel parse(const std::vector<std::uint8_t>& bytes) { return parseCompressedPly(bytes, "a.ply"); }

// Of the 256 Gaussians from `first` on, for each axis.
glm::dvec3 rangeOf(const std::vector<glm::vec3>& vectors, std::size_t first) {
  glm::dvec3 low(vectors[first]), high(low);
  for (std::size_t i = first; i < std::min(first + 256, vectors.size()); ++i) {
    low = glm::min(low, glm::dvec3(vectors[i]));
    high = glm::max(high, glm::dvec3(vectors[i]));
  }
  return high - low;
}

void checkWithin(glm::vec3 a, glm::vec3 b, glm::dvec3 bound) {
  CAPTURE(a.x, a.y, a.z, b.x, b.y, b.z, bound.x, bound.y, bound.z);
  for (int k = 0; k < 3; ++k) CHECK(std::abs(static_cast<double>(a[k]) - static_cast<double>(b[k])) <= bound[k]);
}

}  // namespace

TEST_CASE("a model comes back from compressed PLY within the steps of its chunks, at every degree") {
  for (int degree = 0; degree <= 3; ++degree) {
    const GaussianModel model = randomSplats(degree, 600, 20.0, degree + 90);
    CompressedPlyReport report;
    const GaussianModel out = parse(formatCompressedPly(model, report));
    REQUIRE(out.size() == 600);
    REQUIRE(out.sh_degree == degree);
    CHECK(report.clipped_sh == 0);
    const GaussianModel in = select(model, report.order);
    const std::size_t row = in.shCount();
    std::vector<glm::vec3> means(in.mean.begin(), in.mean.end()), scales(in.log_scale.begin(), in.log_scale.end()), dc;
    for (std::size_t i = 0; i < in.size(); ++i) dc.push_back(in.sh[i * row]);
    const glm::dvec3 half_steps = 0.5 / glm::dvec3(2047, 1023, 2047);
    for (std::size_t i = 0; i < in.size(); ++i) {
      CAPTURE(degree, i);
      const std::size_t chunk = i / 256 * 256;
      checkWithin(in.mean[i], out.mean[i], half_steps * rangeOf(means, chunk) + 1e-5);
      checkWithin(in.log_scale[i], out.log_scale[i], half_steps * rangeOf(scales, chunk) + 1e-5);
      checkWithin(in.sh[i * row], out.sh[i * row], 0.5 / 255 * rangeOf(dc, chunk) + 1e-5);
      CHECK(std::abs(opacityOf(in, i) - opacityOf(out, i)) <= 0.5 / 255 + 1e-6);
      // Three numbers are off by half a step of sqrt(2) / 1023 at most, the fourth follows from them.
      const glm::dvec4 a = glm::normalize(glm::dvec4(in.rotation[i])), b = glm::normalize(glm::dvec4(out.rotation[i]));
      CHECK(std::abs(glm::dot(a, b)) > 1.0 - 3e-6);
      // The middles of steps of 1/32.
      for (std::size_t k = 1; k < row; ++k) {
        checkWithin(in.sh[i * row + k], out.sh[i * row + k], glm::dvec3(1.0 / 64 + 1e-6));
      }
    }
  }
}

TEST_CASE("compressed PLY far from the origin comes back within half a step of its chunk and of a float") {
  GaussianModel model = randomSplats(0, 600, 20.0, 96);
  for (glm::vec3& mean : model.mean) mean += 1e5f;
  CompressedPlyReport report;
  const GaussianModel out = parse(formatCompressedPly(model, report));
  const GaussianModel in = select(model, report.order);
  const double half_float = 0.5 / 128;  // of those from 65536 to 131072
  for (std::size_t i = 0; i < in.size(); ++i) {
    const glm::dvec3 range = rangeOf(in.mean, i / 256 * 256);
    checkWithin(in.mean[i], out.mean[i], 0.5 / glm::dvec3(2047, 1023, 2047) * range + half_float + 1e-9);
  }
}

TEST_CASE("compressed PLY: every Gaussian is there once, neighbours in one chunk, the same bytes each time") {
  const GaussianModel model = randomSplats(1, 2048, 10.0, 94);
  CompressedPlyReport report, again;
  const std::vector<std::uint8_t> bytes = formatCompressedPly(model, report);
  CHECK(formatCompressedPly(model, again) == bytes);
  std::vector<std::uint32_t> sorted = report.order, all(2048);
  std::sort(sorted.begin(), sorted.end());
  std::iota(all.begin(), all.end(), 0);
  CHECK(sorted == all);
  const GaussianModel ordered = select(model, report.order);
  const std::vector<glm::vec3> means(ordered.mean.begin(), ordered.mean.end());
  // Eight chunks of a filled cube: in any order without sense each would span nearly all of it.
  double volume = 0.0;
  for (std::size_t chunk = 0; chunk < 2048; chunk += 256) {
    const glm::dvec3 range = rangeOf(means, chunk);
    volume += range.x * range.y * range.z;
  }
  CHECK(volume < 3.0 * 8000.0);
}

TEST_CASE("compressed PLY: the header and a Gaussian alone are the published layout, byte by byte") {
  GaussianModel model = randomSplats(1, 1, 1.0, 95);
  model.mean[0] = {1.0f, 2.0f, 3.0f};
  model.log_scale[0] = {-1.0f, -2.0f, -3.0f};
  model.rotation[0] = {0.0f, 0.0f, -2.0f, 0.0f};  // y the largest
  model.opacity_logit[0] = 0.0f;
  model.sh = {glm::vec3(0.0f), {-4.0f, 0.0f, 4.0f}, {-9.0f, 0.03125f, 9.0f}, {1.0f, 2.0f, 3.0f}};
  ByteWriter expected;
  // The header is the one of the files that other programs write, but for their comments.
  const std::string theirs = compressedPly(true, true, 1);
  expected.bytes = theirs.substr(0, theirs.find("end_header\n") + 11);
  for (const float value : {1.0f, 2.0f, 3.0f, 1.0f, 2.0f, 3.0f, -1.0f, -2.0f, -3.0f, -1.0f, -2.0f, -3.0f}) {
    expected.add(value);
  }
  for (int k = 0; k < 6; ++k) expected.add(0.5f);
  expected.add(std::uint32_t{0});                                          // the box is a point
  expected.add(std::uint32_t{2u << 30 | 512u << 20 | 512u << 10 | 512u});  // w, x and z are 0: of 1023 steps 511.5
  expected.add(std::uint32_t{0});
  expected.add(std::uint32_t{128});
  // Red of the three coefficients, green, blue: floor((value / 8 + 0.5) * 256).
  for (const int byte : {0, 0, 160, 128, 129, 192, 255, 255, 224}) expected.add(static_cast<std::uint8_t>(byte));
  CompressedPlyReport report;
  const std::vector<std::uint8_t> bytes = formatCompressedPly(model, report);
  CHECK(std::string(bytes.begin(), bytes.end()) == expected.bytes);
  CHECK(report.clipped_sh == 1);
}

TEST_CASE("compressed PLY is chosen by both of its extensions, and measured against the model in its order") {
  const Scratch scratch;
  const auto ply = scratch.folder() / "in.ply", packed = scratch.folder() / "a.b.compressed.ply";
  writeSplatPly(ply, randomSplats(2, 500, 3.0, 96));
  const ConvertReport dry = convert(ply, packed, {.dry_run = true});
  const ConvertReport report = convert(ply, packed);
  CHECK(report.output_format == "compressed.ply");
  CHECK(dry.output_bytes == report.output_bytes);
  CHECK(readModel(packed).format == "compressed.ply");
  REQUIRE(report.deviation);
  CHECK(report.deviation->mean < 0.01);  // in another order they would be up to 10 apart
  CHECK(report.deviation->opacity < 0.003);
  REQUIRE(report.textured_psnr);
  CHECK(*report.textured_psnr > 35.0);
  CHECK(outputFormat("compressed.ply").name == "ply");
  CHECK(outputFormat("a.compressed.ply").name == "compressed.ply");
  CHECK(test::messageOf([] { outputFormat(".ply"); }, ErrorKind::usage).ends_with(", found \"\")"));
  CHECK(test::messageOf([&] {
          writeCompressedPly(scratch.folder() / "b.compressed.ply", {});
        }).ends_with(": the model has no Gaussians"));
}
