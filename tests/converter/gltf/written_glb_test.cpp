// SPDX-License-Identifier: Apache-2.0
// What is written follows KHR_gaussian_splatting and docs/gltf.md to the letter.
#include <cmath>
#include <limits>
#include <map>

#include "converter/check.h"
#include "converter/edit/quality.h"
#include "converter/glb.h"
#include "converter/gltf/axes.h"
#include "converter/gltf/meshopt.h"
#include "converter/gltf/quantize.h"
#include "converter/gltf/write_gltf.h"
#include "converter/registry/file_format.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "core/image/image.h"
#include "core/model/fallback.h"
#include "core/model/verbs.h"
#include "support/catch.h"

using namespace tg;
using tg::test::SceneKind;

namespace {

Glb written(const GaussianModel& model, const Scratch& scratch) {
  writeGlb(scratch.folder() / "written.glb", {model, {}, glm::vec3(0.0f)});
  return Glb::read(scratch.folder() / "written.glb");
}

Image atlasImage(const Glb& glb, int texture) {
  const auto& image = glb.json["images"][glb.json["textures"][texture]["source"].get<int>()];
  const auto& view = glb.json["bufferViews"][image["bufferView"].get<int>()];
  const std::string bytes = glb.bin.substr(view.value("byteOffset", 0), view["byteLength"].get<std::size_t>());
  return decodeImage({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, "atlas");
}

}  // namespace

TEST_CASE("the base is plain KHR_gaussian_splatting that asks nothing of a reader") {
  const Scratch scratch;
  for (int degree = 0; degree <= 3; ++degree) {
    GaussianModel model = test::makeScene(SceneKind::ordinary, 21, 40).model;
    setShDegree(model, degree);
    Glb glb = written(model, scratch);
    CHECK(glb.json["asset"]["version"] == "2.0");
    CHECK(glb.json["extensionsUsed"] == nlohmann::json({"KHR_gaussian_splatting", "TG_gaussian_splatting_texture"}));
    CHECK(!glb.json.contains("extensionsRequired"));
    CHECK(glb.primitive()["mode"] == 0);
    CHECK(glb.splatting()["kernel"] == "ellipse");
    CHECK(glb.splatting()["colorSpace"] == "srgb_rec709_display");
    const auto& node = glb.json["nodes"][0];
    for (const char* key : {"matrix", "translation", "rotation", "scale"}) CHECK(!node.contains(key));
    std::size_t coefficients = 0;
    for (const auto& [name, accessor] : glb.primitive()["attributes"].items()) {
      CHECK(glb.accessor(name)["count"] == model.size());
      if (name.rfind("KHR_gaussian_splatting:SH_DEGREE_", 0) == 0) ++coefficients;
    }
    CHECK(coefficients == model.shCount());
    for (const auto& view : glb.json["bufferViews"]) CHECK(view.value("byteOffset", 0) % 4 == 0);
  }
}

TEST_CASE("several primitives share their views, have bounds of their own, and are read as the model that they were") {
  const Scratch scratch;
  const GaussianModel model = test::makeScene(SceneKind::ordinary, 21, 40).model;
  const GaussianModel whole = [&] {
    writeGlb(scratch.folder() / "whole.glb", {model, {}, glm::vec3(0.0f)});
    return readModel(scratch.folder() / "whole.glb").model;
  }();
  for (const bool packed : {false, true}) {
    if (packed && !hasMeshopt()) continue;
    CAPTURE(packed);
    const auto path = scratch.folder() / "parts.glb";
    writeGlb(path, {model, {}, glm::vec3(0.0f), {.meshopt = packed, .parts = {13, 20}}});
    const Glb glb = Glb::read(path);
    const auto& primitives = glb.json["meshes"][0]["primitives"];
    REQUIRE(primitives.size() == 3);
    const std::size_t ends[] = {0, 13, 20, model.size()};
    for (std::size_t p = 0; p < 3; ++p) {
      const auto& position = glb.json["accessors"][primitives[p]["attributes"]["POSITION"].get<std::size_t>()];
      CHECK(position["count"] == ends[p + 1] - ends[p]);
      float low = std::numeric_limits<float>::max();
      for (std::size_t i = ends[p]; i < ends[p + 1]; ++i) low = std::min(low, model.mean[i].z);
      CHECK(position["min"][2].get<float>() == low);  // z is the same in both axes
    }
    CHECK(checkFile(path).errors.empty());
    const GaussianModel back = readModel(path).model;
    CHECK(back.mean == whole.mean);
    CHECK(back.sh == whole.sh);
    CHECK(back.opacity_logit == whole.opacity_logit);
    CHECK(back.rotation == whole.rotation);
    CHECK(back.log_scale == whole.log_scale);
    CHECK(back.atlas.texels == whole.atlas.texels);
  }
}

TEST_CASE("packed attributes of few Gaussians share a view for each stride and filter") {
  TG_SKIP_IF(hasMeshopt() ? std::string() : std::string(missingMeshopt()));
  const Scratch scratch;
  const auto path = scratch.folder() / "a.glb";
  const GaussianModel model = test::makeScene(SceneKind::ordinary, 24, 40).model;
  writeGlb(path, {model, {}, glm::vec3(0.0f), {.quantize = true, .meshopt = true}});
  const Glb glb = Glb::read(path);
  std::map<std::pair<std::size_t, std::string>, std::size_t> views;
  for (const auto& view : glb.json["bufferViews"]) {
    if (!view.contains("extensions")) continue;
    const auto& packed = view["extensions"]["EXT_meshopt_compression"];
    ++views[{packed["byteStride"].get<std::size_t>(), packed["filter"].get<std::string>()}];
    CHECK(view["byteLength"] == packed["count"].get<std::size_t>() * packed["byteStride"].get<std::size_t>());
  }
  for (const auto& [kind, count] : views) CHECK(count == 1);
  CHECK(glb.json["meshes"][0]["primitives"][0]["attributes"].size() > 2 * views.size());
  CHECK(checkFile(path).errors.empty());
}

TEST_CASE("packed views that no splat needs are no obstacle to reading, and streams of later versions are named") {
  TG_SKIP_IF(hasMeshopt() ? std::string() : std::string(missingMeshopt()));
  const Scratch scratch;
  const auto path = scratch.folder() / "a.glb";
  const std::string codec = "EXT_meshopt_compression";
  writeGlb(path, {test::makeScene(SceneKind::ordinary, 24, 40).model, {}, glm::vec3(0.0f), {.meshopt = true}});
  const GaussianModel expected = readModel(path).model;
  const Glb sound = Glb::read(path);

  Glb colored = sound;
  nlohmann::json view = colored.view("POSITION");
  const std::vector<std::uint8_t> stream = packMeshopt(std::vector<std::uint8_t>(40 * 8, 7), 8);
  colored.bin.resize((colored.bin.size() + 3) / 4 * 4);
  nlohmann::json& packed = view["extensions"][codec];
  packed = {{"buffer", packed["buffer"]},
            {"byteOffset", colored.bin.size()},
            {"byteLength", stream.size()},
            {"byteStride", 8},
            {"count", 40},
            {"mode", "ATTRIBUTES"},
            {"filter", "COLOR"}};
  view["byteLength"] = 40 * 8;
  view["byteStride"] = 8;
  colored.bin.append(stream.begin(), stream.end());
  colored.json["buffers"][packed["buffer"].get<int>()]["byteLength"] = colored.bin.size();
  const std::size_t last = colored.json["bufferViews"].size();
  colored.json["bufferViews"].push_back(view);
  colored.accessor("COLOR_0")["bufferView"] = last;
  colored.accessor("COLOR_0")["byteOffset"] = 0;
  CHECK(readModel(scratch.write("color.glb", colored.bytes())).model == expected);
  const CheckReport report = checkFile(scratch.folder() / "color.glb");
  REQUIRE(report.errors.size() == 1);
  CHECK(report.errors[0].pointer == "/bufferViews/" + std::to_string(last) + "/extensions/" + codec);
  CHECK_THAT(report.errors[0].message, Contains("the filter COLOR is not supported"));

  // That nothing names, or an image alone where no texture needs one.
  Glb unnamed = colored;
  unnamed.accessor("COLOR_0") = Glb(sound).accessor("COLOR_0");
  CHECK(readModel(scratch.write("unnamed.glb", unnamed.bytes())).model == expected);
  unnamed.json["images"].push_back({{"bufferView", last}, {"mimeType", "image/png"}});
  CHECK_THAT(refusal(scratch.write("image.glb", unnamed.bytes())), Contains("the filter COLOR is not supported"));
  unnamed.splatting().erase("extensions");
  const GaussianModel base = readModel(scratch.write("image.glb", unnamed.bytes())).model;
  CHECK(base.texture_mode == TextureMode::none);
  CHECK(base.mean == expected.mean);

  // As many of them as would be more than 4 GiB take no more than the longest.
  Glb many = sound;
  const std::size_t start = many.bin.size(), packed_bytes = std::size_t{1} << 20, elements = packed_bytes * 8;
  many.bin.resize(start + packed_bytes);
  many.json["buffers"][0]["byteLength"] = many.bin.size();
  for (int i = 0; i < 66; ++i) {
    nlohmann::json unread = view;
    unread["byteLength"] = elements * 8;
    nlohmann::json& stream_of = unread["extensions"][codec];
    stream_of["byteOffset"] = start;
    stream_of["byteLength"] = packed_bytes;
    stream_of["count"] = elements;
    nlohmann::json accessor = many.accessor("COLOR_0");
    accessor["bufferView"] = many.json["bufferViews"].size();
    many.json["bufferViews"].push_back(unread);
    many.json["accessors"].push_back(accessor);
  }
  CHECK(readModel(scratch.write("many.glb", many.bytes())).model == expected);

  Glb later = sound;
  later.bin[later.view("POSITION")["extensions"][codec].value("byteOffset", std::size_t{0})] = '\xAF';
  CHECK_THAT(refusal(scratch.write("later.glb", later.bytes())),
             Contains("the packed stream is of version 15, which libmeshoptimizer"));
}

TEST_CASE("packed rectangles of Gaussians without a texture cost little, and come back as none") {
  TG_SKIP_IF(hasMeshopt() ? std::string() : std::string(missingMeshopt()));
  const Scratch scratch;
  const auto path = scratch.folder() / "a.glb";
  GaussianModel model = test::makeScene(SceneKind::ordinary, 25, 600).model;
  model.atlas = makeUniformAtlas(model.size(), 4, 4);
  test::Random random(25);
  for (TextureRect& rect : model.atlas.rects) {
    if (random.uniform(0.0, 1.0) < 0.5) rect = {};
  }
  writeGlb(path, {model, {}, glm::vec3(0.0f), {.quantize = true, .meshopt = true}});
  const Glb glb = Glb::read(path);
  int found = 0;
  for (const auto& view : glb.json["bufferViews"]) {
    if (!view.contains("extensions")) continue;
    const auto& packed = view["extensions"]["EXT_meshopt_compression"];
    if (packed["byteStride"] != 8 || packed["filter"] != "NONE") continue;
    ++found;
    REQUIRE(packed["count"] == model.size());  // rectangles alone are such
    CHECK(2 * packed["byteLength"].get<std::size_t>() < 3 * model.size());
  }
  REQUIRE(found == 1);
  CHECK(checkFile(path).errors.empty());
  const GaussianModel out = readModel(path).model;
  for (std::size_t i = 0; i < model.size(); ++i) {
    REQUIRE(out.atlas.rects[i].width == model.atlas.rects[i].width);
    REQUIRE(out.atlas.rects[i].height == model.atlas.rects[i].height);
  }
}

TEST_CASE("an axis that no float holds is written as thin as one can be") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(SceneKind::ordinary, 8, 2).model;
  model.texture_mode = TextureMode::none;
  model.atlas = {};
  model.log_scale[1] = {-1.0f, -2.0f, -1000.0f};
  CHECK(written(model, scratch).values<float>("KHR_gaussian_splatting:SCALE", 3)[5] ==
        std::numeric_limits<float>::min());
}

TEST_CASE("a model without textures has no trace of our extension") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(SceneKind::ordinary, 22, 40).model;
  model.texture_mode = TextureMode::none;
  Glb glb = written(model, scratch);
  CHECK(glb.json["extensionsUsed"] == nlohmann::json({"KHR_gaussian_splatting"}));
  CHECK(!glb.json.contains("images"));
  CHECK(!glb.splatting().contains("extensions"));
}

TEST_CASE("values are what the specification asks for: unit quaternions, linear scale, opacity and COLOR_0") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(SceneKind::flat, 23, 100).model;
  for (std::size_t i = 0; i < model.size(); ++i) model.rotation[i] *= 0.5f + static_cast<float>(i);
  Glb glb = written(model, scratch);
  const auto position = glb.values<float>("POSITION", 3);
  const auto rotation = glb.values<float>("KHR_gaussian_splatting:ROTATION", 4);
  const auto scale = glb.values<float>("KHR_gaussian_splatting:SCALE", 3);
  const auto opacity = glb.values<float>("KHR_gaussian_splatting:OPACITY", 1);
  const auto dc = glb.values<float>("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", 3);
  const auto color = glb.values<std::uint16_t>("COLOR_0", 4);
  std::vector<float> low(3, 1e9f), high(3, -1e9f);
  for (std::size_t i = 0; i < model.size(); ++i) {
    CAPTURE(i);
    CHECK(position[i * 3] == -model.mean[i].x);
    CHECK(position[i * 3 + 1] == -model.mean[i].y);
    CHECK(position[i * 3 + 2] == model.mean[i].z);
    double norm = 0.0;
    for (int k = 0; k < 4; ++k) norm += double{rotation[i * 4 + k]} * rotation[i * 4 + k];
    CHECK(std::abs(norm - 1.0) < 2e-7);
    CHECK(scale[i * 3 + 2] <= std::min(scale[i * 3], scale[i * 3 + 1]));  // z is the normal of the texture
    CHECK((opacity[i] >= 0.0f && opacity[i] <= 1.0f));
    for (int c = 0; c < 3; ++c) {
      low[c] = std::min(low[c], position[i * 3 + c]);
      high[c] = std::max(high[c], position[i * 3 + c]);
      const double srgb = std::clamp(0.5 + 0.28209479177387814 * dc[i * 3 + c], 0.0, 1.0);
      const double linear = srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
      CHECK(std::abs(color[i * 4 + c] / 65535.0 - linear) < 1e-5);
    }
    CHECK(std::abs(color[i * 4 + 3] / 65535.0 - opacity[i]) < 1e-5);
  }
  for (int c = 0; c < 3; ++c) {
    CHECK(glb.accessor("POSITION")["min"][c].get<double>() == double{low[c]});
    CHECK(glb.accessor("POSITION")["max"][c].get<double>() == double{high[c]});
  }
}

TEST_CASE("the local axes in the file are u, v and a normal that keeps them right-handed") {
  const Scratch scratch;
  const GaussianModel model = test::makeScene(SceneKind::ordinary, 24, 60).model;
  Glb glb = written(model, scratch);
  const auto rotation = glb.values<float>("KHR_gaussian_splatting:ROTATION", 4);
  for (std::size_t i = 0; i < model.size(); ++i) {
    const glm::dmat3 file =
        matrixFromQuaternion({rotation[i * 4 + 3], rotation[i * 4], rotation[i * 4 + 1], rotation[i * 4 + 2]});
    const glm::dmat3 ours = matrixFromQuaternion(glm::dvec4(model.rotation[i]));
    const glm::vec3 s = model.log_scale[i];
    const int c = s.x <= s.y && s.x <= s.z ? 0 : (s.y <= s.z ? 1 : 2);
    CHECK(glm::length(file[0] - turnAxes(ours[c == 0 ? 1 : 0])) < 1e-6);
    CHECK(glm::length(file[1] - turnAxes(ours[c == 2 ? 1 : 2])) < 1e-6);
    CHECK(std::abs(std::abs(glm::dot(file[2], turnAxes(ours[c]))) - 1.0) < 1e-6);
  }
}

TEST_CASE("atlas bytes: 128 is exactly 0 where a channel is signed, texels lie where RECT says") {
  const Scratch scratch;
  test::Random random(25);
  GaussianModel model = test::makeScene(SceneKind::mixed, 25, 50).model;
  for (glm::vec4& texel : model.atlas.texels) {
    texel = glm::vec4(glm::vec3(random.uniformVec3(-0.7, 0.3)), random.uniform());
    if (random.uniform() < 0.3) texel = glm::vec4(0, 0, 0, 1);
  }
  Glb glb = written(model, scratch);
  const auto& extension = glb.textures();
  CHECK(extension["mode"] == "rgba");
  CHECK(extension["intersection"] == "maxResponse");
  CHECK(extension["extent"] == 3.0);
  CHECK(extension["filter"] == "bilinear");
  REQUIRE(extension["atlases"].size() == 1);
  const auto& atlas = extension["atlases"][0];
  const Image color = atlasImage(glb, atlas["color"].get<int>());
  const Image alpha = atlasImage(glb, atlas["alpha"].get<int>());
  REQUIRE(color.channels == 3);
  REQUIRE(alpha.width == color.width);
  const auto rects = glb.values<std::uint16_t>("TG_gaussian_splatting_texture:RECT", 4);
  for (std::size_t i = 0; i < model.size(); ++i) {
    const TextureRect& rect = model.atlas.rects[i];
    REQUIRE(rects[i * 4 + 2] == rect.width);
    REQUIRE(rects[i * 4 + 3] == rect.height);
    for (int v = 0; v < rect.height; ++v) {
      for (int u = 0; u < rect.width; ++u) {
        const glm::vec4& texel = model.atlas.texels[rect.offset + v * rect.width + u];
        const int x = rects[i * 4] + u, y = rects[i * 4 + 1] + v;
        for (int c = 0; c < 3; ++c) {
          const double scale = atlas["scale"][c].get<double>(), offset = atlas["offset"][c].get<double>();
          const double byte = std::round(color.at(x, y, c) * 255.0);
          CHECK(std::abs(byte / 255.0 * scale + offset - texel[c]) <= 0.5 * scale / 255.0 + 1e-6);
          if (texel[c] == 0.0f) CHECK(byte == 128.0);
        }
        CHECK(std::abs(alpha.at(x, y, 0) - texel.a) <= 0.5 / 255.0 + 1e-6);
      }
    }
  }
  const GaussianModel read = readModel(scratch.folder() / "written.glb").model;
  for (std::size_t i = 0; i < model.atlas.texels.size(); ++i) {
    // The same order: rectangles of both start where the one before ends.
    if (model.atlas.texels[i].r == 0.0f) CHECK(read.atlas.texels[i].r == 0.0f);
  }
}

TEST_CASE("modes write the terms they have") {
  const Scratch scratch;
  GaussianModel model = test::makeScene(SceneKind::ordinary, 26, 20).model;
  const std::string opacity = "TG_gaussian_splatting_texture:OPACITY";
  const std::string dc = "TG_gaussian_splatting_texture:SH_DEGREE_0_COEF_0";
  for (const TextureMode mode : {TextureMode::alpha, TextureMode::rgb, TextureMode::rgba}) {
    model.texture_mode = mode;
    Glb glb = written(model, scratch);
    const auto& attributes = glb.primitive()["attributes"];
    CHECK(attributes.contains(opacity) == (mode != TextureMode::rgb));
    CHECK(attributes.contains(dc) == (mode != TextureMode::alpha));
    CHECK(glb.textures()["atlases"][0].contains("color") == (mode != TextureMode::alpha));
    CHECK(glb.textures()["atlases"][0].contains("alpha") == (mode != TextureMode::rgb));
    CHECK(readModel(scratch.folder() / "written.glb").model.texture_mode == mode);
  }
}

TEST_CASE("where others are to see other scales, those to use with the texture have an attribute of their own") {
  const Scratch scratch;
  const auto path = scratch.folder() / "written.glb";
  GaussianModel model = test::makeScene(SceneKind::ordinary, 26, 40).model;
  for (std::size_t i = 0; i < model.size(); i += 3) model.atlas.rects[i] = {};  // some have axes that may be renamed
  const std::string own = "TG_gaussian_splatting_texture:SCALE";
  CHECK(!written(model, scratch).primitive()["attributes"].contains(own));
  const GaussianModel whole = readModel(path).model;
  GaussianModel base = bakeFallback(model, FallbackScale::kept);
  test::Random random(28);
  for (glm::vec3& log_scale : base.log_scale) log_scale += glm::vec3(random.uniformVec3(-1.0, 1.0));
  for (const bool quantized : {false, true}) {
    if (quantized && !hasMeshopt()) continue;
    CAPTURE(quantized);
    WriteOptions options{.base = &base};
    options.quantize = options.meshopt = quantized;
    writeGlb(path, {model, {}, glm::vec3(0.0f), options});
    const GaussianModel read = readModel(path).model, others = readModel(path, {.base_only = true}).model;
    const std::optional<Deviation> own_shape = deviationOf(whole, read), other_shape = deviationOf(base, others);
    REQUIRE((own_shape && other_shape));
    CHECK(own_shape->shape <= (quantized ? 0.02 : 0.0));
    CHECK(other_shape->shape <= (quantized ? 0.02 : 1e-5));
    CHECK(deviationOf(model, base)->shape > 0.5);
    if (!quantized) CHECK(read == whole);
  }
  if (!hasMeshopt()) return;
  const GltfReport report = writeGlb(path, {model, {}, glm::vec3(0.0f), {.steps = 0.125, .base = &base}});
  const GaussianModel others = readModel(path, {.base_only = true}).model;
  CHECK(deviationOf(select(base, report.order), others)->shape <= 0.02);
}

TEST_CASE("a channel's range is the one that loses less: outliers are clipped and counted, or kept") {
  Image page(400, 250, 4);
  test::Random random(27);
  for (glm::vec4& texel : pageTexels(page)) texel = glm::vec4(glm::vec3(random.uniformVec3(-0.1, 0.1)), 1.0f);
  pageTexels(page)[77].g = 0.2f;  // clipping it costs 0.1^2, keeping it 4 times the squared step of 100000 texels
  const QuantizedPage clipped = quantizePage(page);
  CHECK(clipped.clipped_texels >= 1);
  CHECK(clipped.clipped_texels <= 300);
  CHECK(clipped.scale[1] == Approx(0.2).epsilon(0.02));
  pageTexels(page)[77].g = 1.0f;  // too far out to lose
  const QuantizedPage kept = quantizePage(page);
  CHECK(kept.scale[1] == Approx(2.0).epsilon(0.02));
  CHECK(kept.offset[1] + 128.0 * kept.scale[1] / 255.0 == 0.0);
}

TEST_CASE("texels at the ends of floats are read again and what no scale reaches is counted") {
  const Scratch scratch;
  const auto path = scratch.folder() / "far.glb";
  constexpr float kMost = std::numeric_limits<float>::max();
  GaussianModel model = test::makeScene(SceneKind::ordinary, 29, 40).model;
  for (std::size_t i = 0; i < model.atlas.texels.size(); ++i) model.atlas.texels[i].x = i % 2 == 0 ? kMost : -kMost;
  for (const AtlasFormat atlas : {AtlasFormat::png8, AtlasFormat::png16}) {
    const GltfReport report = writeGlb(path, {model, {}, glm::vec3(0.0f), {.atlas = atlas}});
    CHECK(report.clipped_texels == model.atlas.texels.size());  // a scale of kMost reaches half as far
    float low = 0, high = 0;
    for (const glm::vec4& texel : readModel(path).model.atlas.texels) {
      low = std::min(low, texel.x);
      high = std::max(high, texel.x);
    }
    CHECK(low == Approx(-kMost / 2).epsilon(0.01));
    CHECK(high == Approx(kMost / 2).epsilon(0.01));
  }
  if (!hasMeshopt()) return;
  WriteOptions steps{.quantize = true, .meshopt = true, .steps = 1.0f};
  CHECK(writeGlb(path, {model, {}, glm::vec3(0.0f), steps}).clipped_texels > 0);
  CHECK(readModel(path).model.size() == model.size());
}
