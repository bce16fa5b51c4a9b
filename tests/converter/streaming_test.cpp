// SPDX-License-Identifier: Apache-2.0
// Files that are converted block by block, and what the summary says of the pictures.
#include "converter/convert.h"
#include "converter/gltf/read_gltf.h"
#include "converter/gltf/write_gltf.h"
#include "core/bundle/bundle.h"
#include "core/bundle/ply.h"
#include "core/file/file.h"
#include "edits.h"
#include "glb.h"
#include "scratch.h"
#include "support/catch.h"

using namespace tg;
using tg::test::Random;
using tg::test::SceneKind;

namespace {

// More than a block that is written at once, and no whole number of them.
constexpr std::size_t kMany = 33'333;

GaussianModel manyGaussians(int sh_degree) {
  Random random(77);
  GaussianModel model;
  model.sh_degree = sh_degree;
  for (std::size_t i = 0; i < kMany; ++i) {
    model.mean.push_back(glm::vec3(random.uniform(-5, 5), random.uniform(-5, 5), random.uniform(-5, 5)));
    model.rotation.push_back(glm::vec4(random.uniform(0.1, 1), random.uniform(-1, 1), random.uniform(-1, 1), 0.5f));
    model.log_scale.push_back(glm::vec3(random.uniform(-6, -2), random.uniform(-6, -2), random.uniform(-6, -2)));
    model.opacity_logit.push_back(static_cast<float>(random.uniform(-4, 4)));
    for (std::size_t k = 0; k < model.shCount(); ++k) model.sh.emplace_back(random.uniform(-1, 1), 0.25f, -0.5f);
  }
  return model;
}

std::size_t filesIn(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

// [dB], peak 1, of values clamped to what a screen shows.
double shownPsnr(const FrameT<double>& a, const FrameT<double>& b) {
  double sum = 0.0;
  for (std::size_t p = 0; p < a.base.size(); ++p) {
    const glm::dvec3 d = glm::clamp(a.color(p), 0.0, 1.0) - glm::clamp(b.color(p), 0.0, 1.0);
    sum += glm::dot(d, d);
  }
  return -10.0 * std::log10(sum / (3.0 * static_cast<double>(a.base.size())));
}

}  // namespace

TEST_CASE("a GLB is the same model read from the file in blocks, all at once, and from memory") {
  const Scratch scratch;
  const auto file = scratch.folder() / "a.glb";
  GaussianModel model = manyGaussians(1);
  model.texture_mode = TextureMode::rgba;
  model.atlas.rects.resize(kMany);
  Random random(3);
  for (std::size_t i = 5; i < kMany; i += 1000) {
    model.atlas.rects[i] = {static_cast<std::uint32_t>(model.atlas.texels.size()), 2, 2};
    for (int t = 0; t < 4; ++t) model.atlas.texels.emplace_back(random.uniform(0, 1), random.uniform(0, 1), 0.5, 0.25);
  }
  for (const AtlasFormat atlas : {AtlasFormat::png8, AtlasFormat::exr}) {
    GltfContent content{.model = model, .cameras = {}};
    content.options.atlas = atlas;
    writeGlb(file, content);
    std::vector<std::string> errors;
    const GaussianModel in_blocks = readGltf(file).model, at_once = readGltf(file, {.errors = &errors}).model,
                        from_memory = parseGltf(readFile(file, 1 << 28), "a.glb").model;
    CHECK(errors.empty());
    REQUIRE(in_blocks.size() == kMany);
    CHECK(in_blocks.mean == model.mean);
    for (const GaussianModel& other : {at_once, from_memory}) {
      CHECK(in_blocks == other);
    }
    CHECK(in_blocks.atlas.rects[5005].texelCount() == 4);
  }
}

TEST_CASE("a PLY becomes the same GLB block by block as from memory, byte for byte") {
  const Scratch scratch;
  const auto ply = scratch.folder() / "in.ply", streamed = scratch.folder() / "a.glb",
             whole = scratch.folder() / "b.glb";
  for (const int degree : {0, 3}) {
    const GaussianModel model = manyGaussians(degree);
    writeSplatPly(ply, model);
    for (const bool lean : {false, true}) {
      for (const bool quantize : {false, true}) {
        CAPTURE(degree, lean, quantize);
        const ConvertReport report =
            convert(ply, streamed, {.overwrite = true, .measure = Measure::never, .lean = lean, .quantize = quantize});
        GltfContent content = {.model = model, .cameras = {}, .knows_background = false};
        content.options.lean = lean;
        content.options.quantize = quantize;
        writeGlb(whole, content);
        CHECK(Glb::slurp(streamed) == Glb::slurp(whole));
        CHECK(report.input_format == "ply");
        CHECK(report.gaussians == kMany);
        CHECK(report.sh_degree == degree);
        CHECK(report.output_bytes == std::filesystem::file_size(streamed));
        CHECK(report.input_bytes == std::filesystem::file_size(ply));
        CHECK(report.texture_mode == "none");
      }
    }
    convert(ply, scratch.folder() / "a.gltf", {.overwrite = true});
    writeGltf(scratch.folder() / "b.gltf", {.model = model, .cameras = {}, .knows_background = false});
    CHECK(Glb::slurp(scratch.folder() / "a.bin") == Glb::slurp(scratch.folder() / "b.bin"));
  }
  Glb glb = Glb::read(streamed);
  glm::vec3 low(1e9f), high(-1e9f);
  for (const glm::vec3& mean : readModel(ply).model.mean) {
    low = glm::min(low, glm::vec3(-mean.x, -mean.y, mean.z));
    high = glm::max(high, glm::vec3(-mean.x, -mean.y, mean.z));
  }
  const auto& position = glb.json["accessors"][glb.primitive()["attributes"]["POSITION"].get<std::size_t>()];
  for (int k = 0; k < 3; ++k) {
    CHECK(position["min"][static_cast<std::size_t>(k)].get<float>() == low[k]);
    CHECK(position["max"][static_cast<std::size_t>(k)].get<float>() == high[k]);
  }
}

TEST_CASE("a PLY with a broken value is converted without that splat, as it would be in one piece") {
  const Scratch scratch;
  const auto ply = scratch.folder() / "in.ply";
  const auto out = scratch.folder() / "out.glb";
  GaussianModel model = manyGaussians(1);
  model.sh[4 * 33'000 + 2].z = NAN;
  const auto write = [&] {
    const std::vector<std::uint8_t> bytes = formatSplatPly(model);
    scratch.write("in.ply", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  };
  write();
  for (const bool dry_run : {true, false}) {
    const ConvertReport report = convert(ply, out, {.dry_run = dry_run});
    CHECK(report.gaussians == kMany - 1);
    CHECK(report.warnings == std::vector<std::string>{"1 splats with values that are not finite: dropped"});
    CHECK(filesIn(scratch.folder()) == (dry_run ? 1 : 2));
  }
  writeGlb(scratch.folder() / "whole.glb", {.model = readModel(ply).model, .cameras = {}, .knows_background = false});
  CHECK(Glb::slurp(out) == Glb::slurp(scratch.folder() / "whole.glb"));
  for (glm::vec3& mean : model.mean) mean.x = INFINITY;
  write();
  CHECK_THROWS_WITH(convert(ply, out, {.overwrite = true}),
                    ply.string() + ": no splat is left: none had finite values");
}

TEST_CASE("a PLY that ends early is refused, and leaves nothing") {
  const Scratch scratch;
  const auto ply = scratch.folder() / "in.ply";
  writeSplatPly(ply, manyGaussians(1));
  std::filesystem::resize_file(ply, std::filesystem::file_size(ply) - 1);
  CHECK_THROWS_WITH(convert(ply, scratch.folder() / "out.glb"), Contains("too short for its counts"));
  CHECK(filesIn(scratch.folder()) == 1);
}

TEST_CASE("what is no file is refused as such") {
  const Scratch scratch;
  CHECK_THROWS_WITH(convert(scratch.folder() / "none.ply", scratch.folder() / "a.glb"), Contains("none.ply: "));
  CHECK_THROWS_AS(convert(scratch.folder(), scratch.folder() / "a.glb"), Error);
}

TEST_CASE("pictures are compared where textures or rounding change them, or when asked for") {
  const Scratch scratch;
  const auto to = [&](const char* name) { return scratch.folder() / name; };
  test::TestScene scene = test::makeScene(SceneKind::ordinary, 4);
  scene.model.texture_mode = TextureMode::none;
  scene.model.atlas = {};
  writeSplatPly(to("in.ply"), scene.model);
  CHECK(convert(to("in.ply"), to("a.glb")).views == 0);
  CHECK(convert(to("in.ply"), to("a.tgz")).views == 0);
  CHECK(convert(to("in.ply"), to("a.spz")).views == 4);
  CHECK(convert(to("in.ply"), to("b.spz"), {.measure = Measure::never}).views == 0);
  CHECK(convert(to("in.ply"), to("q.glb"), {.quantize = true}).views == 4);
  const ConvertReport asked = convert(to("in.ply"), to("b.glb"), {.measure = Measure::always});
  CHECK(asked.views == 4);
  REQUIRE(asked.deviation);
  CHECK(asked.deviation->isZero());
  CHECK(std::isinf(*asked.textured_psnr));
}

TEST_CASE("a Gaussian as far out as floats reach is converted and rendered") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(SceneKind::ordinary, 4, 1).model;
  model.texture_mode = TextureMode::none;
  model.atlas = {};
  for (const float far : {1e20f, 3e38f}) {
    for (const float log_scale : {-1e4f, 0.0f, 1e4f}) {
      CAPTURE(far, log_scale);
      model.mean = {{far, -far, far}};
      model.log_scale = {glm::vec3(log_scale)};
      writeSplatPly(scratch.folder() / "in.ply", model);
      const ConvertReport report = convert(scratch.folder() / "in.ply", scratch.folder() / "out.ply",
                                           {.overwrite = true, .measure = Measure::always});
      // The same model: the same pictures, where they show it.
      CHECK((!report.textured_psnr || std::isinf(*report.textured_psnr)));
    }
  }
}

TEST_CASE("a model without Gaussians is converted and rendered, and edited no further") {
  const Scratch scratch;
  const auto in = scratch.folder() / "in.ply";
  writeSplatPly(in, GaussianModel());
  ConvertOptions options = {.overwrite = true, .measure = Measure::always};
  CHECK(!convert(in, scratch.folder() / "out.ply", options).textured_psnr);  // nothing shows
  options.edits = {{"--decimate", "50%"}};
  CHECK_THROWS_AS(convert(in, scratch.folder() / "out.ply", options), Error);
}

TEST_CASE("the summary's figures are those of the float64 renderer") {
  const Scratch scratch;
  for (const SceneKind kind : {SceneKind::flat, SceneKind::mixed}) {
    CAPTURE(test::name(kind));
    const test::TestScene scene = test::makeScene(kind, 19, 80, 64, 48);
    Bundle bundle;
    bundle.model = scene.model;
    bundle.cameras = {scene.camera};
    writeBundle(scratch.folder() / "in.tgz", bundle);
    const GaussianModel source = readModel(scratch.folder() / "in.tgz").model;  // texels as half floats
    const auto glb = scratch.folder() / "out.glb";
    const ConvertReport report = convert(scratch.folder() / "in.tgz", glb, {.overwrite = true});
    REQUIRE(report.textured_psnr);
    REQUIRE(report.base_psnr);
    ReadOptions base_only;
    base_only.base_only = true;
    const FrameT<double> before = referenceFrame(source, scene.camera);
    const double base = shownPsnr(before, referenceFrame(readModel(glb, base_only).model, scene.camera));
    CHECK(*report.base_psnr == Approx(base).margin(0.02));
    const double textured = shownPsnr(before, referenceFrame(readModel(glb).model, scene.camera));
    CHECK(textured > base + 10.0);
    CHECK(*report.textured_psnr == Approx(textured).margin(0.2));  // float pictures differ from float64 ones at 80 dB
  }
}
