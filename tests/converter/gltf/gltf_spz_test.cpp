// SPDX-License-Identifier: Apache-2.0
// Splats that a glTF file holds as an SPZ.
#include "converter/check.h"
#include "converter/formats/spz.h"
#include "converter/glb.h"
#include "converter/gltf/meshopt.h"
#include "converter/registry/file_format.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "converter/splat_files.h"
#include "support/catch.h"

using namespace tg;
using tg::test::SceneKind;

namespace {

constexpr const char* kSpz = "KHR_gaussian_splatting_compression_spz_2";

// A GLB of placeholders around an SPZ, as the draft's files are.
Glb glbAround(const std::string& spz, std::size_t count) {
  Glb glb;
  glb.bin = spz;
  const nlohmann::json vec3 = {{"componentType", 5126}, {"count", count}, {"type", "VEC3"}};
  nlohmann::json position = vec3, rotation = vec3;
  position["min"] = {-100, -100, -100};
  position["max"] = {100, 100, 100};
  rotation["type"] = "VEC4";
  glb.json = {{"asset", {{"version", "2.0"}}},
              {"extensionsUsed", {"KHR_gaussian_splatting", kSpz}},
              {"extensionsRequired", {"KHR_gaussian_splatting", kSpz}},
              {"scene", 0},
              {"scenes", {{{"nodes", {0}}}}},
              {"nodes", {{{"mesh", 0}}}},
              {"buffers", {{{"byteLength", spz.size()}}}},
              {"bufferViews", {{{"buffer", 0}, {"byteLength", spz.size()}}}},
              {"accessors", {position, vec3, rotation}}};
  nlohmann::json primitive = {
      {"mode", 0},
      {"attributes", {{"POSITION", 0}, {"KHR_gaussian_splatting:SCALE", 1}, {"KHR_gaussian_splatting:ROTATION", 2}}}};
  primitive["extensions"]["KHR_gaussian_splatting"]["extensions"][kSpz] = {{"bufferView", 0}};
  glb.json["meshes"] = {{{"primitives", nlohmann::json::array({primitive})}}};
  return glb;
}

}  // namespace

TEST_CASE("splats of an SPZ inside a glTF file are turned as the draft says") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(SceneKind::ordinary, 8);
  GaussianModel model = scene.model;
  model.texture_mode = TextureMode::none;
  model.atlas = {};
  writeSpz(scratch.folder() / "direct.spz", model);
  const GaussianModel direct = readModel(scratch.folder() / "direct.spz").model;
  const std::string spz = Glb::slurp(scratch.folder() / "direct.spz");
  const auto path = scratch.write("a.glb", glbAround(spz, model.size()).bytes());
  const Bundle loaded = readModel(path);
  REQUIRE(loaded.model.size() == direct.size());
  REQUIRE(loaded.model.sh_degree == 3);
  CHECK(glm::distance(loaded.model.mean[3], direct.mean[3]) < 1e-3f);
  // Rotations are rounded on either side of the turn; one coefficient with the wrong sign shows.
  const double turned = psnr(picture(direct, scene.camera), picture(loaded.model, scene.camera));
  CHECK(turned > 40.0);
  for (const std::size_t k : {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}) {
    GaussianModel wrong = loaded.model;
    for (std::size_t i = 0; i < wrong.size(); ++i) wrong.sh[i * 16 + k] *= -1.0f;
    CAPTURE(k);
    CHECK(psnr(picture(direct, scene.camera), picture(wrong, scene.camera)) < turned - 2.0);
  }
  CHECK(checkFile(path).errors.empty());
}

TEST_CASE("an SPZ inside a glTF file may be shorter than its buffer view by zeros") {
  const Scratch scratch;
  const GaussianModel model = test::makeScene(SceneKind::ordinary, 9, 12).model;
  for (const int version : {kOldestSpz, kNewestSpz}) {
    CAPTURE(version);
    SpzReport report;
    const std::vector<std::uint8_t> bytes = formatSpz(model, "a.spz", report, version);
    const std::string spz(bytes.begin(), bytes.end());
    const auto path = scratch.write("a.glb", glbAround(spz + std::string(3, '\0'), model.size()).bytes());
    CHECK(readModel(path).model == readModel(scratch.write("b.glb", glbAround(spz, model.size()).bytes())).model);
    CHECK(checkFile(path).errors.empty());
    CHECK(refusal(scratch.write("c.glb", glbAround(spz + "x", model.size()).bytes())).find("1 bytes follow the ") !=
          std::string::npos);
  }
}

TEST_CASE("an SPZ in a packed view is unpacked also where an accessor of another mesh has the view") {
  TG_SKIP_IF(hasMeshopt() ? std::string() : std::string(missingMeshopt()));
  const Scratch scratch;
  std::string spz;
  int count = 12;
  do {  // until its bytes are whole elements
    writeSpz(scratch.folder() / "a.spz", test::makeScene(SceneKind::ordinary, 9, ++count).model);
    spz = Glb::slurp(scratch.folder() / "a.spz");
  } while (spz.size() % 4 != 0);
  const Glb plain = glbAround(spz, static_cast<std::size_t>(count));
  const GaussianModel expected = readModel(scratch.write("plain.glb", plain.bytes())).model;
  Glb glb = plain;
  const std::vector<std::uint8_t> stream = packMeshopt(std::vector<std::uint8_t>(spz.begin(), spz.end()), 4);
  glb.bin.assign(stream.begin(), stream.end());
  glb.json["buffers"][0]["byteLength"] = stream.size();
  glb.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},
                                                                         {"byteLength", stream.size()},
                                                                         {"byteStride", 4},
                                                                         {"count", spz.size() / 4},
                                                                         {"mode", "ATTRIBUTES"}};
  nlohmann::json other = glb.json["accessors"][0];
  other["bufferView"] = 0;
  other["count"] = 1;
  glb.json["accessors"].push_back(other);
  CHECK(readModel(scratch.write("packed.glb", glb.bytes())).model == expected);
}

TEST_CASE("an SPZ inside a glTF file that is broken, cut or of another count is refused") {
  const Scratch scratch;
  const GaussianModel model = test::makeScene(SceneKind::ordinary, 9, 12).model;
  writeSpz(scratch.folder() / "a.spz", model);
  const std::string spz = Glb::slurp(scratch.folder() / "a.spz");
  CHECK(refusal(scratch.write("b.glb", glbAround(spz, 13).bytes())) ==
        "/meshes/0/primitives/0/extensions/KHR_gaussian_splatting/extensions/" + std::string(kSpz) +
            ": the count differs from POSITION's (expected 13, found 12)");
  for (std::size_t length = 0; length < spz.size(); length += 3) {
    const std::string message = refusal(scratch.write("c.glb", glbAround(spz.substr(0, length), 12).bytes()));
    CAPTURE(length, message);
    CHECK(message != "accepted");
  }
}
