// SPDX-License-Identifier: Apache-2.0
// What is kept between runs, and what a broken file does to it.
#include "viewer/view/session.h"

#include <cstdlib>
#include <fstream>
#include <optional>

#include "core/system/error.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "viewer/view/bookmarks.h"

using namespace tg;

namespace {

// An environment variable with another value, or none, while this lives.
class Variable {
 public:
  Variable(const char* name, const char* value) : name_(name) {
    if (const char* before = std::getenv(name)) before_ = before;
    value ? ::setenv(name, value, 1) : ::unsetenv(name);
  }
  ~Variable() { before_ ? ::setenv(name_, before_->c_str(), 1) : ::unsetenv(name_); }
  Variable& operator=(Variable&&) = delete;

 private:
  const char* const name_;
  std::optional<std::string> before_;
};

Session changedSession() {
  Session session;
  session.window = {1600, 900};
  session.panel = false;
  session.tab = Tab::path;
  session.output = Output::normal;
  session.textures = TextureMode::none;
  session.speed = 2.5;
  session.fly = true;
  noteRecent(session, "/models/a b.tgz");
  noteRecent(session, "/models/\xc3\xa9.ply");
  Camera camera = lookAt({1, 2, 3}, {0, 0, 0}, {0, -1, 0}, 0.7, 640, 480);
  camera.name = "view 1";
  keepBookmarks(session, "/models/a b.tgz", {camera, camera});
  return session;
}

}  // namespace

TEST_CASE("a session comes back from its file whole") {
  const TemporaryFolder folder;
  const Session session = changedSession();
  saveSession(session, folder / "new/tgview/session.json");
  const LoadedSession loaded = loadSession(folder / "new/tgview/session.json");
  CHECK(loaded.problem.empty());
  CHECK(loaded.session.window == session.window);
  CHECK(loaded.session.panel == session.panel);
  CHECK(loaded.session.tab == session.tab);
  CHECK(loaded.session.output == session.output);
  CHECK(loaded.session.textures == session.textures);
  CHECK(loaded.session.speed == session.speed);
  CHECK(loaded.session.fly == session.fly);
  CHECK(loaded.session.recent == session.recent);
  const std::vector<Camera> bookmarks = bookmarksOf(loaded.session, "/models/a b.tgz");
  REQUIRE(bookmarks.size() == 2);
  CHECK(bookmarks[0].name == "view 1");
  CHECK(bookmarks[0].translation == session.bookmarks[0].cameras[0].translation);
  CHECK(formatSession(loaded.session) == formatSession(session));
}

TEST_CASE("without a file a session is fresh and silent, a broken file is fresh with a word, once") {
  const TemporaryFolder folder;
  CHECK(loadSession(folder / "none.json").problem.empty());
  CHECK(loadSession({}).problem.empty());
  const std::string whole = formatSession(changedSession());
  const auto broken = [&](const std::string& text) {
    std::ofstream(folder / "s.json", std::ios::binary) << text;
    const LoadedSession loaded = loadSession(folder / "s.json");
    CHECK_FALSE(loaded.problem.empty());
    CHECK(loaded.session.recent.empty());
    CHECK(loaded.session.window == Session{}.window);
  };
  for (const char* text : {"", "{", "[]", "{}", "3", "{\"format\":\"tgview-session\",\"version\":99}"}) broken(text);
  for (std::size_t length = 1; length + 2 < whole.size(); length += 37) broken(whole.substr(0, length));
  const auto replaced = [&whole](const std::string& part, const std::string& other) {
    std::string text = whole;
    REQUIRE(text.find(part) != std::string::npos);
    return text.replace(text.find(part), part.size(), other);
  };
  broken(replaced("1600", "-3"));
  broken(replaced("1600", "\"wide\""));
  broken(replaced("\"normal\"", "\"colour\""));
  broken(replaced("\"off\"", "\"maybe\""));
  broken(replaced("\"view 1\"", "7"));
  broken(replaced("\"panel\": false", "\"panel\": 0"));
  std::filesystem::remove(folder / "s.json");
  std::filesystem::create_directory(folder / "s.json");
  CHECK_THAT(loadSession(folder / "s.json").problem, Contains("is a folder"));
  std::filesystem::remove(folder / "s.json");
  saveSession({}, folder / "s.json");
  CHECK(loadSession(folder / "s.json").problem.empty());
}

TEST_CASE("the session lies in the XDG state folder, else under the home folder") {
  {
    const Variable state("XDG_STATE_HOME", "/some/state");
    CHECK(sessionFile() == "/some/state/tgview/session.json");
  }
  const Variable state("XDG_STATE_HOME", nullptr);
  {
    const Variable home("HOME", "/home/someone");
    CHECK(sessionFile() == "/home/someone/.local/state/tgview/session.json");
    const Variable relative("XDG_STATE_HOME", "state");
    CHECK(sessionFile() == "/home/someone/.local/state/tgview/session.json");
  }
  const Variable home("HOME", nullptr);
  CHECK(sessionFile().empty());
}

TEST_CASE("recent files: the last one first, each once, a bounded number") {
  Session session;
  for (int i = 0; i < 30; ++i) noteRecent(session, "/m/" + std::to_string(i) + ".tgz");
  CHECK(session.recent.size() == kMaxRecentFiles);
  CHECK(session.recent[0] == "/m/29.tgz");
  noteRecent(session, "/m/../m/27.tgz");
  CHECK(session.recent[0] == "/m/27.tgz");
  CHECK(session.recent.size() == kMaxRecentFiles);
  noteRecent(session, "http://host/scene/lod-meta.json");
  CHECK(session.recent[0] == "http://host/scene/lod-meta.json");  // no path
}

TEST_CASE("bookmarks belong to their model, those of the models used last are kept") {
  Session session;
  const Camera camera = lookAt({1, 2, 3}, {0, 0, 0}, {0, -1, 0}, 0.7, 64, 48);
  for (std::size_t i = 0; i < kMaxBookmarkedModels + 5; ++i) {
    keepBookmarks(session, "/m/" + std::to_string(i), {camera});
  }
  CHECK(session.bookmarks.size() == kMaxBookmarkedModels);
  CHECK(bookmarksOf(session, "/m/0").empty());
  CHECK(bookmarksOf(session, "/m/20").size() == 1);
  keepBookmarks(session, "/m/20", {});
  CHECK(bookmarksOf(session, "/m/20").empty());
}

TEST_CASE("of two windows neither takes what the other has kept") {
  const Camera one = lookAt({1, 2, 3}, {0, 0, 0}, {0, -1, 0}, 0.7, 64, 48);
  const Camera two = lookAt({3, 2, 1}, {0, 0, 0}, {0, -1, 0}, 0.7, 64, 48);
  Session before;
  keepBookmarks(before, "/m/both", {one});
  keepBookmarks(before, "/m/gone", {one});
  noteRecent(before, "/m/old");
  Session now = before, own = before;
  keepBookmarks(now, "/m/theirs", {two});  // the other window's
  keepBookmarks(now, "/m/both", {two});
  keepBookmarks(now, "/m/gone", {});
  noteRecent(now, "/m/theirs");
  keepBookmarks(own, "/m/ours", {one});
  own.recent = {"/m/ours"};  // the list was cleared first
  Session both = withOthers(own, before, now);
  CHECK(bookmarksOf(both, "/m/theirs") == std::vector<Camera>{two});
  CHECK(bookmarksOf(both, "/m/ours") == std::vector<Camera>{one});
  CHECK(bookmarksOf(both, "/m/both") == std::vector<Camera>{two});
  CHECK(bookmarksOf(both, "/m/gone").empty());
  CHECK(both.recent == std::vector<std::string>{"/m/ours", "/m/theirs"});
  keepBookmarks(own, "/m/both", {one, two});  // the same in both windows
  both = withOthers(own, before, now);
  CHECK(bookmarksOf(both, "/m/both") == std::vector<Camera>{one, two});
}

TEST_CASE("bookmarks that two windows add to one model are all kept") {
  const auto from = [](double x) { return lookAt({x, 2, 3}, {0, 0, 0}, {0, -1, 0}, 0.7, 64, 48); };
  Session before;
  keepBookmarks(before, "/m/both", {from(0)});
  keepBookmarks(before, "/m/less", {from(0), from(1)});
  Session now = before, own = before;
  keepBookmarks(now, "/m/both", {from(0), from(1), from(2)});
  keepBookmarks(own, "/m/both", {from(0), from(2), from(3)});
  keepBookmarks(now, "/m/fresh", {from(4)});
  keepBookmarks(own, "/m/fresh", {from(5)});
  keepBookmarks(now, "/m/less", {from(0), from(1), from(6)});
  keepBookmarks(own, "/m/less", {from(1)});  // what was deleted here stays so
  const Session both = withOthers(own, before, now);
  CHECK(bookmarksOf(both, "/m/both") == std::vector<Camera>{from(0), from(2), from(3), from(1)});
  CHECK(bookmarksOf(both, "/m/fresh") == std::vector<Camera>{from(5), from(4)});
  CHECK(bookmarksOf(both, "/m/less") == std::vector<Camera>{from(1), from(6)});
  keepBookmarks(own, "/m/less", {});
  CHECK(bookmarksOf(withOthers(own, before, now), "/m/less") == std::vector<Camera>{from(6)});
  keepBookmarks(own, "/m/both", std::vector<Camera>(kMaxBookmarks, from(3)));
  CHECK(bookmarksOf(withOthers(own, before, now), "/m/both").size() == kMaxBookmarks);
}

TEST_CASE("a bookmark that one window has named keeps its name when another one closes") {
  Camera one = lookAt({1, 2, 3}, {0, 0, 0}, {0, -1, 0}, 0.7, 64, 48);
  Session before;
  keepBookmarks(before, "/m", {one});
  Session now = before;
  one.name = "from above";
  keepBookmarks(now, "/m", {one});
  CHECK(bookmarksOf(withOthers(before, before, now), "/m").front().name == "from above");
  CHECK(bookmarksOf(withOthers(now, before, before), "/m").front().name == "from above");

  Session own = before;  // this window has added one meanwhile
  Camera two = one;
  two.translation.x += 1;
  keepBookmarks(own, "/m", {before.bookmarks[0].cameras[0], two});
  const std::vector<Camera> both = bookmarksOf(withOthers(own, before, now), "/m");
  REQUIRE(both.size() == 2);
  CHECK(both[0].name == "from above");
  own.bookmarks[0].cameras[0].name = "ours";  // or has named it, too
  CHECK(bookmarksOf(withOthers(own, before, now), "/m")[0].name == "ours");
}

TEST_CASE("a session's name without a folder is one of the working folder") {
  const TemporaryFolder folder;
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path);
  CHECK_NOTHROW(saveSession(changedSession(), "s.json"));
  std::filesystem::current_path(before);
  CHECK(loadSession(folder / "s.json").session.speed == changedSession().speed);
}

TEST_CASE("a session that cannot be written says where") {
  const TemporaryFolder folder;
  std::ofstream(folder / "file") << "x";
  CHECK_THROWS_AS(saveSession({}, folder / "file/tgview/session.json"), Error);
}
