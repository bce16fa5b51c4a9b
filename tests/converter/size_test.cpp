// SPDX-License-Identifier: Apache-2.0
// Smaller files: adaptive textures, atlas formats, integers, meshopt, and files beside a .gltf.
#include <algorithm>
#include <cstring>

#include "converter/convert.h"
#include "converter/gltf/meshopt.h"
#include "converter/gltf/read_gltf.h"
#include "core/bundle/bundle.h"
#include "core/model/texture_budget.h"
#include "core/model/verbs.h"
#include "edits.h"
#include "glb.h"
#include "render/contribution.h"
#include "scratch.h"
#include "support/catch.h"
#include "support/message_of.h"

using namespace tg;
using tg::test::messageOf;
using tg::test::Random;
using tg::test::SceneKind;

namespace {

std::uint64_t texelCountOf(const GaussianModel& model) { return model.atlas.texels.size(); }

// Texels as a bundle stores them.
void roundToHalf(GaussianModel& model) {
  const Scratch scratch;
  Bundle bundle;
  bundle.model = model;
  writeBundle(scratch.folder() / "a.tgz", bundle);
  model = readBundle(scratch.folder() / "a.tgz").model;
}

bool sameBits(const GaussianModel& a, const GaussianModel& b) {
  bool same = a.atlas.rects == b.atlas.rects && a.texture_mode == b.texture_mode && a.intersection == b.intersection;
  forEachParameter(
      [&](const Field&, const auto& x, const auto& y) {
        same = same && x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(x[0])) == 0;
      },
      a, b);
  return same;
}

}  // namespace

TEST_CASE("textures get the fewest texels that keep their error") {
  const test::TestScene scene = test::makeScene(SceneKind::mixed, 51, 60, 48, 36);
  const FrameT<double> before = referenceFrame(scene.model, scene.camera);
  GaussianModel exact = scene.model;
  fitTexturesToError(exact, 0.0);
  checkModel(exact, "exact");
  CHECK(framePsnr(before, referenceFrame(exact, scene.camera)) > 100.0);
  std::uint64_t texels = texelCountOf(exact);
  double last = 1e9;
  for (const double error : {0.02, 0.1, 10.0}) {
    GaussianModel model = scene.model;
    fitTexturesToError(model, error);
    checkModel(model, "model");
    const double psnr = framePsnr(before, referenceFrame(model, scene.camera));
    CAPTURE(error, psnr, texelCountOf(model), texels);
    CHECK(texelCountOf(model) < texels);
    CHECK(psnr < last);
    CHECK(psnr > -20.0 * std::log10(error));  // errors of textures add up to no more than that here
    texels = texelCountOf(model);
    last = psnr;
  }
  CHECK(texels == 0);

  // Textures of one colour need none, and leave it in the base.
  GaussianModel flat = scene.model;
  for (glm::vec4& texel : flat.atlas.texels) texel = glm::vec4(0.1f, 0.2f, 0.05f, 1.0f);
  for (std::size_t k = 0; k < flat.sh.size(); ++k) {  // no base is clamped at 0
    flat.sh[k] = k % 16 == 0 ? glm::vec3(0.8f) : 0.02f * flat.sh[k];
  }
  const FrameT<double> flat_before = referenceFrame(flat, scene.camera);
  fitTexturesToError(flat, 1e-5);
  CHECK(texelCountOf(flat) == 0);
  CHECK(framePsnr(flat_before, referenceFrame(flat, scene.camera)) >
        45.0);  // textures end at 3 sigma, the base does not
}

TEST_CASE("a texel budget is kept and spent where pictures show it") {
  const Bundle sample = readBundle("docs/sample.tgz");
  const std::vector<double> weights = blendWeights(sample.model, contributionViews(sample.model, sample.cameras));
  const std::vector<Camera> judges = qualityViews(sample.model, sample.cameras);
  const auto psnr = [&](const GaussianModel& model) {
    return renderedPsnr(sample.model, model, judges, sample.background);
  };
  GaussianModel uniform = sample.model;
  resizeTextures(uniform, 2, 2);
  GaussianModel adaptive = sample.model;
  fitTexturesToBudget(adaptive, texelCountOf(uniform), weights);
  checkModel(adaptive, "adaptive");
  CHECK(texelCountOf(adaptive) <= texelCountOf(uniform));
  CHECK(texelCountOf(adaptive) > texelCountOf(uniform) * 9 / 10);
  CAPTURE(psnr(adaptive), psnr(uniform));
  CHECK(psnr(adaptive) > psnr(uniform) + 3.0);
  GaussianModel none = sample.model, all = sample.model;
  fitTexturesToBudget(none, 0, weights);
  CHECK(texelCountOf(none) == 0);
  fitTexturesToBudget(all, 1u << 30, weights);
  CHECK(psnr(all) > 70.0);
}

TEST_CASE("a bundle comes back bit by bit by way of EXR atlases, and closer with 16 bits than with 8") {
  const Scratch scratch;
  for (const SceneKind kind : {SceneKind::mixed, SceneKind::oddTextures}) {
    for (const TextureMode mode : {TextureMode::rgba, TextureMode::rgb, TextureMode::alpha}) {
      test::TestScene scene = test::makeScene(kind, 52, 60);
      scene.model.texture_mode = mode;
      for (glm::vec4& texel : scene.model.atlas.texels) {  // what the mode lacks is not stored
        if (mode == TextureMode::alpha) texel = glm::vec4(0.0f, 0.0f, 0.0f, texel.a);
        if (mode == TextureMode::rgb) texel.a = 1.0f;
      }
      roundToHalf(scene.model);
      const auto through = [&](AtlasFormat atlas) {
        const GltfContent content = {scene.model, {}, glm::vec3(0.0f), false, atlas};
        writeGlb(scratch.folder() / "a.glb", content);
        return readModel(scratch.folder() / "a.glb").model;
      };
      CAPTURE(test::name(kind), name(mode));
      CHECK(sameBits(scene.model, through(AtlasFormat::exr)));
      const Image source = picture(scene.model, scene.camera);
      const double with8 = psnr(source, picture(through(AtlasFormat::png8), scene.camera));
      const double with16 = psnr(source, picture(through(AtlasFormat::png16), scene.camera));
      CAPTURE(with8, with16);
      CHECK(with8 > 50.0);
      CHECK(with16 > with8 + 20.0);
    }
  }
}

TEST_CASE("WebP atlases hold the numbers of 8-bit PNG ones, and need nothing of a reader that shows the base") {
  const Scratch scratch;
  for (const TextureMode mode : {TextureMode::rgba, TextureMode::rgb, TextureMode::alpha}) {
    test::TestScene scene = test::makeScene(SceneKind::mixed, 57, 60);
    scene.model.texture_mode = mode;
    CAPTURE(name(mode));
    const auto through = [&](const char* file, AtlasFormat atlas) {
      const GltfContent content = {scene.model, {}, glm::vec3(0.0f), false, atlas};
      std::string(file).ends_with(".glb") ? writeGlb(scratch.folder() / file, content)
                                          : writeGltf(scratch.folder() / file, content);
      return readModel(scratch.folder() / file).model;
    };
    const GaussianModel png = through("png.glb", AtlasFormat::png8);
    CHECK(sameBits(png, through("webp.glb", AtlasFormat::webp)));
    CHECK(sameBits(png, through("webp.gltf", AtlasFormat::webp)));
    if (hasColor(mode)) CHECK(std::filesystem::exists(scratch.folder() / "webp_atlas_0_color.webp"));
    const nlohmann::json json = Glb::read(scratch.folder() / "webp.glb").json;
    CHECK(json["extensionsUsed"] ==
          nlohmann::json({"KHR_gaussian_splatting", "TG_gaussian_splatting_texture", "EXT_texture_webp"}));
    CHECK(!json.contains("extensionsRequired"));
    for (const nlohmann::json& texture : json["textures"]) CHECK(!texture.contains("source"));
    for (const nlohmann::json& image : json["images"]) CHECK(image["mimeType"] == "image/webp");
  }
}

TEST_CASE("a broken EXR atlas is refused with its place") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(SceneKind::ordinary, 53, 12);
  writeGlb(scratch.folder() / "a.glb", {scene.model, {}, glm::vec3(0.0f), false, AtlasFormat::exr});
  const Glb good = Glb::read(scratch.folder() / "a.glb");
  const auto refused = [&](auto spoil) {
    Glb glb = good;
    spoil(glb);
    return refusal(scratch.write("b.glb", glb.bytes()));
  };
  const std::string index =
      std::to_string(good.json["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]["extensions"]
                              ["TG_gaussian_splatting_texture"]["atlases"][0]["exr"]
                                  .get<int>());
  CHECK(refused([](Glb& glb) { glb.textures()["atlases"][0]["exr"] = 77; }).find("\"exr\" names no image") !=
        std::string::npos);
  CHECK(refused([](Glb& glb) { glb.textures()["atlases"][0]["exr"] = 0; }).find("values of another type") !=
        std::string::npos);
  CHECK(refused([&](Glb& glb) {
          const auto view = glb.json["images"][std::stoi(index)]["bufferView"].get<std::size_t>();
          const auto at = glb.json["bufferViews"][view]["byteOffset"].get<std::size_t>();
          glb.bin[at] = 'x';
        }).find("/images/" + index) != std::string::npos);
}

TEST_CASE("integers and packed attributes cost what they are said to cost") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(SceneKind::mixed, 54, 400);
  const auto write = [&](bool quantize, bool meshopt, const char* file) {
    const GltfContent content = {scene.model, {}, glm::vec3(0.0f), false, AtlasFormat::png8, quantize, meshopt};
    return writeGlb(scratch.folder() / file, content).output_bytes;
  };
  const std::uint64_t plain = write(false, false, "plain.glb");
  const std::uint64_t integers = write(true, false, "integers.glb");
  CHECK(integers + 20 * scene.model.size() < plain);
  const GaussianModel expected = readModel(scratch.folder() / "plain.glb").model;
  const GaussianModel rounded = readModel(scratch.folder() / "integers.glb").model;
  Glb glb = Glb::read(scratch.folder() / "integers.glb");
  CHECK(glb.accessor("KHR_gaussian_splatting:ROTATION")["componentType"] == 5122);
  CHECK(!glb.json.contains("extensionsRequired"));
  const std::optional<Deviation> deviation = deviationOf(expected, rounded);
  REQUIRE(deviation);
  CHECK(deviation->mean == 0.0);
  CHECK(deviation->sh == 0.0);
  CHECK(deviation->opacity < 1.0 / 65535.0);
  CHECK(deviation->shape < 1e-3);
  CHECK(psnr(picture(expected, scene.camera), picture(rounded, scene.camera)) > 60.0);

  if (!hasMeshopt()) {
    CHECK(
        messageOf([&] { write(false, true, "packed.glb"); }, ErrorKind::usage).find("built without libmeshoptimizer") !=
        std::string::npos);
    return;
  }
  const std::uint64_t packed = write(false, true, "packed.glb");
  const std::uint64_t both = write(true, true, "both.glb");
  CHECK(packed < plain);
  CHECK(both < packed * 9 / 10);
  CHECK(sameBits(expected, readModel(scratch.folder() / "packed.glb").model));
  CHECK(psnr(picture(expected, scene.camera), picture(readModel(scratch.folder() / "both.glb").model, scene.camera)) >
        50.0);
  const Glb good = Glb::read(scratch.folder() / "packed.glb");
  CHECK(good.json["extensionsRequired"] == nlohmann::json({"EXT_meshopt_compression"}));
  const auto refused = [&](auto spoil) {
    Glb spoilt = good;
    spoil(spoilt.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"], spoilt);
    return refusal(scratch.write("b.glb", spoilt.bytes()));
  };
  const std::string place = "/bufferViews/0/extensions/EXT_meshopt_compression: ";
  CHECK(refused([](auto& view, Glb&) { view["count"] = 1u << 30; }).find(place + "more than the stream can hold") == 0);
  CHECK(refused([](auto& view, Glb&) { view["byteLength"] = 1u << 30; }).find(place + "leaves its buffer") == 0);
  CHECK(refused([](auto& view, Glb&) { view["mode"] = "POINTS"; }) ==
        place + "unknown \"mode\" (expected \"ATTRIBUTES\", \"TRIANGLES\" or \"INDICES\", found \"POINTS\")");
  CHECK(refused([](auto& view, Glb&) { view.erase("mode"); }) == place + "\"mode\" is missing");
  CHECK(refused([](auto& view, Glb&) { view["filter"] = "NEW"; }) ==
        place + "unknown \"filter\" (expected NONE, OCTAHEDRAL, QUATERNION or EXPONENTIAL, found \"NEW\")");
  for (const std::string key : {"mode", "filter"}) {
    CHECK(refused([&](auto& view, Glb&) { view[key] = 5; }) ==
          place.substr(0, place.size() - 2) + "/" + key + ": wrong type (expected a string, found 5)");
  }
  CHECK(refused([](auto& view, Glb& g) { g.bin[view["byteOffset"].template get<std::size_t>()] = 0; }) ==
        place + "the packed stream is broken");
  CHECK(refused([](auto& view, Glb&) { view["buffer"] = 1; }).find(place + "the packed bytes are in no file") == 0);
}

TEST_CASE("a mesh's packed indices are unpacked beside the splats") {
  if (!hasMeshopt()) return;
  // A sequence: its head, 0 and twice 1 more than the last (in steps of 4), its tail.
  const std::vector<std::uint8_t> packed = {0xd1, 0, 4, 4, 0, 0, 0, 0};
  const auto unpack = [&](std::size_t count, std::size_t stride, const char* mode, const char* filter) {
    return unpackMeshopt(packed, count, stride, mode, filter, "p");
  };
  CHECK(unpack(3, 2, "INDICES", "NONE") == std::vector<std::uint8_t>{0, 0, 1, 0, 2, 0});
  CHECK_THROWS_WITH(unpack(30, 2, "INDICES", "NONE"), "p: the packed stream is broken");
  CHECK_THROWS_WITH(unpack(3, 2, "TRIANGLES", "NONE"), "p: the packed stream is broken");
  CHECK_THROWS_WITH(unpack(4, 2, "TRIANGLES", "NONE"), Contains("(expected a multiple of 3, found 4)"));
  CHECK_THROWS_WITH(unpack(3, 3, "INDICES", "NONE"), Contains("of indices (expected 2 or 4, found 3)"));
  CHECK_THROWS_WITH(unpack(3, 2, "INDICES", "EXPONENTIAL"),
                    Contains("a filter of indices (expected \"NONE\", found \"EXPONENTIAL\")"));
  CHECK_THROWS_WITH(unpack(1, 6, "ATTRIBUTES", "NONE"), Contains("(expected a multiple of 4 up to 256, found 6)"));
  const std::vector<std::uint8_t> vertices = packMeshopt(std::vector<std::uint8_t>(12 * 3, 7), 12);
  for (const auto& [filter, expected] : {std::pair{"OCTAHEDRAL", "4 or 8"}, {"QUATERNION", "8"}}) {
    CHECK_THROWS_WITH(unpackMeshopt(vertices, 3, 12, "ATTRIBUTES", filter, "p"),
                      Contains("for the filter (expected " + std::string(expected) + ", found 12)"));
  }
}

TEST_CASE("a .gltf with its files is the model of the GLB, and reads nothing but files beside it") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(SceneKind::mixed, 55, 60);
  const Camera cameras[] = {scene.camera};
  const bool meshopt = GENERATE(false, true);
  if (meshopt && !hasMeshopt()) return;
  const GltfContent content = {scene.model, cameras, glm::vec3(0.25f), false, AtlasFormat::exr, false, meshopt};
  writeGlb(scratch.folder() / "a.glb", content);
  writeGltf(scratch.folder() / "a b.gltf", content);
  for (const char* file :
       {"a b.gltf", "a b.bin", "a b_atlas_0_color.png", "a b_atlas_0_alpha.png", "a b_atlas_0_values.exr"}) {
    CHECK(std::filesystem::exists(scratch.folder() / file));
  }
  const Bundle one = readModel(scratch.folder() / "a.glb"), many = readModel(scratch.folder() / "a b.gltf");
  CHECK(sameBits(one.model, many.model));
  CHECK(many.cameras.size() == 1);
  CHECK(many.background == glm::vec3(0.25f));

  const auto json = nlohmann::json::parse(Glb::slurp(scratch.folder() / "a b.gltf"));
  const auto with = [&](const std::string& uri) {
    auto changed = json;
    changed["buffers"][0]["uri"] = uri;
    return refusal(scratch.write("b.gltf", changed.dump()));
  };
  CHECK(with("a%20b.bin") == "accepted");
  std::filesystem::create_directory(scratch.folder() / "sub");
  for (const char* uri :
       {"../a%20b.bin", "/etc/passwd", "sub/../a%20b.bin", "file:///etc/passwd", "%2e%2e/x", "a\\b", ""}) {
    CAPTURE(uri);
    CHECK(with(uri).find("/buffers/0/uri: no name of a file beside this one") == 0);
  }
  CHECK(with("missing.bin").find("/buffers/0/uri: external file: ") == 0);
  scratch.write("short.bin", "1234");
  CHECK(with("short.bin").find("/buffers/0/uri: the file is too short") == 0);
  const std::string text = json.dump();
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  CHECK(messageOf([&] { parseGltf(bytes, "x"); }).find("external files are not read here") != std::string::npos);
}

TEST_CASE("an atlas as pictures and JSON says where every texture lies") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(SceneKind::mixed, 56, 40);
  Bundle bundle;
  bundle.model = scene.model;
  writeBundle(scratch.folder() / "in.tgz", bundle);
  const ConvertReport report = convert(scratch.folder() / "in.tgz", scratch.folder() / "a.png");
  const auto json = nlohmann::json::parse(Glb::slurp(scratch.folder() / "a.json"));
  const auto& atlas = json["atlases"][0];
  const Image color = readImage(scratch.folder() / atlas["color"].get<std::string>());
  const Image alpha = readImage(scratch.folder() / atlas["alpha"].get<std::string>());
  CHECK(atlas["color"] == "a.png");
  CHECK(report.output_bytes == std::filesystem::file_size(scratch.folder() / "a.png") +
                                   std::filesystem::file_size(scratch.folder() / "a_alpha.png") +
                                   std::filesystem::file_size(scratch.folder() / "a.json"));
  for (std::size_t i = 0; i < scene.model.size(); ++i) {
    const TextureRect& rect = scene.model.atlas.rects[i];
    const auto row = json["rectangles"]["rows"][i].get<std::vector<int>>();
    REQUIRE(row[2] == rect.width);
    REQUIRE(row[3] == rect.height);
    if (rect.texelCount() == 0) continue;
    const glm::vec4 texel = scene.model.atlas.texels[rect.offset + rect.texelCount() - 1u];
    const int x = row[0] + row[2] - 1, y = row[1] + row[3] - 1;
    for (int c = 0; c < 3; ++c) {
      CHECK(color.at(x, y, c) * atlas["scale"][c].get<float>() + atlas["offset"][c].get<float>() ==
            Approx(texel[c]).margin(1.0 / 255 * atlas["scale"][c].get<double>()));
    }
    CHECK(alpha.at(x, y, 0) == Approx(texel.a).margin(0.51 / 255));
  }
}

TEST_CASE("cameras that nobody wants are left out of every format that holds some, and nothing else is") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(SceneKind::ordinary, 31, 40);
  Bundle bundle;
  bundle.model = scene.model;
  bundle.cameras = {scene.camera, scene.camera};
  const auto from = scratch.folder() / "source.tgz";
  writeBundle(from, bundle);
  for (const Format& format : formats()) {
    if (!format.read || !format.write) continue;
    CAPTURE(format.name);
    const auto to = scratch.folder() / ("a." + std::string(format.name));
    const ConvertReport kept = convert(from, to);
    const std::size_t there = format.holds(kKeepsCameras) ? 2 : 0;
    CHECK(kept.cameras == there);
    CHECK(readModel(to).cameras.size() == there);
    const ConvertReport report = convert(from, to, {.overwrite = true, .cameras = false});
    CHECK(report.cameras == 0);
    const Bundle back = readModel(to);
    CHECK(back.cameras.empty());
    CHECK(back.model.size() == 40);
    CHECK(report.textured_psnr == kept.textured_psnr);  // seen from the same places
    CHECK(std::ranges::none_of(report.warnings, [](const std::string& w) { return w.find("camera") != w.npos; }));
  }
}
