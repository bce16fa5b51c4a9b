// SPDX-License-Identifier: Apache-2.0
// Numbers and texels of a GLB in steps: how near they stay, and what they cost.
#include <cmath>
#include <cstring>
#include <limits>

#include "converter/check.h"
#include "converter/convert.h"
#include "converter/edit/quality.h"
#include "converter/formats/space_curve.h"
#include "converter/formats/texel_spread.h"
#include "converter/glb.h"
#include "converter/gltf/meshopt.h"
#include "converter/gltf/quantize.h"
#include "converter/gltf/read_gltf.h"
#include "converter/gltf/write_gltf.h"
#include "converter/scratch.h"
#include "core/model/fallback.h"
#include "core/model/verbs.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/scenes.h"

using namespace tg;
using tg::test::SceneKind;

namespace {

std::string withoutMeshopt() { return hasMeshopt() ? std::string() : std::string(missingMeshopt()); }

std::vector<std::uint8_t> bytesOf(const std::vector<float>& numbers) {
  std::vector<std::uint8_t> bytes(numbers.size() * sizeof(float));
  std::memcpy(bytes.data(), numbers.data(), bytes.size());
  return bytes;
}

std::vector<std::uint8_t> packedBy(const std::vector<std::uint8_t>& bytes, std::size_t stride,
                                   const MeshoptFilter& filter) {
  const FilteredView filtered = filterForMeshopt(bytes, stride, filter);
  return packMeshopt(filtered.bytes, filtered.stride);
}

}  // namespace

TEST_CASE("floats in steps come back from the packed stream as the nearest multiples, and few bits cost few bytes") {
  TG_SKIP_IF(withoutMeshopt());
  test::Random random(5);
  for (const double range : {0.9, 100.0, 1e4, 1e9}) {  // [steps of 2^-3]: mantissas of 8, 16, 24 bits and too many
    std::vector<float> numbers;
    for (int i = 0; i < 999; ++i) numbers.push_back(static_cast<float>(random.uniform(-range, range)));
    // One far out has steps of its own, and the others theirs.
    if (range == 1e4) numbers[500] = -std::numeric_limits<float>::max();
    std::vector<std::uint8_t> bytes = bytesOf(numbers);
    roundToSteps(bytes, -3);
    CAPTURE(range);
    const std::vector<std::uint8_t> packed = packedBy(bytes, 12, {.kind = MeshoptFilter::Kind::fixed, .exponent = -3});
    CHECK(unpackMeshopt(packed, 333, 12, "ATTRIBUTES", "EXPONENTIAL", "a") == bytes);
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      float stored;
      std::memcpy(&stored, bytes.data() + 4 * i, sizeof(stored));
      const double unit = std::max(0.125, std::exp2(std::ilogb(numbers[i]) - 21));
      const bool outermost = numbers[i] == -std::numeric_limits<float>::max();  // whose nearest multiple no float holds
      REQUIRE(std::abs(static_cast<double>(stored) - static_cast<double>(numbers[i])) <= (outermost ? 1 : 0.5) * unit);
      REQUIRE(std::remainder(stored, unit) == 0);
    }
    // Seven steps to either side are 4 bits a number and some more for large differences; bytes that hold a mere sign
    // would cost 4 bits beside them.
    if (range < 1) CHECK(packed.size() < 999);
  }
}

TEST_CASE("rotations of fewer bits are as near as the bits say, and pack better than the filter's own") {
  TG_SKIP_IF(withoutMeshopt());
  test::Random random(6);
  std::vector<float> numbers;
  for (int i = 0; i < 500; ++i) {
    const glm::vec4 q(random.quaternion());
    numbers.insert(numbers.end(), {q.x, q.y, q.z, q.w});
  }
  const std::vector<std::uint8_t> bytes = bytesOf(numbers);
  const std::vector<std::uint8_t> packed =
      packedBy(bytes, 16, {.kind = MeshoptFilter::Kind::quaternion, .bits = 8, .rounded = true});
  const std::vector<std::uint8_t> plain = packedBy(bytes, 16, {.kind = MeshoptFilter::Kind::quaternion, .bits = 8});
  CHECK(packed.size() < plain.size());
  const std::vector<std::uint8_t> out = unpackMeshopt(packed, 500, 8, "ATTRIBUTES", "QUATERNION", "a");
  for (std::size_t i = 0; i < 500; ++i) {
    double dot = 0, square = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      std::int16_t component;
      std::memcpy(&component, out.data() + 8 * i + 2 * k, sizeof(component));
      dot += component / 32767.0 * static_cast<double>(numbers[4 * i + k]);
      square += component / 32767.0 * component / 32767.0;
    }
    REQUIRE(std::abs(std::sqrt(square) - 1) < 1e-3);
    REQUIRE(std::abs(dot) > std::cos(0.015));  // three components off by half of 0.707 / 127, and one that follows
  }
}

TEST_CASE("a GLB in steps: near at 1, smaller and coarser the wider they are, in an order that is told") {
  TG_SKIP_IF(withoutMeshopt());
  const Scratch scratch;
  const auto path = scratch.folder() / "a.glb";
  const SceneKind kind = GENERATE(SceneKind::ordinary, SceneKind::mixed);
  test::TestScene scene = test::makeScene(kind, 71, 400);
  scene.model.texture_mode = GENERATE(TextureMode::rgba, TextureMode::rgb, TextureMode::alpha, TextureMode::none);
  if (!isTextured(scene.model)) scene.model = withoutTextures(scene.model);
  const std::vector<Camera> views = {scene.camera};
  double last_psnr = std::numeric_limits<double>::infinity();
  std::uint64_t last_bytes = std::numeric_limits<std::uint64_t>::max();
  for (const float steps : {kLeastSteps, 1.0f, 8.0f, kMostSteps}) {
    CAPTURE(test::name(kind), name(scene.model.texture_mode), steps);
    const GltfContent content = {scene.model, {}, glm::vec3(0.0f), {.atlas = AtlasFormat::webp, .steps = steps}};
    const GltfReport report = writeGlb(path, content);
    const std::string bytes = Glb::slurp(path);
    CHECK(report.order == hilbertOrder(scene.model.mean));
    const GaussianModel sorted = select(scene.model, report.order), out = readGltf(path).model;
    REQUIRE(out.size() == sorted.size());
    const double psnr = renderedPsnr(sorted, out, views, glm::vec3(0.0f));
    CAPTURE(psnr);
    CHECK(psnr < last_psnr);
    if (steps <= 1) CHECK(psnr > 39);
    CHECK(report.output_bytes < last_bytes);
    last_psnr = psnr;
    last_bytes = report.output_bytes;
    Glb glb = Glb::read(path);
    CHECK(!glb.primitive()["attributes"].contains("COLOR_0"));
    CHECK(checkFile(path).errors.empty());
    CHECK(checkFile(path).warnings.empty());
    glm::vec3 low(1e9f), high(-1e9f);
    for (const glm::vec3& mean : out.mean) {
      low = glm::min(low, glm::vec3(-mean.x, -mean.y, mean.z));
      high = glm::max(high, glm::vec3(-mean.x, -mean.y, mean.z));
    }
    for (int k = 0; k < 3; ++k) {  // of the numbers as they are read, not as they were
      CHECK(glb.accessor("POSITION")["min"][k].get<float>() == low[k]);
      CHECK(glb.accessor("POSITION")["max"][k].get<float>() == high[k]);
    }
    writeGlb(path, content);
    CHECK(Glb::slurp(path) == bytes);
  }
}

TEST_CASE("texels in steps are rounded once, by at most what their weight allows, and stored as they are") {
  const Scratch scratch;
  const double step = GENERATE(1.0 / 512, 1.0 / 32, 1.0 / 8);
  const GaussianModel model = test::makeScene(SceneKind::mixed, 72, 200).model;
  const GaussianModel base = bakeFallback(model, FallbackScale::kept);
  const TexelSteps steps = texelStepsOf(model.atlas, step);
  const TextureAtlas atlas = texelsInSteps(model, base, steps);
  for (std::size_t i = 0; i < model.size(); ++i) {
    const TextureRect rect = model.atlas.rects[i];
    if (rect.texelCount() == 0) continue;
    const std::vector<double> spreads = texelSpreads(rect.width, rect.height);
    for (std::uint32_t t = 0; t < rect.texelCount(); ++t) {
      const glm::vec4 from = model.atlas.texels[rect.offset + t], to = atlas.texels[rect.offset + t];
      const double spread = spreads[t] * opacitySpread(opacityOf(base, i)) * std::sqrt(2.0);  // nearest power of 2
      for (int c = 0; c < 4; ++c) {
        const double unit = std::max((c < 3 ? 1 : 2) * step * spread, c < 3 ? steps.units[c] : 1.0 / 255);
        REQUIRE(std::abs(to[c] - from[c]) <= 0.601 * unit);  // half, and the dead zone
      }
    }
  }
  writeGlb(scratch.folder() / "a.glb", {model, {}, glm::vec3(0.0f), {.texture_step = static_cast<float>(step)}});
  const GaussianModel out = readGltf(scratch.folder() / "a.glb").model;
  REQUIRE(out.atlas.texels.size() == atlas.texels.size());
  std::size_t differing = 0;
  for (std::size_t i = 0; i < model.size(); ++i) {
    for (std::uint32_t t = 0; t < atlas.rects[i].texelCount(); ++t) {
      const glm::vec4 d =
          glm::abs(out.atlas.texels[out.atlas.rects[i].offset + t] - atlas.texels[atlas.rects[i].offset + t]);
      if (std::max({d.x, d.y, d.z, d.w}) > 1e-5f) ++differing;
    }
  }
  CHECK(static_cast<double>(differing) <=
        0.004 * static_cast<double>(atlas.texels.size()));  // beyond a percentile of 3
}

TEST_CASE("what rounding takes from the mean of a texture stays in its Gaussian") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(SceneKind::mixed, 74, 200).model;
  model.texture_mode = GENERATE(TextureMode::rgba, TextureMode::rgb, TextureMode::alpha);
  // Opacities stay below 1 whatever is taken from alpha.
  for (float& logit : model.opacity_logit) logit = std::min(logit, 0.0f);
  for (glm::vec4& texel : model.atlas.texels) texel.a = 0.7f + 0.3f * texel.a;
  const auto path = scratch.folder() / "a.glb";
  writeGlb(path, {model, {}, glm::vec3(0.0f), {.texture_step = 0.25f}});
  const GaussianModel out = readGltf(path).model;
  REQUIRE(out.atlas.texels != model.atlas.texels);
  const GaussianModel before = bakeFallback(model, FallbackScale::kept), after = bakeFallback(out, FallbackScale::kept);
  for (std::size_t i = 0; i < model.size(); ++i) {
    CAPTURE(name(model.texture_mode), i);
    const glm::vec3 d = glm::abs(after.sh[i * after.shCount()] - before.sh[i * before.shCount()]);
    REQUIRE(std::max({d.x, d.y, d.z}) < 1e-4f);
    REQUIRE(std::abs(opacityOf(after, i) - opacityOf(before, i)) < 1e-5);
    const TextureRect rect = model.atlas.rects[i];
    if (rect.texelCount() > 0) continue;
    REQUIRE(out.opacity_logit[i] == model.opacity_logit[i]);
    REQUIRE(out.sh[i * out.shCount()] == model.sh[i * model.shCount()]);
  }
}

TEST_CASE("steps want atlases of 8 bits, and say so") {
  const Scratch scratch;
  const GaussianModel model = test::makeScene(SceneKind::ordinary, 73, 20).model;
  for (const AtlasFormat atlas : {AtlasFormat::png16, AtlasFormat::exr}) {
    const std::string message = test::messageOf(
        [&] {
          writeGlb(scratch.folder() / "a.glb", {model, {}, glm::vec3(0.0f), {.atlas = atlas, .texture_step = 0.1f}});
        },
        ErrorKind::usage);
    CHECK(message.find("texels in steps have 8 bits (expected --atlas png8 or webp, found " +
                       std::string(name(atlas))) != std::string::npos);
  }
}
