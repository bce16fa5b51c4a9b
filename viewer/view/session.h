// SPDX-License-Identifier: Apache-2.0
// What the window keeps from one run to the next, in a file of the user's state folder.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "viewer/view/state.h"

namespace tg {

constexpr std::size_t kMaxRecentFiles = 20;
constexpr std::size_t kMaxBookmarkedModels = 200;  // the least recently used ones are forgotten

struct ModelBookmarks {
  std::string model;  // absolute path
  std::vector<Camera> cameras;
};

struct Session {
  glm::ivec2 window{1280, 720};  // [px]
  bool panel = true;
  double panel_width = kUsualPanel;  // UiState::panel_width
  Tab tab = Tab::view;
  Output output = Output::final;
  TextureMode textures = TextureMode::rgba;
  double speed = 1;                       // CameraState::speed
  bool fly = false;                       // CameraState::fly
  std::vector<std::string> recent;        // absolute paths of models, the last one opened first
  std::vector<ModelBookmarks> bookmarks;  // the last one used first
};

// $XDG_STATE_HOME/tgview/session.json, else ~/.local/state/tgview/session.json; empty when neither is known.
std::filesystem::path sessionFile();

struct LoadedSession {
  Session session;
  std::string problem;  // why it is a fresh one although there is a file; "" = none
};
// Never throws: a missing file is a fresh session, a broken one too, with a word about it.
LoadedSession loadSession(const std::filesystem::path& file);
// Makes the folder. Throws Error(cannotWrite).
void saveSession(const Session& session, const std::filesystem::path& file);
std::string formatSession(const Session& session);
Session parseSession(const std::string& json, const std::string& file);  // throws Error(badData)

void noteRecent(Session& session, const std::filesystem::path& model);
// None where the model has none.
std::vector<Camera> bookmarksOf(const Session& session, const std::filesystem::path& model);
void keepBookmarks(Session& session, const std::filesystem::path& model, std::vector<Camera> cameras);
// `own` with what other windows have written since it was read as `before`: the file is `now`. To bookmarks that both
// have changed those are added that only `now` has.
Session withOthers(Session own, const Session& before, const Session& now);

}  // namespace tg
