// SPDX-License-Identifier: Apache-2.0
// Every form of KHR_gaussian_splatting that is allowed is read; every broken file gets its own message.
#include <algorithm>
#include <functional>
#include <limits>

#include "converter/check.h"
#include "converter/glb.h"
#include "converter/gltf/axes.h"
#include "converter/gltf/document_check.h"
#include "converter/gltf/gltf_json.h"
#include "converter/gltf/meshopt.h"
#include "converter/gltf/numbers.h"
#include "converter/gltf/write_gltf.h"
#include "converter/registry/file_format.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "core/model/verbs.h"
#include "support/catch.h"

using namespace tg;
using tg::test::SceneKind;

namespace {

const std::string kKhr = "KHR_gaussian_splatting:";
const std::string kTg = "TG_gaussian_splatting_texture:";
const std::string kPrimitive = "/meshes/0/primitives/0";
const std::string kSpz = "KHR_gaussian_splatting_compression_spz_2";

GaussianModel smallModel() { return test::makeScene(SceneKind::ordinary, 31, 12).model; }

Glb smallGlb(const Scratch& scratch) {
  writeGlb(scratch.folder() / "small.glb", {smallModel(), {}, glm::vec3(0.0f)});
  return Glb::read(scratch.folder() / "small.glb");
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace

TEST_CASE("quantised and interleaved attributes are read as their floats") {
  const Scratch scratch;
  Glb glb = smallGlb(scratch);
  const GaussianModel plain = readModel(scratch.folder() / "small.glb", {.base_only = true}).model;
  const std::size_t n = plain.size();
  const auto read = [&] { return readModel(scratch.write("q.glb", glb.bytes()), {.base_only = true}).model; };

  SECTION("OPACITY in 8 and 16 bit") {
    std::vector<std::uint8_t> bytes(n * 4, 0);
    std::vector<std::uint16_t> shorts(n * 2, 0);
    for (std::size_t i = 0; i < n; ++i) bytes[i * 4] = static_cast<std::uint8_t>(i * 20);
    for (std::size_t i = 0; i < n; ++i) shorts[i * 2] = static_cast<std::uint16_t>(i * 5000);
    glb.setAttribute(kKhr + "OPACITY", bytes, 5121, "SCALAR", true, n);
    glb.view(kKhr + "OPACITY")["byteStride"] = 4;
    const GaussianModel eight = read();
    glb.setAttribute(kKhr + "OPACITY", shorts, 5123, "SCALAR", true, n);
    glb.view(kKhr + "OPACITY")["byteStride"] = 4;
    const GaussianModel sixteen = read();
    for (std::size_t i = 1; i < n; ++i) {
      CHECK(opacityOf(eight, i) == Approx(static_cast<double>(i * 20) / 255.0).epsilon(1e-5));
      CHECK(opacityOf(sixteen, i) == Approx(static_cast<double>(i * 5000) / 65535.0).epsilon(1e-5));
    }
  }
  SECTION("SCALE in every integer form, logarithms of early files too") {
    const auto check = [&](auto one, int component_type, bool normalized, double expected) {
      using T = decltype(one);
      const std::size_t stride = (3 * sizeof(T) + 3) / 4 * 4 / sizeof(T);
      glb.setAttribute(kKhr + "SCALE", std::vector<T>(n * stride, one), component_type, "VEC3", normalized, n);
      glb.view(kKhr + "SCALE")["byteStride"] = stride * sizeof(T);
      CAPTURE(component_type, normalized);
      for (const glm::vec3& s : read().log_scale) CHECK(s.y == Approx(std::log(expected)).margin(1e-6));
    };
    check(std::uint8_t{51}, 5121, false, 51.0);
    check(std::uint8_t{51}, 5121, true, 0.2);
    check(std::uint16_t{300}, 5123, false, 300.0);
    check(std::uint16_t{13107}, 5123, true, 0.2);
    check(std::int8_t{127}, 5120, true, std::exp(1.0));
    check(std::int16_t{-3}, 5122, false, std::exp(-3.0));
    // As floats: no scale is below 0, logarithms mostly are.
    std::vector<float> logs(n * 3);
    for (std::size_t i = 0; i < logs.size(); ++i) logs[i] = plain.log_scale[i / 3][static_cast<int>(i % 3)];
    logs[0] = 0.5f;
    for (std::size_t i = 3; i < logs.size(); ++i) logs[i] = std::min(logs[i], -0.5f);
    glb.setAttribute(kKhr + "SCALE", logs, 5126, "VEC3", false, n);
    const Bundle early = readModel(scratch.write("q.glb", glb.bytes()), {.base_only = true});
    for (std::size_t i = 0; i < n; ++i) {
      glm::vec3 expected(logs[3 * i], logs[3 * i + 1], logs[3 * i + 2]);
      CHECK(glm::length(early.model.log_scale[i] - expected) < 1e-5f);
    }
    REQUIRE(early.warnings.size() == 1);
    CHECK_THAT(early.warnings.front(), Contains("SCALE: logarithms"));
    // One sign that went wrong is none.
    std::vector<float> scales(n * 3, 0.25f);
    scales[0] = -0.25f;
    glb.setAttribute(kKhr + "SCALE", scales, 5126, "VEC3", false, n);
    for (const glm::vec3& s : read().log_scale) CHECK(s.x == Approx(std::log(0.25)).margin(1e-6));
  }
  SECTION("images may not take the same bytes time and again") {
    glb.setAttribute("_BYTES", std::vector<std::uint8_t>(1 << 20), 5121, "SCALAR", false, n);
    const nlohmann::json image = {{"bufferView", glb.json["bufferViews"].size() - 1}, {"mimeType", "image/png"}};
    glb.json["images"] = std::vector<nlohmann::json>(60, image);
    CHECK(read().size() == n);
    glb.json["images"] = std::vector<nlohmann::json>(70, image);
    CHECK_THAT(test::messageOf([&] { read(); }, ErrorKind::badData),
               Contains("/images/64") && Contains("more than the buffers hold"));
  }
  SECTION("a background that is none is told, and is not known") {
    nlohmann::json& extras = glb.json["asset"]["extras"]["textured_gaussians"];
    extras["background"] = {1e300, 0, 0};
    const Bundle infinite = readModel(scratch.write("q.glb", glb.bytes()), {.base_only = true});
    CHECK_FALSE(infinite.knows_background);
    CHECK(infinite.background == glm::vec3(0.0f));
    REQUIRE(infinite.warnings.size() == 1);
    CHECK_THAT(infinite.warnings.front(), Contains("background: ignored"));
  }
  SECTION("ROTATION in 8 and 16 bit") {
    glb.setAttribute(kKhr + "ROTATION", std::vector<std::int8_t>(n * 4, 64), 5120, "VEC4", true, n);
    const GaussianModel eight = read();
    glb.setAttribute(kKhr + "ROTATION", std::vector<std::int16_t>(n * 4, 16384), 5122, "VEC4", true, n);
    const GaussianModel sixteen = read();
    const glm::vec4 half = modelFromGltfRotation(glm::vec4(0.5f));
    CHECK(glm::length(glm::normalize(eight.rotation[3]) - half) < 1e-6f);
    CHECK(glm::length(glm::normalize(sixteen.rotation[3]) - half) < 1e-6f);
  }
  SECTION("positions interleaved with something else") {
    const auto positions = glb.values<float>("POSITION", 3);
    std::vector<float> interleaved;
    for (std::size_t i = 0; i < n; ++i) {
      interleaved.insert(interleaved.end(), {7.0f, positions[i * 3], positions[i * 3 + 1], positions[i * 3 + 2], 8.0f});
    }
    glb.setAttribute("POSITION", interleaved, 5126, "VEC3", false, n);
    glb.accessor("POSITION")["byteOffset"] = 4;
    glb.view("POSITION")["byteStride"] = 20;
    CHECK(read().mean == plain.mean);
  }
  SECTION("accessors without a view are zeros, on which sparse values stand") {
    glb.accessor(kKhr + "OPACITY").erase("bufferView");
    glb.accessor(kKhr + "SH_DEGREE_3_COEF_2").erase("bufferView");
    glb.setAttribute("EXTRA:INDICES", std::vector<std::uint16_t>{3, 0}, 5123, "SCALAR", false, 1);
    glb.setAttribute("EXTRA:VALUES", std::vector<float>{0.5f}, 5126, "SCALAR", false, 1);
    glb.accessor(kKhr + "OPACITY")["sparse"] = {
        {"count", 1},
        {"indices", {{"bufferView", glb.accessor("EXTRA:INDICES")["bufferView"]}, {"componentType", 5123}}},
        {"values", {{"bufferView", glb.accessor("EXTRA:VALUES")["bufferView"]}}}};
    for (const char* name : {"EXTRA:INDICES", "EXTRA:VALUES"}) glb.primitive()["attributes"].erase(name);
    const GaussianModel model = read();
    CHECK(checkFile(scratch.folder() / "q.glb").errors.empty());
    CHECK(model.mean == plain.mean);
    for (std::size_t i = 0; i < n; ++i) {
      CHECK(opacityOf(model, i) == Approx(i == 3 ? 0.5 : 0.0).margin(1e-6));
      CHECK(model.sh[i * 16 + 11] == glm::vec3(0.0f));
      CHECK(model.sh[i * 16 + 12] == plain.sh[i * 16 + 12]);
    }
  }
  SECTION("sparse values take their places") {
    const auto scales = glb.values<float>(kKhr + "SCALE", 3);
    glb.setAttribute("EXTRA:INDICES", std::vector<std::uint16_t>{2, 5}, 5123, "SCALAR", false, 2);
    glb.setAttribute("EXTRA:VALUES", std::vector<float>{1, 2, 3, 4, 5, 6}, 5126, "VEC3", false, 2);
    auto& sparse = glb.accessor(kKhr + "SCALE")["sparse"];
    sparse = {{"count", 2},
              {"indices", {{"bufferView", glb.accessor("EXTRA:INDICES")["bufferView"]}, {"componentType", 5123}}},
              {"values", {{"bufferView", glb.accessor("EXTRA:VALUES")["bufferView"]}}}};
    glb.primitive()["attributes"].erase("EXTRA:INDICES");
    glb.primitive()["attributes"].erase("EXTRA:VALUES");
    const GaussianModel model = read();
    CHECK(model.log_scale[4] == plain.log_scale[4]);
    CHECK(model.log_scale[5].z == Approx(std::log(6.0f)));
    glb.bin[glb.json["bufferViews"][glb.accessor(kKhr + "SCALE")["sparse"]["indices"]["bufferView"].get<int>()]
                    ["byteOffset"]
                        .get<std::size_t>()] = 40;
    CHECK(contains(refusal(scratch.write("s.glb", glb.bytes())), "sparse index 0 is out of range"));
  }
}

TEST_CASE("a scene under a node looks as the scene does from a camera moved the other way") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(SceneKind::mixed, 32, 60);
  writeGlb(scratch.folder() / "a.glb", {scene.model, {}, glm::vec3(0.0f)});
  const GaussianModel still = readModel(scratch.folder() / "a.glb").model;
  Glb glb = Glb::read(scratch.folder() / "a.glb");
  // A parent that turns and moves, a child that scales: in glTF's axes.
  const glm::dvec4 q = glm::normalize(glm::dvec4(0.8, 0.3, -0.4, 0.2));  // w, x, y, z
  const glm::dvec3 move(0.4, -0.7, 1.1);
  const double scale = 1.5;
  glb.json["nodes"][0]["scale"] = {scale, scale, scale};
  glb.json["nodes"].push_back(
      {{"children", {0}}, {"rotation", {q.y, q.z, q.w, q.x}}, {"translation", {move.x, move.y, move.z}}});
  glb.json["scenes"][0]["nodes"] = {1};
  const GaussianModel moved = readModel(scratch.write("b.glb", glb.bytes())).model;

  // The same similarity in the model's axes; camera z scales with the world, so depths differ and pictures do not.
  glm::dmat3 rotation = matrixFromQuaternion(q);
  for (int c = 0; c < 3; ++c) rotation[c] = turnAxes(rotation[c]);
  rotation[0] = -rotation[0];
  rotation[1] = -rotation[1];
  Camera camera = scene.camera;
  camera.rotation = scene.camera.rotation * glm::transpose(rotation);
  const glm::dvec3 eye = scale * (rotation * scene.camera.position()) + turnAxes(move);
  camera.translation = -camera.rotation * eye;
  CHECK(psnr(picture(still, scene.camera), picture(moved, camera)) > 55.0);
}

TEST_CASE("splats without textures follow a node that scales axes differently") {
  const Scratch scratch;
  Glb glb = smallGlb(scratch);
  glb.splatting().erase("extensions");
  const auto put = [&](std::size_t element, float value) {
    std::memcpy(glb.bin.data() + glb.start(kKhr + "SCALE") + element * sizeof(value), &value, sizeof(value));
  };
  put(0, 1e-7f);  // thin
  put(1, 0.5f);
  put(2, 0.25f);
  put(4, 0.0f);  // flat
  const GaussianModel still = readModel(scratch.write("still.glb", glb.bytes())).model;
  // Stretched, then turned by the parent.
  const glm::dvec4 q = glm::normalize(glm::dvec4(0.8, 0.3, -0.4, 0.2));  // w, x, y, z
  const glm::dvec3 stretch(2.0, 0.25, 1.0), move(0.4, -0.7, 1.1);
  glb.json["nodes"][0]["scale"] = {stretch.x, stretch.y, stretch.z};
  glb.json["nodes"].push_back(
      {{"children", {0}}, {"rotation", {q.y, q.z, q.w, q.x}}, {"translation", {move.x, move.y, move.z}}});
  glb.json["scenes"][0]["nodes"] = {glb.json["nodes"].size() - 1};
  const Bundle read = readModel(scratch.write("moved.glb", glb.bytes()));
  const GaussianModel& moved = read.model;
  CHECK(read.warnings.empty());
  CHECK(checkFile(scratch.folder() / "moved.glb").errors.empty());
  REQUIRE(moved.size() == still.size());

  glm::dmat3 m = matrixFromQuaternion(q);  // in glTF's axes, then in the model's, which are half a turn from them
  for (int axis = 0; axis < 3; ++axis) m[axis] *= stretch[axis];
  const glm::dmat3 half(glm::dvec3(-1, 0, 0), glm::dvec3(0, -1, 0), glm::dvec3(0, 0, 1));
  m = half * m * half;
  const auto covariance = [](const GaussianModel& model, std::size_t i) {
    glm::dmat3 c = matrixFromQuaternion(glm::dvec4(model.rotation[i]));
    for (int k = 0; k < 3; ++k) c[k] *= std::exp(static_cast<double>(model.log_scale[i][k]));
    return c * glm::transpose(c);
  };
  const auto size = [](const glm::dmat3& a) {
    return std::sqrt(glm::dot(a[0], a[0]) + glm::dot(a[1], a[1]) + glm::dot(a[2], a[2]));
  };
  const auto volume = [](const GaussianModel& model, std::size_t i) {
    return static_cast<double>(model.log_scale[i].x) + model.log_scale[i].y + model.log_scale[i].z;
  };
  for (std::size_t i = 0; i < still.size(); ++i) {
    CAPTURE(i);
    const glm::dmat3 expected = m * covariance(still, i) * glm::transpose(m);
    CHECK(size(covariance(moved, i) - expected) < 1e-5 * size(expected));
    CHECK(glm::length(glm::dvec3(moved.mean[i]) - (m * glm::dvec3(still.mean[i]) + half * move)) < 1e-5);
    if (i != 1) CHECK(volume(moved, i) == Approx(volume(still, i) + std::log(0.5)).margin(1e-4));
  }
}

TEST_CASE("a GLB may have chunks of other kinds, and an empty BIN chunk") {
  const Scratch scratch;
  Glb glb = smallGlb(scratch);
  const GaussianModel expected = readModel(scratch.folder() / "small.glb").model;
  glb.json["buffers"][0]["uri"] = "beside.bin";
  scratch.write("beside.bin", glb.bin);
  glb.bin.clear();
  const std::string bare = glb.bytes();
  const auto with = [&](const std::string& chunks) {
    std::string bytes = bare + chunks;
    const auto length = static_cast<std::uint32_t>(bytes.size());
    std::memcpy(bytes.data() + 8, &length, sizeof(length));
    return scratch.write("chunks.glb", bytes);
  };
  const std::string empty("\0\0\0\0BIN\0", 8), other("\4\0\0\0????\1\2\3\4", 12);
  for (const std::string& chunks : {empty, other, other + other, empty + other}) {
    CHECK(readModel(with(chunks)).model == expected);
    CHECK(checkFile(scratch.folder() / "chunks.glb").errors.empty());
  }
  glb.json["buffers"][0].erase("uri");
  CHECK(contains(refusal(scratch.write("none.glb", glb.bytes())), "/buffers/0: has neither a uri nor a BIN chunk"));
}

TEST_CASE("two primitives become one model, padded to the higher degree") {
  const Scratch scratch;
  Glb glb = smallGlb(scratch);
  nlohmann::json second = glb.primitive();
  nlohmann::json kept = nlohmann::json::object();
  for (const auto& [name, accessor] : second["attributes"].items()) {
    if (!contains(name, "SH_DEGREE_1") && !contains(name, "SH_DEGREE_2") && !contains(name, "SH_DEGREE_3") &&
        !contains(name, "TG_")) {
      kept[name] = accessor;
    }
  }
  second["attributes"] = kept;
  second["extensions"]["KHR_gaussian_splatting"].erase("extensions");
  glb.json["meshes"][0]["primitives"].push_back(second);
  const GaussianModel one = readModel(scratch.folder() / "small.glb").model;
  const GaussianModel two = readModel(scratch.write("two.glb", glb.bytes())).model;
  REQUIRE(two.size() == 2 * one.size());
  CHECK(two.sh_degree == 3);
  CHECK(two.sh[one.size() * 16 + 1] == glm::vec3(0.0f));
  CHECK(two.atlas.rects[0].texelCount() == 16);
  CHECK(two.atlas.rects[one.size()].texelCount() == 0);
  CHECK(two.texture_mode == TextureMode::rgba);
}

TEST_CASE("what can be repaired is, with a warning that counts") {
  const Scratch scratch;
  Glb glb = smallGlb(scratch);
  const auto put = [&](const std::string& semantic, std::size_t element, float value) {
    std::memcpy(glb.bin.data() + glb.start(semantic) + element * sizeof(float), &value, sizeof(float));
  };
  put(kTg + "OPACITY", 0, 1.5f);
  put(kKhr + "SCALE", 3, -0.5f);
  put(kKhr + "ROTATION", 8, 3.0f);
  put("POSITION", 9, std::numeric_limits<float>::quiet_NaN());
  glb.accessor("POSITION").erase("min");
  glb.splatting()["colorSpace"] = "acescg";
  glb.splatting()["extensions"]["VND_other"] = {{"a", 1}};
  const Bundle loaded = readModel(scratch.write("a.glb", glb.bytes()));
  CHECK(loaded.model.size() == 11);
  CHECK(loaded.model.atlas.rects.size() == 11);
  std::string warnings;
  for (const std::string& warning : loaded.warnings) warnings += warning + "\n";
  CHECK(contains(warnings, "1 splats with an opacity outside [0, 1]: clamped"));
  CHECK(contains(warnings, "1 splats with a negative scale"));
  CHECK(contains(warnings, "1 splats with a quaternion that is not of unit length"));
  CHECK(contains(warnings, "1 splats with values that are not finite"));
  CHECK(contains(warnings, "POSITION: no min and max"));
  CHECK(contains(warnings, "unknown colorSpace \"acescg\""));
  CHECK(contains(warnings, "VND_other: unknown extension, ignored"));
}

TEST_CASE("source rotations that are none are passed over, also where they would be put in the texture's order") {
  const Scratch scratch;
  writeGlb(scratch.folder() / "a.glb", {test::makeScene(SceneKind::mixed, 12).model, {}, glm::vec3(0.0f)});
  const Glb whole = Glb::read(scratch.folder() / "a.glb");
  Glb bare = whole;
  bare.primitive()["attributes"].erase(kSourceRotation);
  bare.primitive()["attributes"].erase(kSourceLogScale);
  const GaussianModel stored = readModel(scratch.write("bare.glb", bare.bytes())).model;
  REQUIRE(stored.texture_mode != TextureMode::none);
  for (const float value : {0.0f, 1e-30f, 1e30f, std::numeric_limits<float>::quiet_NaN()}) {
    CAPTURE(value);
    Glb glb = whole;
    glb.setAttribute(kSourceRotation, std::vector<float>(4 * stored.size(), value), 5126, "VEC4", false, stored.size());
    CHECK(readModel(scratch.write("spoilt.glb", glb.bytes())).model == stored);
  }
}

TEST_CASE("a GLB with embedded data URIs and a .gltf of the same JSON are read alike") {
  const Scratch scratch;
  Glb glb = smallGlb(scratch);
  constexpr const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  glb.bin.resize((glb.bin.size() + 2) / 3 * 3, '\0');
  std::string base64;
  for (std::size_t i = 0; i < glb.bin.size(); i += 3) {
    const auto byte = [&](std::size_t k) {
      return static_cast<std::uint32_t>(static_cast<std::uint8_t>(glb.bin[i + k]));
    };
    const std::uint32_t group = byte(0) << 16 | byte(1) << 8 | byte(2);
    for (int shift = 18; shift >= 0; shift -= 6) base64 += digits[group >> shift & 63];
  }
  glb.json["buffers"][0] = {{"byteLength", glb.bin.size()}, {"uri", "data:application/octet-stream;base64," + base64}};
  const Bundle text = readModel(scratch.write("a.gltf", glb.json.dump()));
  glb.bin.clear();
  const Bundle binary = readModel(scratch.write("b.glb", glb.bytes()));
  CHECK(text.format == "gltf");
  CHECK(binary.format == "glb");
  CHECK(text.model.mean == binary.model.mean);
  CHECK(text.model.atlas.texels == binary.model.atlas.texels);
}

TEST_CASE("integers that are written as decimals are integers") {
  const Scratch scratch;
  const std::function<void(nlohmann::json&)> asDecimals = [&](nlohmann::json& value) {
    if (value.is_number_integer()) value = value.get<double>();  // written as 3.0
    if (value.is_structured()) std::ranges::for_each(value, asDecimals);
  };
  Glb glb = smallGlb(scratch);
  const GaussianModel expected = readModel(scratch.folder() / "small.glb").model;
  const auto agrees = [&](const std::filesystem::path& path) {
    const CheckReport report = checkFile(path);
    CAPTURE(path, describe(report));
    CHECK(report.errors.empty());
    CHECK(report.warnings.empty());
    CHECK(readModel(path).model == expected);
  };
  asDecimals(glb.json);
  CHECK(contains(glb.bytes(), "\"mode\":0.0"));
  agrees(scratch.write("decimals.glb", glb.bytes()));

  nlohmann::json beside = glb.json;
  beside["buffers"][0]["uri"] = "decimals.bin";
  scratch.write("decimals.bin", glb.bin);
  std::string text = beside.dump();
  const std::string count = "\"count\":12.0", exponent = "\"count\":1.2e1";
  for (std::size_t at = text.find(count); at != text.npos; at = text.find(count)) {
    text.replace(at, count.size(), exponent);
  }
  CHECK(contains(text, exponent));
  agrees(scratch.write("decimals.gltf", text));

  std::string longer = glb.bytes();  // with a chunk of another kind it is read as a whole
  longer.append("\4\0\0\0????\0\0\0\0", 12);
  const auto length = static_cast<std::uint32_t>(longer.size());
  std::memcpy(longer.data() + 8, &length, sizeof(length));
  agrees(scratch.write("longer.glb", longer));

  if (hasMeshopt()) {
    writeGlb(scratch.folder() / "packed.glb", {smallModel(), {}, glm::vec3(0.0f), {.meshopt = true}});
    Glb packed = Glb::read(scratch.folder() / "packed.glb");
    asDecimals(packed.json);
    agrees(scratch.write("packed.glb", packed.bytes()));
  }

  // Numbers that are floats anyway ask for no second copy of the file.
  const auto rewritten = [](const std::string& json) {
    return parseGltfJson({reinterpret_cast<const std::uint8_t*>(json.data()), json.size()}, "a").rewritten;
  };
  CHECK_FALSE(rewritten(R"({"accessors": [{"min": [0.0], "max": [1.0]}], "meshes": [{"weights": [0.0]}], "nodes":
                            [{"matrix": [1.0], "translation": [0.0], "rotation": [1.0], "scale": [2.0]}]})"));
  CHECK(rewritten(R"({"accessors": [{"min": [0.0], "count": 1.0}]})"));

  // What is no integer, or none that 32 bits hold, stays what it is.
  glb.json["scene"] = 0.5;
  CHECK(contains(refusal(scratch.write("half.glb", glb.bytes())), "/scene: wrong value (expected an integer >= 0"));
  glb.json["scene"] = 4294967296.0;
  CHECK(contains(refusal(scratch.write("large.glb", glb.bytes())), "/scene: wrong value (expected an integer >= 0"));
}

TEST_CASE("every broken promise has its message, with the place, what was expected and what was found") {
  const Scratch scratch;
  using Change = std::function<void(Glb&)>;
  const auto attribute = [](const std::string& name) { return kPrimitive + "/attributes/" + name; };
  const std::string extension =
      kPrimitive + "/extensions/KHR_gaussian_splatting/extensions/TG_gaussian_splatting_texture";
  const std::string views = std::to_string(smallGlb(scratch).json["bufferViews"].size());
  const auto noView = [&](const std::string& found) {
    return "/extensions/" + kSpz + ": \"bufferView\" names no buffer view (expected an index below " + views +
           ", found " + found + ")";
  };
  const std::vector<std::pair<Change, std::string>> cases = {
      // The document.
      {[](Glb& g) { g.json["asset"]["version"] = "1.0"; }, "/asset/version: another version of glTF (expected 2.x"},
      {[](Glb& g) { g.json.erase("asset"); }, "/: \"asset\" is missing"},
      {[](Glb& g) {
         g.json["asset"]["version"] = "2.9";
         g.json["asset"]["minVersion"] = "2.10";
       },
       "/asset/minVersion: another version of glTF is needed (expected at most 2.0, found \"2.10\")"},
      {[](Glb& g) { g.json["extensionsRequired"] = {"KHR_draco_mesh_compression"}; },
       "/extensionsRequired/0: the file requires KHR_draco_mesh_compression"},
      {[](Glb& g) { g.json["buffers"][0]["byteLength"] = 1u << 30; }, "/buffers/0/byteLength: leaves the BIN chunk"},
      {[](Glb& g) { g.json["buffers"][0]["uri"] = "../secret.bin"; },
       "/buffers/0/uri: no name of a file beside this one"},
      {[](Glb& g) { g.json["images"][0] = {{"uri", "/etc/passwd"}}; },
       "/images/0/uri: no name of a file beside this one"},
      {[](Glb& g) { g.json["bufferViews"][1]["byteLength"] = 18446744073709551615ull; },
       "/bufferViews/1: leaves buffer 0"},
      {[](Glb& g) { g.json["bufferViews"][1]["byteOffset"] = -4; },
       "/bufferViews/1/byteOffset: wrong value (expected an integer >= 0, found -4)"},
      {[](Glb& g) { g.json["bufferViews"][1]["buffer"] = 9; }, "/bufferViews/1/buffer: no such buffer"},
      {[](Glb& g) { g.json["accessors"][0]["count"] = 4294967308ull; }, "/accessors/0/count: wrong count"},
      {[](Glb& g) { g.json["accessors"][0]["count"] = 13; }, "/accessors/0: leaves its bufferView"},
      {[](Glb& g) { g.json["accessors"][0]["bufferView"] = 4294967296ull; },
       "/accessors/0/bufferView: integer out of range"},
      {[](Glb& g) { g.json["accessors"][0]["byteOffset"] = 18446744073709551612ull; },
       "/accessors/0: leaves its bufferView"},
      {[](Glb& g) { g.json["accessors"][0]["componentType"] = 5130; }, "/accessors/0/componentType: no component type"},
      {[](Glb& g) { g.json["accessors"][0]["type"] = "VEC9"; }, "/accessors/0/type: no accessor type"},
      {[](Glb& g) { g.json["nodes"][0]["mesh"] = 3; }, "/nodes/0/mesh: no such mesh (expected an index below 1"},
      {[](Glb& g) { g.json["nodes"][0]["children"] = {0}; }, "/nodes/0: the node is reached twice"},
      {[](Glb& g) { g.json["nodes"] = 5; }, "/nodes: wrong type (expected an array, found 5)"},
      {[](Glb& g) { g.json["nodes"][0]["scale"] = {1, 2, 1}; },
       "/nodes/0: a transform that stretches is not supported"},
      {[](Glb& g) { g.json["nodes"][0]["scale"] = {-1, 1, 1}; }, "/nodes/0: the transform mirrors"},
      {[](Glb& g) { g.json["nodes"][0]["scale"] = {0, 1, 2}; },
       "/nodes/0: the transform mirrors or flattens (expected a scale per axis, a rotation and a translation)"},
      {[](Glb& g) { g.json["nodes"][0]["matrix"] = {1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}; },
       "/nodes/0: the transform shears (expected a scale per axis, a rotation and a translation)"},
      {[](Glb& g) { g.json["nodes"][0]["matrix"] = {1, 0, 0, 0.1, 0, 2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}; },
       "/nodes/0: the transform is projective (expected a scale per axis, a rotation and a translation)"},
      {[](Glb& g) { g.json["scene"] = 1; }, "/scene: no such scene"},
      {[](Glb& g) { g.json["scenes"][0]["nodes"] = nlohmann::json::array(); }, "the scene holds no splats"},
      // The base.
      {[](Glb& g) { g.primitive()["mode"] = 4; },
       kPrimitive + "/mode: wrong mode for splats (expected 0, POINTS, found 4)"},
      {[](Glb& g) { g.splatting().erase("kernel"); },
       "KHR_gaussian_splatting: \"kernel\" is missing (expected \"ellipse\")"},
      {[](Glb& g) { g.splatting()["kernel"] = 1; },
       "KHR_gaussian_splatting: wrong type of \"kernel\" (expected a string, found 1)"},
      {[](Glb& g) { g.splatting()["kernel"] = nlohmann::json::object(); },
       "KHR_gaussian_splatting: wrong type of \"kernel\" (expected a string, found {})"},
      {[](Glb& g) { g.splatting()["kernel"] = "surfel"; },
       "\"kernel\" is not supported (expected \"ellipse\", found \"surfel\")"},
      {[](Glb& g) { g.primitive()["attributes"].erase(kKhr + "SCALE"); },
       "the attribute KHR_gaussian_splatting:SCALE is missing"},
      {[](Glb& g) { g.primitive()["attributes"].erase("POSITION"); }, "the attribute POSITION is missing"},
      {[](Glb& g) { g.primitive()["attributes"].erase(kKhr + "SH_DEGREE_2_COEF_3"); },
       "SH degree 2 is incomplete: KHR_gaussian_splatting:SH_DEGREE_2_COEF_3 is missing"},
      {[](Glb& g) {
         for (int k = 0; k < 3; ++k) g.primitive()["attributes"].erase(kKhr + "SH_DEGREE_1_COEF_" + std::to_string(k));
       },
       "SH degree 2 stands without degree 1"},
      {[](Glb& g) { g.accessor(kKhr + "ROTATION")["type"] = "VEC3"; },
       attribute(kKhr + "ROTATION") +
           ": wrong type (expected VEC4 of float / normalised byte / normalised short, found VEC3 of float)"},
      {[](Glb& g) { g.accessor(kKhr + "OPACITY")["count"] = 11; },
       attribute(kKhr + "OPACITY") + ": the count differs from POSITION's (expected 12, found 11)"},
      {[](Glb& g) { g.accessor("POSITION").erase("bufferView"); },
       attribute("POSITION") + ": without a bufferView is not supported"},
      {[](Glb& g) { g.primitive()["attributes"]["_ROTATION"] = 1; }, "a pre-release draft of KHR_gaussian_splatting"},
      {[](Glb& g) { g.splatting()["extensions"]["KHR_gaussian_splatting_compression_lgsc"] = {{"bufferView", 0}}; },
       "this compression of splats is not supported (KHR_gaussian_splatting_compression_spz_2 is)"},
      {[](Glb& g) { g.splatting()["extensions"][kSpz] = {{"bufferView", 0}}; },
       "/KHR_gaussian_splatting_compression_spz_2: SPZ: the header does not start with NGSP"},
      {[](Glb& g) { g.splatting()["extensions"][kSpz] = {{"bufferView", 99}}; }, noView("99")},
      {[](Glb& g) { g.splatting()["extensions"][kSpz] = {{"bufferView", 4294967296ull}}; }, noView("4294967296")},
      {[](Glb& g) { g.splatting()["extensions"][kSpz] = {{"bufferView", "0"}}; }, noView("\"0\"")},
      {[](Glb& g) { g.splatting()["extensions"][kSpz] = {{"bufferView", nullptr}}; }, noView("null")},
      {[](Glb& g) { g.splatting()["extensions"][kSpz] = {{"bufferView", nlohmann::json::object()}}; }, noView("{}")},
      {[](Glb& g) { g.splatting()["extensions"][kSpz] = nlohmann::json::object(); }, noView("none")},
      {[](Glb& g) { g.splatting()["extensions"][kSpz] = nullptr; }, noView("none")},
      {[](Glb& g) { g.splatting()["extensions"][kSpz] = 3; }, noView("none")},
      {[](Glb& g) { g.splatting() = nullptr; },
       kPrimitive + "/extensions/KHR_gaussian_splatting: wrong type (expected an object, found null)"},
      {[](Glb& g) { g.splatting() = nlohmann::json::array(); },
       kPrimitive + "/extensions/KHR_gaussian_splatting: wrong type (expected an object, found [])"},
      {[](Glb& g) { g.splatting() = 5; },
       kPrimitive + "/extensions/KHR_gaussian_splatting: wrong type (expected an object, found 5)"},
      {[](Glb& g) { g.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0}}; },
       "/bufferViews/0/extensions/EXT_meshopt_compression: \"byteLength\" is missing"},
      // The texture layer.
      {[](Glb& g) { g.textures() = 5; }, extension + ": is no object"},
      {[](Glb& g) { g.textures()["mode"] = "rgbx"; },
       extension + ": unknown \"mode\" (expected \"alpha\", \"rgb\" or \"rgba\", found \"rgbx\")"},
      {[](Glb& g) { g.textures().erase("mode"); }, extension + ": unknown \"mode\""},
      {[](Glb& g) { g.textures()["intersection"] = "sphere"; }, "unknown \"intersection\""},
      {[](Glb& g) { g.textures()["extent"] = 0; }, "\"extent\" is not supported (expected 3, found 0"},
      {[](Glb& g) { g.textures()["filter"] = "nearest"; }, "\"filter\" is not supported"},
      {[](Glb& g) { g.textures()["atlases"] = nlohmann::json::array(); },
       "\"atlases\" is wrong (expected an array of 1 to 255, found none)"},
      {[](Glb& g) { g.textures()["atlases"] = nlohmann::json(256, {{"color", 0}}); },
       "(expected an array of 1 to 255, found 256)"},
      {[](Glb& g) { g.textures()["atlases"][0]["color"] = 7; },
       extension + "/atlases/0: \"color\" names no texture (expected an index below 2, found 7)"},
      {[](Glb& g) { g.textures()["atlases"][0].erase("alpha"); }, "\"alpha\" is missing (the mode needs it)"},
      {[](Glb& g) { g.textures()["atlases"][0]["scale"] = {1, 2, 3}; },
       "\"scale\" is wrong (expected 4 finite numbers)"},
      {[](Glb& g) { g.json["textures"][0].erase("source"); }, "texture 0 has no source image"},
      {[](Glb& g) { g.json["images"][0]["mimeType"] = "image/jpeg"; },
       "/images/0: an atlas of another type (expected image/png, found image/jpeg)"},
      {[](Glb& g) { g.json["images"][0]["bufferView"] = 0; }, "/images/0: the image is no PNG"},
      {[](Glb& g) {
         const std::size_t view = g.json["images"][0]["bufferView"].get<std::size_t>();
         const std::size_t at = g.json["bufferViews"][view]["byteOffset"].get<std::size_t>();
         g.bin[at + 16] = 0x7f;  // width of the header chunk
       },
       "/images/0: the atlas is too large"},
      {[](Glb& g) { g.primitive()["attributes"].erase(kTg + "RECT"); },
       "the attribute TG_gaussian_splatting_texture:RECT is missing"},
      {[](Glb& g) { g.accessor(kTg + "RECT")["normalized"] = true; },
       "expected VEC4 of ushort, found VEC4 of normalised ushort"},
      {[](Glb& g) {
         const std::uint16_t far = 60000;
         std::memcpy(g.bin.data() + g.start(kTg + "RECT") + 5 * 8, &far, 2);
       },
       attribute(kTg + "RECT") + ": splat 5: the rectangle leaves its atlas"},
      {[](Glb& g) {
         g.setAttribute(kTg + "ATLAS", std::vector<std::uint8_t>(12 * 4, 1), 5121, "SCALAR", false, 12);
         g.view(kTg + "ATLAS")["byteStride"] = 4;
       },
       attribute(kTg + "ATLAS") + ": splat 0 names no atlas (expected below 1, found 1)"},
      {[](Glb& g) { g.primitive()["extensions"]["TG_gaussian_splatting_texture"] = g.textures(); },
       kPrimitive + "/extensions/TG_gaussian_splatting_texture: wrong place (expected inside KHR_gaussian_splatting)"},
  };
  const Glb good = smallGlb(scratch);
  for (const auto& [change, expected] : cases) {
    Glb glb = good;
    change(glb);
    const std::string found = refusal(scratch.write("bad.glb", glb.bytes()));
    CAPTURE(expected, found);
    CHECK(contains(found, expected));
  }
}

TEST_CASE("a broken texture layer is refused, and its base shown on request only") {
  const Scratch scratch;
  Glb glb = smallGlb(scratch);
  glb.textures()["mode"] = "unheard-of";
  const auto path = scratch.write("a.glb", glb.bytes());
  CHECK(refusal(path) != "accepted");
  const Bundle base = readModel(path, {.base_only = true});
  CHECK(base.model.size() == 12);
  CHECK(base.model.texture_mode == TextureMode::none);
}

TEST_CASE("a GLB cut at any length is refused") {
  const Scratch scratch;
  smallGlb(scratch);
  const std::string bytes = Glb::slurp(scratch.folder() / "small.glb");
  for (std::size_t length = 0; length < bytes.size(); length += length < 64 ? 1 : 37) {
    const std::string found = refusal(scratch.write("cut.glb", bytes.substr(0, length)));
    CAPTURE(length, found);
    REQUIRE(found != "accepted");
    REQUIRE(!contains(found, "another exit code"));
    if (length >= 20) {
      REQUIRE(contains(found, "the file is cut off (expected " + std::to_string(bytes.size()) + " bytes, found " +
                                  std::to_string(length) + ")"));
    }
  }
  // The same with a header that admits the cut: chunks and JSON are then what catches it.
  for (std::size_t length = 12; length < bytes.size(); length += length < 128 ? 4 : 36) {
    std::string cut = bytes.substr(0, length);
    const auto size = static_cast<std::uint32_t>(length);
    std::memcpy(cut.data() + 8, &size, 4);
    const std::string found = refusal(scratch.write("cut.glb", cut));
    CAPTURE(length, found);
    REQUIRE(found != "accepted");
    REQUIRE(!contains(found, "another exit code"));
  }
}

TEST_CASE("a GLB with any one byte of its JSON changed is read or refused, never worse") {
  const Scratch scratch;
  smallGlb(scratch);
  const std::string bytes = Glb::slurp(scratch.folder() / "small.glb");
  const std::size_t end = 20 + Glb::u32(bytes, 12);
  test::Random random(33);
  for (int n = 0; n < 400; ++n) {
    std::string changed = bytes;
    const auto at = static_cast<std::size_t>(random.uniform(0.0, static_cast<double>(end)));
    changed[at] = static_cast<char>(static_cast<int>(random.uniform(0.0, 256.0)));
    const std::string found = refusal(scratch.write("changed.glb", changed));
    CAPTURE(at, found);
    CHECK(!contains(found, "without the path"));
  }
}

TEST_CASE("a GLB with any one JSON value replaced is read or refused, never worse") {
  const Scratch scratch;
  const Glb good = smallGlb(scratch);
  std::vector<nlohmann::json::json_pointer> places;
  const std::function<void(const nlohmann::json&, const nlohmann::json::json_pointer&)> collect =
      [&](const nlohmann::json& value, const nlohmann::json::json_pointer& at) {
        if (!at.empty()) places.push_back(at);
        if (value.is_object()) {
          for (const auto& [key, child] : value.items()) collect(child, at / key);
        } else if (value.is_array()) {
          for (std::size_t i = 0; i < value.size(); ++i) collect(value[i], at / i);
        }
      };
  collect(good.json, nlohmann::json::json_pointer());
  const std::vector<nlohmann::json> nasty = {nullptr,
                                             true,
                                             -1,
                                             0,
                                             1,
                                             3,
                                             255,
                                             65536,
                                             2147483647,
                                             2147483648u,
                                             4294967295u,
                                             4294967296u,
                                             18446744073709551615u,
                                             1e308,
                                             -0.5,
                                             "",
                                             "data:image/png;base64,AAAA",
                                             nlohmann::json::array(),
                                             nlohmann::json::object(),
                                             nlohmann::json::array({0, 0}),
                                             nlohmann::json::array({nullptr}),
                                             {{"a", 1}}};
  test::Random random(34);
  for (const auto& place : places) {
    for (int n = 0; n < 2; ++n) {
      Glb glb = good;
      const auto& value = nasty[static_cast<std::size_t>(random.uniform(0.0, static_cast<double>(nasty.size())))];
      glb.json[place] = value;
      const std::string found = refusal(scratch.write("changed.glb", glb.bytes()));
      CAPTURE(place.to_string(), value.dump(), found);
      CHECK(!contains(found, "without the path"));
    }
  }
}

TEST_CASE("a texture whose SCALE.z is not the smallest is drawn on the longer axes, with a warning") {
  const Scratch scratch;
  Glb glb = smallGlb(scratch);
  const float scales[3] = {0.1f, 0.2f, 0.3f};
  std::memcpy(glb.bin.data() + glb.start(kKhr + "SCALE") + 4 * sizeof(scales), scales, sizeof(scales));
  const Bundle loaded = readModel(scratch.write("a.glb", glb.bytes()));
  REQUIRE(loaded.warnings.size() == 1);
  CHECK(contains(loaded.warnings[0], "1 splats with a texture whose SCALE.z is not the smallest"));
}

TEST_CASE("JSON that is deep, broken or of another kind is refused in one line") {
  const Scratch scratch;
  const auto check = [&](const std::string& text, const std::string& expected) {
    const std::string found = refusal(scratch.write("a.gltf", text));
    CAPTURE(found);
    CHECK(contains(found, expected));
    CHECK(!contains(found, "\n"));
  };
  check("{\"asset\": " + std::string(100000, '['), "nests too deep");
  check("{\"asset\": }", "the JSON text is broken");
  check("{\"asset\": {\"version\": \"2.0\"}, \"extensionsRequired\": [\"a\\n\\u001b[31m\"]}",
        "the file requires a ?[31m, which");
  check("{}", "/: \"asset\" is missing");
  check("{\"asset\": {\"version\": \"2.0\"}}", "the scene holds no splats");
  check("{\"asset\": {\"version\": \"2.0\"}, \"buffers\": [{\"byteLength\": 4}]}", "/buffers/0: has neither a uri");
}
