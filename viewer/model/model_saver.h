// SPDX-License-Identifier: Apache-2.0
// Writes models in a thread of its own, in any format of the converter, one after another.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/system/worker.h"
#include "viewer/view/file_browser.h"
#include "viewer/view/scene.h"

namespace tg {

class ModelSaver {
 public:
  // `wake` is called in the saver's thread whenever there is news.
  explicit ModelSaver(std::function<void()> wake);
  // Waits for what has been asked for.
  ~ModelSaver();

  // `revision`: of EditState, which the scene's model is.
  void save(std::filesystem::path path, Scene scene, std::uint64_t revision = 0);

  struct News {
    std::filesystem::path path;
    std::filesystem::path model;  // of the scene
    std::uint64_t revision = 0;
    bool whole = false;                 // the file holds all of the model
    std::string problem;                // why there is no file; "" = there is one
    int error_kind = 0;                 // of the problem
    std::vector<std::string> warnings;  // what the format does not hold
  };
  std::optional<News> take() { return news_.poll(); }

 private:
  struct Order {
    std::filesystem::path path;
    Scene scene;
    std::uint64_t revision = 0;
  };
  Queue<Order> orders_;
  Queue<News> news_;
  std::jthread thread_;
};

// What a scene can be saved as, with what of it would be lost.
std::vector<FileType> modelTypes(const Scene& scene);
// What can be opened as a model.
std::vector<FileType> readableTypes();

}  // namespace tg
