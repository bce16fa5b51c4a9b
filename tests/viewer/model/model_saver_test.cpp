// SPDX-License-Identifier: Apache-2.0
// Models written beside the window.
#include "viewer/model/model_saver.h"

#include <thread>

#include "converter/registry/file_format.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/tiny_model.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "viewer/model/scene_of.h"

using namespace tg;

namespace {

Scene sceneWithAll() {
  Bundle bundle;
  bundle.model = tinyTexturedModel(6);
  bundle.cameras = {lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 48)};
  bundle.background = glm::vec3(1.0f);
  bundle.training_json = "{\"stages\": {}}";
  return sceneOf(std::move(bundle), "tiny.tgz");
}

ModelSaver::News next(ModelSaver& saver) {
  for (int i = 0; i < 30000; ++i) {
    if (auto news = saver.take()) return *news;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  FAIL("saving does not end");
  return {};
}

}  // namespace

TEST_CASE("a file that the system refuses is a problem of that file") {
  const TemporaryFolder folder;
  ModelSaver saver([] {});
  for (const std::string extension : {".tgz", ".ply", ".glb", ".html", ".sog"}) {
    INFO(extension);
    saver.save(folder / (std::string(300, 'x') + extension), sceneWithAll());
    const ModelSaver::News news = next(saver);
    CHECK_THAT(news.problem, Contains("xxx"));
    CHECK(news.error_kind == static_cast<int>(ErrorKind::cannotWrite));
  }
}

TEST_CASE("a scene is saved as everything that the converter writes and reads, with a word about what is lost") {
  const TemporaryFolder folder;
  const Scene scene = sceneWithAll();
  const std::vector<FileType> types = modelTypes(scene);
  REQUIRE(types.size() > 5);
  CHECK(types.front().extension == ".tgz");
  CHECK(types.front().note.empty());
  ModelSaver saver([] {});
  for (const FileType& type : types) {
    INFO(type.extension);
    const std::filesystem::path file = folder / ("saved" + type.extension);
    saver.save(file, scene);
    const ModelSaver::News news = next(saver);
    CHECK(news.problem == "");
    CHECK(news.path == file);
    const Bundle back = readModel(file);
    CHECK(back.model.size() == scene.model->size());
    const bool textured = back.model.atlas.rects.size() > 0 && isTextured(back.model);
    CHECK(textured == (type.note.find("textures") == std::string::npos));
    CHECK(back.cameras.empty() == (type.note.find("cameras") != std::string::npos));
  }
  CHECK(readModel(folder / "saved.tgz").training_json == scene.training_json);
}

TEST_CASE("a model that cannot be saved is a problem with its file's name, and leaves nothing behind") {
  const TemporaryFolder folder;
  ModelSaver saver([] {});
  saver.save(folder / "none/saved.tgz", sceneWithAll());
  CHECK_THAT(next(saver).problem, Contains("none"));
  saver.save(folder / "saved.nothing", sceneWithAll());
  CHECK_THAT(next(saver).problem, Contains("is no model format"));
  CHECK(std::filesystem::is_empty(folder.path));
}

TEST_CASE("the saver says which revision of which model a file holds, and whether that is all of it") {
  const TemporaryFolder folder;
  const Scene scene = sceneWithAll();
  ModelSaver saver([] {});
  for (const bool whole : {true, false}) {
    saver.save(folder / (whole ? "saved.tgz" : "saved.splat"), scene, 7);
    const ModelSaver::News news = next(saver);
    CHECK(news.model == "tiny.tgz");
    CHECK(news.revision == 7);
    CHECK(news.whole == whole);
  }
  saver.save(folder / "none/saved.tgz", scene, 8);
  CHECK_FALSE(next(saver).whole);
}

TEST_CASE("a saver that ends has written what it was asked for") {
  const TemporaryFolder folder;
  {
    ModelSaver saver([] {});
    for (int i = 0; i < 3; ++i) saver.save(folder / (std::to_string(i) + ".ply"), sceneWithAll());
  }
  for (int i = 0; i < 3; ++i) CHECK(isFile(folder / (std::to_string(i) + ".ply")));
}

TEST_CASE("a background that a model's file does not say is not made up in what is saved of it") {
  const TemporaryFolder folder;
  ModelSaver saver([] {});
  for (const bool known : {true, false}) {
    INFO(known);
    Bundle bundle;
    bundle.model = tinyTexturedModel(6);
    bundle.knows_background = known;
    const std::filesystem::path file = folder / (known ? "known.glb" : "unknown.glb");
    saver.save(file, sceneOf(std::move(bundle), "tiny.ply"));
    CHECK(next(saver).problem == "");
    CHECK(readModel(file).knows_background == known);
  }
}
