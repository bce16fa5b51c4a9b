// SPDX-License-Identifier: Apache-2.0
// Scenes with levels of detail in memory: never a leaf without a level, never more than the budget, whatever the files
// do.
#include <httplib.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>
#include <thread>

#include "converter/lod/write_lod.h"
#include "converter/registry/file_format.h"
#include "converter/serve/http.h"
#include "core/file/file.h"
#include "core/system/error.h"
#include "core/tiny_model.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "viewer/model/open_models.h"
#include "viewer/model/scene_streamer.h"
#include "viewer/view/edits.h"
#include "viewer/view/state.h"

using namespace tg;
using test::messageOf;

namespace {

constexpr LodOptions kSmallLevels{.leaf = 64, .file = 256, .coarsest = 60, .merged = 4};

struct SmallScene {
  explicit SmallScene(float more_opaque = 0) {
    Bundle bundle;
    bundle.model = tinyTexturedModel(2000);
    for (float& logit : bundle.model.opacity_logit) logit += more_opaque;
    bundle.cameras.push_back(lookAt({0.2, 0.5, -3}, {0, 0, 0}, {0, -1, 0}, 0.8, 640, 480));
    writeLod(path, bundle, kSmallLevels);
    scene = readLodScene(path);
    camera = lookAt({0.2, 0.5, -3}, {0, 0, 0}, {0, -1, 0}, 0.8, 640, 480);
  }
  const TemporaryFolder folder;
  const std::filesystem::path path = folder / "lod-meta.json";
  LodScene scene;
  Camera camera;
};

// Like the window: the picture of a model is on screen in the next frame.
struct Window {
  Window(const std::filesystem::path& path, const Camera& camera, std::size_t budget, LodReaderWrap wrap = {})
      : open_models(
            optionsFor(path), [] {}, [](ViewerState& s, Scene scene) { setScene(s, std::move(scene)); }, {},
            std::move(wrap)) {
    state.stream.camera = camera;
    state.stream.budget = budget;
  }
  static ViewOptions optionsFor(const std::filesystem::path& path) {
    ViewOptions options;
    options.model = path;
    return options;
  }
  // Until `done`, looking at every frame.
  void until(
      const std::function<bool()>& done, const std::function<void()>& look = [] {}) {
    for (int i = 0; i < 30000 && !done(); ++i) {
      open_models.update(state);
      look();
      state.stream.drawn = state.scene.model != nullptr;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    REQUIRE(done());
  }
  bool settled() const { return state.scene.model && state.stream.settled; }

  ViewerState state;
  OpenModels open_models;
};

// The files of a folder below /scene/, with the headers that `stamp` sets, until this ends.
class StampingServer {
 public:
  using Stamp = std::function<void(const httplib::Request&, httplib::Response&)>;
  StampingServer(const std::filesystem::path& folder, Stamp stamp) {
    server_.Get("/scene/(.*)", [this, folder, stamp](const httplib::Request& request, httplib::Response& response) {
      const std::vector<std::uint8_t> bytes = readFile(folder / request.matches[1].str(), 1 << 24);
      if (request.method == "GET" && isLodMeta(request.path)) ++opened;
      response.set_content(reinterpret_cast<const char*>(bytes.data()), bytes.size(), "application/octet-stream");
      stamp(request, response);
    });
    server_.set_keep_alive_max_count(1);  // stop() would not end a connection that is kept
    port_ = server_.bind_to_any_port("127.0.0.1");
    serving_ = std::jthread([this] { server_.listen_after_bind(); });
    while (!server_.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ~StampingServer() { stop(); }
  StampingServer& operator=(StampingServer&&) = delete;

  void stop() {
    server_.stop();
    if (serving_.joinable()) serving_.join();
  }
  int port() const { return port_; }
  std::string address() const { return "http://127.0.0.1:" + std::to_string(port_) + "/scene/lod-meta.json"; }
  std::atomic<int> opened{0};  // times that lod-meta.json was fetched

 private:
  httplib::Server server_;
  int port_ = 0;
  std::jthread serving_;
};

// Lets go of what waits for it, also where a test fails: the window waits for its threads.
struct Released {
  ~Released() { held = false; }
  std::atomic<bool>& held;
};

void truncateFile(const std::filesystem::path& path) { std::filesystem::resize_file(path, 40); }

}  // namespace

TEST_CASE("all finest levels in memory are the model that is read from the same files") {
  const SmallScene small;
  REQUIRE(small.scene.levels >= 3);
  const std::vector<std::uint8_t> finest = sameLevel(small.scene, 0);
  ResidentLevels resident(small.scene, lodFolderReader(small.path));
  CHECK(resident.model()->size() == small.scene.counts.back());
  for (const std::uint32_t file : resident.missing(finest, {})) resident.read(file, finest);
  CHECK(resident.missing(finest, {}).empty());
  resident.assemble(finest);
  CHECK(*resident.model() == readModel(small.path).model);
  CHECK(resident.bytesWaiting() == 0);
}

TEST_CASE("from any levels to any others every leaf has one all the way, and the budget holds") {
  const SmallScene small;
  ResidentLevels resident(small.scene, lodFolderReader(small.path));
  std::mt19937 random(3);
  for (int step = 0; step < 12; ++step) {
    const std::uint64_t budget = small.scene.counts.back() + random() % small.scene.counts.front();
    Camera camera = small.camera;
    camera.translation.x += static_cast<double>(random() % 200) / 100.0 - 1;
    camera.translation.z -= static_cast<double>(random() % 200) / 100.0;
    const std::vector<std::uint8_t> wanted = chooseLevels(small.scene, camera, budget);
    for (const std::uint32_t file : resident.missing(wanted, camera.position())) {
      const std::vector<std::uint8_t> levels = resident.reachable(wanted, budget);
      CHECK(countOf(small.scene, levels) <= budget);
      if (random() % 2 == 0) resident.assemble(levels);
      CHECK(resident.model()->size() == countOf(small.scene, resident.levels()));
      resident.read(file, wanted);
    }
    CHECK(resident.reachable(wanted, budget) == wanted);
    resident.assemble(wanted);
    // The same as from nothing.
    ResidentLevels fresh(small.scene, lodFolderReader(small.path));
    for (const std::uint32_t file : fresh.missing(wanted, {})) fresh.read(file, wanted);
    fresh.assemble(wanted);
    CHECK(*resident.model() == *fresh.model());
  }
}

TEST_CASE("a scene opens with its coarsest level while finer files are slow, and ends with those of the camera") {
  const SmallScene small;
  const auto held = std::make_shared<std::atomic<bool>>(true);
  const auto asked = std::make_shared<std::atomic<int>>(0);
  Window window(small.path, small.camera, 1500, [&](LodReader files) -> LodReader {
    return [=, &small](const std::string& relative, std::uint64_t most) {
      // The coarsest level is the last folder's.
      const bool finer = relative.find("/" + std::to_string(small.scene.levels - 1) + "_") == std::string::npos;
      if (finer) ++*asked;
      while (finer && *held) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      return files(relative, most);
    };
  });
  const Released released{*held};
  window.until([&] { return *asked > 0 && window.state.scene.model && !window.state.stream.loading.empty(); });
  CHECK(window.state.scene.gaussians == small.scene.counts.back());
  CHECK(window.state.scene.streamed_from == small.scene.counts.front());
  CHECK(window.state.scene.cameras.size() == 1);
  CHECK_FALSE(window.state.stream.settled);
  CHECK(window.state.stream.owed > 0);
  *held = false;
  std::size_t least = window.state.scene.gaussians;
  window.until([&] { return window.settled(); },
               [&] {
                 CHECK(window.state.scene.gaussians >= least);
                 least = window.state.scene.gaussians;
               });
  const std::vector<std::uint8_t> levels = chooseLevels(small.scene, small.camera, 1500);
  CHECK(window.state.scene.gaussians == countOf(small.scene, levels));
  CHECK(window.state.scene.gaussians > small.scene.counts.back());
  CHECK(window.state.stream.owed == 0);

  // Another camera, then a smaller budget.
  window.state.stream.camera.translation.z -= 2.6;
  window.until([&] { return !window.state.stream.settled; });
  window.until([&] { return window.settled(); });
  CHECK(window.state.scene.gaussians ==
        countOf(small.scene, chooseLevels(small.scene, window.state.stream.camera, 1500)));
  window.state.stream.budget = small.scene.counts.back();
  window.until([&] { return !window.state.stream.settled; });
  window.until([&] { return window.settled(); });
  CHECK(window.state.scene.gaussians == small.scene.counts.back());
}

TEST_CASE("no second model is made while the one before it is not on screen") {
  const SmallScene small;
  Window window(small.path, small.camera, small.scene.counts.front());
  window.until([&] { return window.state.scene.model != nullptr; });
  const auto first = window.state.scene.model;
  for (int i = 0; i < 50; ++i) {
    window.state.stream.drawn = false;
    window.open_models.update(window.state);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  CHECK(window.state.scene.model == first);
  window.until([&] { return window.settled(); });
  CHECK(window.state.scene.gaussians > first->size());
}

TEST_CASE("a truncated file is one message, its leaves stay coarser, and everything else comes") {
  const SmallScene small;
  const std::vector<std::uint8_t> finest = sameLevel(small.scene, 0);
  const std::uint32_t broken = small.scene.leaves[0].levels[0].file;
  const std::filesystem::path folder = (small.folder / small.scene.files[broken]).parent_path();
  truncateFile(folder / "means_l.webp");
  Window window(small.path, small.camera, small.scene.counts.front());
  int messages = 0;
  window.until([&] { return window.settled(); },
               [&] {
                 if (window.state.messages.error.empty()) return;
                 ++messages;
                 CHECK_THAT(window.state.messages.error, Contains(folder.filename().string()));
                 window.state.messages.error.clear();
               });
  CHECK(messages == 1);
  CHECK(window.state.stream.lost == 1);
  const std::vector<std::uint8_t> levels =
      withoutFiles(small.scene, chooseLevels(small.scene, small.camera, small.scene.counts.front()), {broken});
  CHECK(levels[0] == 1);
  CHECK(window.state.scene.gaussians == countOf(small.scene, levels));
}

TEST_CASE("a file that could not be fetched is tried again, and a scene does without cameras that are not there") {
  const SmallScene small;
  const std::string late = small.scene.files[small.scene.leaves[0].levels[0].file];
  std::filesystem::remove(small.folder / small.scene.cameras);
  std::atomic<bool> busy{true};
  std::atomic<int> refusals{0};
  SceneStreamer streamer(
      small.path, [] {},
      [&](LodReader files) {
        return [&, files](const std::string& relative, std::uint64_t most) {
          if (relative.starts_with(late) && busy) {
            ++refusals;
            throw Error(ErrorKind::cannotRead, relative, "busy");
          }
          return files(relative, most);
        };
      },
      std::chrono::milliseconds(0));
  std::uint64_t wish = 0, drawn = 0;
  std::optional<Scene> scene;
  // Until the scene has what a new wish asks for, or all but one file of it.
  const auto settle = [&](std::size_t lost) {
    ++wish;
    for (int k = 0; k < 60000; ++k) {
      streamer.want({small.camera, small.scene.counts.front(), wish, drawn});
      if (std::optional<SceneStreamer::News> news = streamer.take()) {
        if (news->scene) scene = std::move(news->scene);
        drawn = news->models;
        if (lost == 1 && news->lost == 1) return true;
        if (news->settled && news->wish == wish) return news->lost == lost;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  };
  CHECK(settle(1));
  busy = false;
  CHECK(settle(0));
  CHECK(refusals > 0);
  REQUIRE(scene);
  CHECK(scene->cameras.empty());
  REQUIRE(scene->warnings.size() == 1);
  CHECK_THAT(scene->warnings[0], Contains("no cameras: ") && Contains(small.scene.cameras));
  CHECK(readModel(small.path).cameras.empty());
}

TEST_CASE("a scene whose coarsest level is truncated is not opened: the first error ends the program, by its code") {
  const SmallScene small;
  const std::uint32_t broken = small.scene.leaves[0].levels.back().file;
  truncateFile((small.folder / small.scene.files[broken]).parent_path() / "quats.webp");
  Window window(small.path, small.camera, 1500);
  CHECK_THAT(messageOf([&] { window.until([] { return false; }); }), Contains("quats.webp"));
}

TEST_CASE("a scene that is not there is told as a model is that is not") {
  CHECK_THROWS_WITH(openLevels("absent/lod-meta.json", {}), "absent/lod-meta.json: no such file");
  CHECK_THROWS_WITH(readModel("absent/model.tgz", {}), "absent/model.tgz: no such file");
}

TEST_CASE("what is streamed is neither edited nor taken for a whole model") {
  const SmallScene small;
  Window window(small.path, small.camera, 1500);
  window.until([&] { return window.settled(); });
  CHECK_FALSE(mayEdit(window.state));
  CHECK_THAT(window.state.messages.notice, Contains("levels of detail"));
  CHECK_FALSE(isWhole(window.state.scene));
}

TEST_CASE("a scene comes over HTTP as from disk, and a file that the server lacks costs its leaves' level alone") {
  const SmallScene small;
  const std::string lost = small.scene.files[small.scene.leaves[0].levels[0].file];
  const HttpServer server("127.0.0.1", 0, [&](const HttpRequest& request) -> HttpAnswer {
    const std::filesystem::path path = small.folder / request.path.substr(std::string("/scene/").size());
    if (!isFile(path) || request.path.ends_with(lost)) return {.status = 404, .text = "no", .bytes = {}};
    return {.text = {}, .bytes = std::make_shared<const std::vector<std::uint8_t>>(readFile(path, 1 << 24))};
  });
  const std::string address = "http://127.0.0.1:" + std::to_string(server.port()) + "/scene/lod-meta.json";
  const OpenedLevels opened = openLevels(address, {});
  CHECK(opened.cameras.size() == 1);
  CHECK(opened.scene.counts == small.scene.counts);
  Window window(address, small.camera, small.scene.counts.front());
  window.until([&] { return window.settled(); });
  CHECK(window.state.stream.lost == 1);
  CHECK_THAT(window.state.messages.error, Contains(lost + ": the server refuses it (expected 200, found 404)"));
  CHECK(window.state.scene.gaussians > small.scene.counts.front() / 2);
}

TEST_CASE("a scene that is written again while it is streamed is read anew, never one with levels of the other") {
  const SmallScene small, other(-1);
  REQUIRE(other.scene.files == small.scene.files);
  REQUIRE(other.scene.file_counts == small.scene.file_counts);
  std::atomic<int> edition{1};
  StampingServer server(small.folder.path, [&](const httplib::Request&, httplib::Response& response) {
    response.set_header("ETag", std::to_string(edition));
  });
  const bool served = GENERATE(false, true);
  CAPTURE(served);
  const std::filesystem::path path = served ? std::filesystem::path(server.address()) : small.path;

  std::atomic<bool> held{true};
  std::atomic<int> asked{0};
  Window window(path, small.camera, 1500, [&](LodReader files) -> LodReader {
    return [&, files](const std::string& relative, std::uint64_t most) {
      const bool finer = relative.find("/" + std::to_string(small.scene.levels - 1) + "_") == std::string::npos;
      if (finer) ++asked;
      while (finer && held) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      return files(relative, most);
    };
  });
  const Released released{held};
  window.until([&] { return asked > 0 && window.state.scene.model; });
  const OpenedLevels before = openLevels(path, {});
  std::filesystem::copy(other.folder.path, small.folder.path,
                        std::filesystem::copy_options::recursive | std::filesystem::copy_options::overwrite_existing);
  ++edition;
  CHECK_THAT(messageOf([&] { ResidentLevels(before.scene, before.reader, before.require_same); }),
             Contains("lod-meta.json: was written again while it was read"));
  held = false;
  window.until([&] { return window.settled(); });
  CHECK(window.state.messages.error.empty());
  ResidentLevels fresh(other.scene, lodFolderReader(other.path));
  const std::vector<std::uint8_t> wanted = chooseLevels(other.scene, small.camera, 1500);
  for (const std::uint32_t file : fresh.missing(wanted, {})) fresh.read(file, wanted);
  fresh.assemble(wanted);
  CHECK(*window.state.scene.model == *fresh.model());
}

TEST_CASE("a scene whose stamps change and whose lod-meta.json does not is read on") {
  const SmallScene small;
  const std::vector<std::uint8_t> bytes = readFile(small.path, 1 << 24);
  std::atomic<int> asked{0};
  const auto number = [&] { return std::to_string(++asked); };
  const int kind = GENERATE(0, 1, 2);
  CAPTURE(kind);
  StampingServer server(small.folder.path, [&](const httplib::Request& request, httplib::Response& response) {
    if (kind == 1) response.set_header("Last-Modified", number());
    // HEAD says less than GET.
    if (kind == 2 && request.method == "GET") response.set_header("Last-Modified", number());
    if (kind == 2 && request.method == "HEAD") response.set_header("ETag", number());
  });
  std::atomic<int> finer{0}, coarsest{0};
  const std::filesystem::path path = kind > 0 ? std::filesystem::path(server.address()) : small.path;
  Window window(path, small.camera, small.scene.counts.front(), [&](LodReader files) -> LodReader {
    return [&, files](const std::string& relative, std::uint64_t most) {
      const bool first = relative.ends_with(small.scene.files[small.scene.leaves[0].levels.back().file]);
      ++(first ? coarsest : finer);
      if (kind == 0) {  // as a mount whose inodes change
        std::ofstream(small.folder / "copy", std::ios::binary)
            .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
        std::filesystem::rename(small.folder / "copy", small.path);
      }
      return files(relative, most);
    };
  });
  window.until([&] { return window.settled(); });
  CHECK(window.state.messages.error.empty());
  CHECK(window.state.scene.gaussians > small.scene.counts.front() / 2);
  CHECK(finer > 3);
  CHECK(coarsest == 1);
  if (kind == 2) CHECK(server.opened == 1);
}

TEST_CASE("a scene that is written again whenever it is opened is given up") {
  const SmallScene small;
  std::atomic<int> edition{0};
  StampingServer server(small.folder.path, [&](const httplib::Request& request, httplib::Response& response) {
    if (!isLodMeta(request.path)) return;
    response.set_header("Last-Modified", std::to_string(++edition));
    response.body += std::string(static_cast<std::size_t>(edition), ' ');
  });
  Window window(server.address(), small.camera, 1500);
  CHECK_THAT(messageOf([&] { window.until([] { return false; }); }, ErrorKind::cannotRead),
             Contains("lod-meta.json: was written again while it was read, 10 times"));
  CHECK(server.opened <= 20);
}

TEST_CASE("a server that does not answer for a file is not asked for its scene") {
  const SmallScene small;
  StampingServer server(small.folder.path,
                        [](const httplib::Request&, httplib::Response& response) { response.set_header("ETag", "1"); });
  const OpenedLevels opened = openLevels(server.address(), {});
  opened.require_same();
  server.stop();
  CHECK_THAT(messageOf([&] { (void)opened.reader(small.scene.files[0], 1 << 20); }), Contains("cannot be fetched"));
  httplib::Server silent;
  std::atomic<int> asked{0};
  silent.set_pre_routing_handler([&](const httplib::Request&, httplib::Response&) {
    ++asked;
    return httplib::Server::HandlerResponse::Handled;
  });
  REQUIRE(silent.bind_to_port("127.0.0.1", server.port()));
  const std::jthread serving([&] { silent.listen_after_bind(); });
  while (!silent.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  opened.require_same();
  CHECK(asked == 0);
  silent.stop();
}

TEST_CASE("finer levels with textures are drawn as these are, whether lod-meta.json says so or its files alone") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder / "lod-meta.json";
  Bundle bundle;
  bundle.model = tinyTexturedModel(2000);
  bundle.model.outside = TextureOutside::edge;
  REQUIRE(bundle.model.intersection == IntersectionModel::plane);
  writeLod(path, bundle, kSmallLevels);
  const bool says = GENERATE(true, false);
  CAPTURE(says);
  if (!says) {
    const std::vector<std::uint8_t> bytes = readFile(path, 1 << 24);
    nlohmann::json meta = nlohmann::json::parse(bytes);
    meta.erase("TG_levels_of_detail");
    std::ofstream(path) << meta.dump();
  }
  const LodScene scene = readLodScene(path);
  Window window(path, lookAt({0.2, 0.5, -3}, {0, 0, 0}, {0, -1, 0}, 0.8, 640, 480), scene.counts.front());
  window.until([&] { return window.state.scene.model != nullptr; });
  const Scene& shown = window.state.scene;
  CHECK(shown.textured == 0);  // the coarsest level
  CHECK((shown.outside == TextureOutside::edge) == says);
  window.until([&] { return window.settled(); });
  REQUIRE(shown.textured > 0);
  CHECK(shown.outside == TextureOutside::edge);
  CHECK(shown.intersection == IntersectionModel::plane);
}

TEST_CASE("an error of any kind while a scene is streamed costs a file or the scene, never the window") {
  const SmallScene small;
  const std::string finest = small.scene.files[small.scene.leaves[0].levels[0].file];
  const bool opens = GENERATE(true, false);
  CAPTURE(opens);
  Window window(small.path, small.camera, small.scene.counts.front(), [&](LodReader files) -> LodReader {
    return [=](const std::string& relative, std::uint64_t most) {
      if (!opens || relative.starts_with(finest)) throw std::length_error("far too long");
      return files(relative, most);
    };
  });
  if (opens) {
    window.until([&] { return window.settled(); });
    CHECK(window.state.stream.lost == 1);
    CHECK(window.state.messages.error == small.path.string() + ": " + finest + ": far too long");
  } else {
    CHECK(messageOf([&] { window.until([] { return false; }); }, ErrorKind::badData) ==
          small.path.string() + ": far too long");
  }
}
