// SPDX-License-Identifier: Apache-2.0
// The session's file, which anyone may have edited or cut short.
#include "viewer/view/session.h"

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "core/bundle/camera_file.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/file/web_address.h"
#include "core/system/error.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/parse.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxSessionBytes = std::uint64_t{64} << 20;
constexpr int kSessionVersion = 1;
constexpr double kMinSpeed = 0.02, kMaxSpeed = 20;  // the panel's

template <Named T>
T named(const JsonNode& json, const char* key) {
  const std::string text = json.string(key);
  const std::optional<T> value = parse<T>(text);
  if (!value) json.fail(std::string("\"") + key + "\": unknown name \"" + text + "\"");
  return *value;
}

std::string absoluteName(const std::filesystem::path& path) {
  if (isWebAddress(path.string())) return path.string();
  std::error_code error;
  const std::filesystem::path result = std::filesystem::absolute(path, error);
  return error ? path.string() : result.lexically_normal().string();
}

}  // namespace

std::filesystem::path sessionFile() {
  const char* state = std::getenv("XDG_STATE_HOME");
  // The XDG specification: a relative path is to be ignored.
  if (state && *state == '/') return std::filesystem::path(state) / "tgview/session.json";
  const char* home = std::getenv("HOME");
  if (home && *home) return std::filesystem::path(home) / ".local/state/tgview/session.json";
  return {};
}

std::string formatSession(const Session& session) {
  using nlohmann::ordered_json;
  ordered_json json = {{"format", "tgview-session"},
                       {"version", kSessionVersion},
                       {"window", {session.window.x, session.window.y}},
                       {"panel", session.panel},
                       {"panel_width", session.panel_width},
                       {"tab", name(session.tab)},
                       {"output", name(session.output)},
                       {"textures", texturesName(session.textures)},
                       {"speed", session.speed},
                       {"fly", session.fly},
                       {"recent", session.recent}};
  ordered_json bookmarks = ordered_json::array();
  for (const ModelBookmarks& model : session.bookmarks) {
    bookmarks.push_back({{"model", model.model}, {"cameras", ordered_json::parse(formatCameras(model.cameras))}});
  }
  json["bookmarks"] = std::move(bookmarks);
  return dumpJson(json, 1) + "\n";
}

Session parseSession(const std::string& json, const std::string& file) {
  const nlohmann::json root = parseJson(json, file);
  const JsonNode object{root, file, ""};
  if (object.string("format") != "tgview-session") object.fail("\"format\": expected \"tgview-session\"");
  (void)object.integer("version", kSessionVersion, kSessionVersion);
  Session session;
  const auto [width, height] = object.numbers<2>("window");
  const bool whole = width <= kMaxImageSide && height <= kMaxImageSide && width >= 1 && height >= 1;
  if (!whole || !isImageSize(static_cast<int>(width), static_cast<int>(height))) {
    object.fail("\"window\": expected " + imageSizeLimits());
  }
  session.window = {static_cast<int>(width), static_cast<int>(height)};
  session.panel = object.boolean("panel");
  if (object.has("panel_width")) {  // which version 1 had not at first
    session.panel_width = std::clamp(object.number("panel_width"), kLeastPanel, kMostPanel);
  }
  session.tab = named<Tab>(object, "tab");
  session.output = named<Output>(object, "output");
  RenderSettings settings;
  renderSetting("textures").set(settings, object.string("textures"), file + ": \"textures\"");
  session.textures = settings.textures;
  session.speed = std::clamp(object.number("speed"), kMinSpeed, kMaxSpeed);
  session.fly = object.boolean("fly");
  for (const nlohmann::json& path : object.list("recent", kMaxRecentFiles)) {
    if (!path.is_string()) object.fail("\"recent\": expected file names");
    session.recent.push_back(path.get<std::string>());
  }
  for (const nlohmann::json& entry : object.list("bookmarks", kMaxBookmarkedModels)) {
    const JsonNode model{entry, file, "bookmarks"};
    session.bookmarks.push_back(
        {model.string("model"), parseCameras(model.list("cameras", kMaxBookmarks).dump(), file)});
  }
  return session;
}

LoadedSession loadSession(const std::filesystem::path& file) {
  LoadedSession result;
  std::error_code ignored;
  if (file.empty() || !std::filesystem::exists(file, ignored)) return result;
  try {
    const std::vector<std::uint8_t> bytes = readRegularFile(file, kMaxSessionBytes);
    result.session = parseSession(std::string(bytes.begin(), bytes.end()), file.string());
  } catch (const Error& error) {
    result.problem = std::string("The last session is lost: ") + error.what();
  }
  return result;
}

void saveSession(const Session& session, const std::filesystem::path& file) {
  std::error_code error;
  const std::filesystem::path folder = file.parent_path();  // none: the working folder
  if (!folder.empty()) std::filesystem::create_directories(folder, error);
  if (error) throw Error(ErrorKind::cannotWrite, folder.string(), "cannot make this folder: " + error.message());
  writeTextAtomically(file, formatSession(session));
}

void noteRecent(Session& session, const std::filesystem::path& model) {
  const std::string path = absoluteName(model);
  std::erase(session.recent, path);
  session.recent.insert(session.recent.begin(), path);
  if (session.recent.size() > kMaxRecentFiles) session.recent.resize(kMaxRecentFiles);
}

std::vector<Camera> bookmarksOf(const Session& session, const std::filesystem::path& model) {
  const std::string path = absoluteName(model);
  const auto found = std::find_if(session.bookmarks.begin(), session.bookmarks.end(),
                                  [&path](const ModelBookmarks& entry) { return entry.model == path; });
  return found == session.bookmarks.end() ? std::vector<Camera>{} : found->cameras;
}

void keepBookmarks(Session& session, const std::filesystem::path& model, std::vector<Camera> cameras) {
  const std::string path = absoluteName(model);
  std::erase_if(session.bookmarks, [&path](const ModelBookmarks& entry) { return entry.model == path; });
  if (cameras.empty()) return;
  session.bookmarks.insert(session.bookmarks.begin(), {path, std::move(cameras)});
  if (session.bookmarks.size() > kMaxBookmarkedModels) session.bookmarks.resize(kMaxBookmarkedModels);
}

Session withOthers(Session own, const Session& before, const Session& now) {
  const auto holds = [](const std::vector<std::string>& paths, const std::string& path) {
    return std::ranges::find(paths, path) != paths.end();
  };
  for (const std::string& path : now.recent) {
    if (!holds(before.recent, path) && !holds(own.recent, path)) own.recent.push_back(path);
  }
  if (own.recent.size() > kMaxRecentFiles) own.recent.resize(kMaxRecentFiles);
  const Session mine = own;
  std::erase_if(own.bookmarks, [&](const ModelBookmarks& entry) {
    return sameBookmarks(entry.cameras, bookmarksOf(before, entry.model)) &&
           !sameBookmarks(entry.cameras, bookmarksOf(now, entry.model));
  });
  for (const ModelBookmarks& entry : now.bookmarks) {
    const std::vector<Camera> known = bookmarksOf(before, entry.model);
    if (sameBookmarks(entry.cameras, known)) continue;
    const auto among = [](const std::vector<Camera>& cameras, const Camera& camera) {
      return std::ranges::find(cameras, camera) != cameras.end();
    };
    const auto ours = std::ranges::find(own.bookmarks, entry.model, &ModelBookmarks::model);
    if (ours == own.bookmarks.end()) {
      ModelBookmarks theirs = entry;
      const bool emptied = bookmarksOf(mine, entry.model) != known;  // by this window
      if (emptied) std::erase_if(theirs.cameras, [&](const Camera& camera) { return among(known, camera); });
      if (!theirs.cameras.empty()) own.bookmarks.push_back(std::move(theirs));
      continue;
    }
    for (const Camera& camera : entry.cameras) {
      const auto was = std::ranges::find(known, camera);
      const auto held = std::ranges::find(ours->cameras, camera);
      if (held == ours->cameras.end() && was == known.end()) ours->cameras.push_back(camera);
      const bool named = held != ours->cameras.end() && was != known.end() && held->name == was->name;
      if (named) held->name = camera.name;  // by the other window, if at all
    }
    if (ours->cameras.size() > kMaxBookmarks) ours->cameras.resize(kMaxBookmarks);
  }
  if (own.bookmarks.size() > kMaxBookmarkedModels) own.bookmarks.resize(kMaxBookmarkedModels);
  return own;
}

}  // namespace tg
