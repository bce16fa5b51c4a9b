// SPDX-License-Identifier: Apache-2.0
// Pages: the model in them is the one a GLB would hold, and a spoilt page is refused. What a browser shows: tests/web.
#include "converter/html/html.h"

#include "converter/edit/edit.h"
#include "converter/glb.h"
#include "converter/gltf/meshopt.h"
#include "converter/registry/file_format.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "render/settings.h"
#include "support/catch.h"

using namespace tg;

TEST_CASE("a page holds the GLB of its model, byte for byte, and the same bytes every time") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 61, 300);
  const std::vector<Camera> cameras = {scene.camera};
  const bool packed = GENERATE(false, true);
  TG_SKIP_IF(packed && !hasMeshopt() ? std::string(missingMeshopt()) : std::string());
  GltfContent content{scene.model, cameras, glm::vec3(0.25f), {.lean = true}};
  if (packed) content.options = {.lean = true, .atlas = AtlasFormat::webp, .steps = 1.0f};
  writeGlb(scratch.folder() / "a.glb", content);
  const GltfReport report = writeHtml(scratch.folder() / "a & b <c>.html", content);

  const std::string page = Glb::slurp(scratch.folder() / "a & b <c>.html");
  CHECK(report.output_bytes == page.size());
  CHECK(page.find("<title>a &amp; b &lt;c></title>") != std::string::npos);
  CHECK(page.find("@PAYLOAD@") == std::string::npos);
  const std::vector<std::uint8_t> glb = readHtmlGlb(scratch.folder() / "a & b <c>.html");
  CHECK(std::string(glb.begin(), glb.end()) == Glb::slurp(scratch.folder() / "a.glb"));

  std::filesystem::create_directory(scratch.folder() / "again");
  writeHtml(scratch.folder() / "again" / "a & b <c>.html", content);
  CHECK(Glb::slurp(scratch.folder() / "again" / "a & b <c>.html") == page);

  const Bundle loaded = readModel(scratch.folder() / "a & b <c>.html");
  CHECK(loaded.format == "html");
  CHECK(loaded.model.size() == 300);
  CHECK(loaded.model.texture_mode == scene.model.texture_mode);
  CHECK(loaded.cameras.size() == 1);
  CHECK(std::distance(std::filesystem::directory_iterator(scratch.folder()), {}) == 3);  // no temporary file
}

TEST_CASE("a page says how long its model is") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 62, 300);
  writeHtml(scratch.folder() / "a.html", {scene.model, {}, glm::vec3(0.0f)});
  const std::string page = Glb::slurp(scratch.folder() / "a.html");
  std::size_t characters = 0;
  for (std::size_t at = page.find(kHtmlModelTag); at != std::string::npos; at = page.find(kHtmlModelTag, at + 1)) {
    characters += page.find(kHtmlModelEnd, at) - at - kHtmlModelTag.size();
  }
  CHECK(characters > 0);
  CHECK(page.find("watchLoading(\"" + std::to_string(characters) + " ") != std::string::npos);
}

TEST_CASE("views stand in a GLB by name, turned as the model is") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 63, 100);
  Bundle source;
  source.model = scene.model;
  source.views = {scene.camera};
  source.views[0].name = "from afar";
  const std::vector<Edit> edits = {{"--scale", "2"}, {"--translate", "1,0,0"}};
  applyEdits(source, edits, false);
  CHECK(source.cameras.empty());
  const std::vector<Camera>& views = source.views;
  REQUIRE(views.size() == 1);
  const glm::dvec3 eye = 2.0 * scene.camera.position() + glm::dvec3(1, 0, 0);
  CHECK(glm::length(views[0].position() - eye) < 1e-9);
  writeGlb(scratch.folder() / "a.glb", {source.model, {}, glm::vec3(0.0f), {}, views});
  const nlohmann::json extras = Glb::read(scratch.folder() / "a.glb").json["asset"]["extras"]["textured_gaussians"];
  REQUIRE(extras.contains("views"));
  REQUIRE(extras["views"].size() == 1);
  const nlohmann::json& view = extras["views"][0];
  CHECK(view["name"] == "from afar");
  CHECK(view["translation"][0].get<double>() == -views[0].position().x);  // glTF's axes
  CHECK(view["fx"].get<double>() == scene.camera.focal.x);
  const Bundle read = readModel(scratch.folder() / "a.glb");
  CHECK(read.cameras.empty());
  REQUIRE(read.views.size() == 1);
  CHECK(read.views[0].name == "from afar");
  CHECK(glm::length(read.views[0].position() - views[0].position()) < 1e-9);
  for (int k = 0; k < 3; ++k) CHECK(glm::length(read.views[0].rotation[k] - views[0].rotation[k]) < 1e-9);
  CHECK(read.views[0].focal == views[0].focal);
  CHECK(read.views[0].center == views[0].center);
  CHECK(read.views[0].size == views[0].size);
}

TEST_CASE("views do not say which way is up, and turn with the model") {
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 64, 20);
  Bundle alone, viewed;
  alone.model = viewed.model = scene.model;
  alone.cameras = viewed.cameras = {scene.camera};
  Camera on_its_side = scene.camera;
  on_its_side.rotation = glm::dmat3({0, 1, 0}, {-1, 0, 0}, {0, 0, 1}) * on_its_side.rotation;
  viewed.views = {scene.camera, on_its_side};
  const std::vector<Edit> edits = {{"--upright", ""}};
  applyEdits(alone, edits, false);
  applyEdits(viewed, edits, false);
  CHECK(viewed.cameras[0].rotation == alone.cameras[0].rotation);
  CHECK(viewed.views[0].rotation == alone.cameras[0].rotation);
  CHECK(viewed.views[1].rotation != on_its_side.rotation);
}

TEST_CASE("views that are cameras of a merged model, too, take none of its cameras away") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 65, 20);
  Bundle source, other;
  source.model = other.model = scene.model;
  other.cameras = {scene.camera};
  writeBundle(scratch.folder() / "other.tgz", other);
  source.views = readModel(scratch.folder() / "other.tgz").cameras;
  const std::vector<Edit> edits = {{"--merge", (scratch.folder() / "other.tgz").string()}};
  applyEdits(source, edits, false);
  CHECK(source.cameras.size() == 1);
  CHECK(source.views.size() == 1);
}

TEST_CASE("what cannot be a page is refused by the page's name") {
  const Scratch scratch;
  const std::filesystem::path path = scratch.folder() / "a.html";
  CHECK(test::messageOf([&] { writeHtml(path, {GaussianModel(), {}, glm::vec3(0.0f)}); }) ==
        path.string() + ": the model has no Gaussians");
}

TEST_CASE("a page names nothing outside itself") {
  const Scratch scratch;
  writeHtml(scratch.folder() / "a.html",
            {test::makeScene(test::SceneKind::ordinary, 62, 3).model, {}, glm::vec3(0.0f)});
  const std::string page = Glb::slurp(scratch.folder() / "a.html");
  for (const char* mark : {"http:", "https:", "src=", "href=", "import ", "@import", "url("}) {
    CAPTURE(mark);
    CHECK(page.find(mark) == std::string::npos);
  }
  CHECK(page.find("#include \"") == std::string::npos);  // <...> stand in parts that are for C++
}

TEST_CASE("a page takes every setting of the picture from its address or says that it has none such") {
  const Scratch scratch;
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 66, 5);
  writeHtml(scratch.folder() / "a.html", {scene.model, {}, glm::vec3(0.0f)});
  const std::string page = Glb::slurp(scratch.folder() / "a.html");
  const std::size_t list = page.find("const ONLY_TGVIEW = [");
  REQUIRE(list != std::string::npos);
  const std::string lacks = page.substr(list, page.find("];", list) - list);
  for (const RenderSetting& setting : renderSettings()) {
    const std::string name = "'" + std::string(setting.name) + "'";
    INFO(name);
    const bool takes = page.find("choice(" + name) != std::string::npos ||
                       page.find("this.settings." + std::string(setting.name) + " = ") != std::string::npos;
    CHECK(takes == (lacks.find(name) == std::string::npos));
  }
}

TEST_CASE("spoilt pages are refused with a word") {
  const Scratch scratch;
  writeHtml(scratch.folder() / "a.html",
            {test::makeScene(test::SceneKind::ordinary, 63, 40).model, {}, glm::vec3(0.0f)});
  const std::string page = Glb::slurp(scratch.folder() / "a.html");
  const std::size_t model = page.find("class=\"model\">") + 14;
  const auto with = [&](std::size_t at, char c) {
    std::string spoilt = page;
    spoilt[at] = c;
    return refusal(scratch.write("spoilt.html", spoilt));
  };
  CHECK(refusal(scratch.write("foreign.html", "<!doctype html><p>hello")) ==
        "the page holds no model (expected one that tgconvert wrote)");
  CHECK(refusal(scratch.write("short.html", page.substr(0, model + 1000))) == "the page ends early");
  CHECK(with(model + 40, '*') == "the page's model is no base64");
  CHECK(with(model, 'A').find("gzip stream") != std::string::npos);
  // Anywhere in the packed bytes: the stream or its checksum notices.
  for (std::size_t at = model + 20; at + 100 < page.find("</script>", model); at += 997) {
    CAPTURE(at);
    CHECK(with(at, page[at] == 'B' ? 'C' : 'B') != "accepted");
  }
}
