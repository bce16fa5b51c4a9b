// SPDX-License-Identifier: Apache-2.0
// Scenes to files: what the converter writes.
#include "viewer/model/model_saver.h"

#include <new>
#include <utility>

#include "converter/registry/file_format.h"
#include "core/system/error.h"
#include "viewer/view/edits.h"

namespace tg {
namespace {

Bundle bundleOf(const Scene& scene) {
  Bundle bundle;
  bundle.model = *scene.model;
  bundle.cameras = scene.cameras;
  bundle.background = scene.background;
  bundle.knows_background = scene.knows_background;
  bundle.training_json = scene.training_json;
  bundle.views = scene.views;
  return bundle;
}

void write(const std::filesystem::path& path, const Scene& scene, ModelSaver::News& news) {
  try {
    Written written;
    writeModel(modelFormat(path), path, bundleOf(scene), {}, written);
    news.warnings = std::move(written.warnings);
    news.whole = holdsModel(path, scene);
  } catch (const Error& error) {
    news.problem = error.what();
    news.error_kind = static_cast<int>(error.kind);
  } catch (const std::bad_alloc&) {
    news.problem = path.string() + ": not enough memory";
    news.error_kind = static_cast<int>(ErrorKind::device);
  } catch (const std::exception& error) {
    news.problem = path.string() + ": " + error.what();
    news.error_kind = static_cast<int>(ErrorKind::cannotWrite);
  }
}

}  // namespace

ModelSaver::ModelSaver(std::function<void()> wake)
    : news_(Queue<News>::kUnlimited, std::move(wake)), thread_(startWorker(news_, [this](const std::stop_token&) {
        while (auto order = orders_.take()) {
          News news;
          news.path = order->path;
          news.model = order->scene.path;
          news.revision = order->revision;
          write(order->path, order->scene, news);
          order.reset();
          news_.give(std::move(news));
        }
      })) {}

ModelSaver::~ModelSaver() {
  orders_.close();
  thread_.join();
}

void ModelSaver::save(std::filesystem::path path, Scene scene, std::uint64_t revision) {
  orders_.give({std::move(path), std::move(scene), revision});
}

std::vector<FileType> modelTypes(const Scene& scene) {
  std::vector<FileType> types;
  for (const Format& format : formats()) {
    if (!format.write || !format.read) continue;
    std::vector<std::string> lost;
    if (!format.holds(kKeepsTextures) && scene.textured > 0) lost.emplace_back("textures");
    if (!format.holds(kKeepsSh) && scene.sh_degree > 0) lost.emplace_back("SH");
    if (!format.holds(kKeepsCameras) && !scene.cameras.empty()) lost.emplace_back("cameras");
    if (!format.holds(kKeepsViews) && !scene.views.empty()) lost.emplace_back("named views");
    if (!format.holds(kKeepsBackground) && scene.background != Bundle().background) lost.emplace_back("background");
    std::string note;
    for (const std::string& what : lost) note += (note.empty() ? "Holds no " : ", no ") + what;
    types.push_back({"." + std::string(format.name), note});
  }
  return types;
}

std::vector<FileType> readableTypes() {
  std::vector<FileType> types;
  for (const Format& format : formats()) {
    if (format.read) types.push_back({"." + std::string(format.name), ""});
  }
  return types;
}

}  // namespace tg
