// SPDX-License-Identifier: Apache-2.0
// What is shown, who may see it, and the thread that makes files of it.
#include "converter/serve/page_server.h"

#include <arpa/inet.h>
#include <sys/random.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <functional>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>
#include <random>
#include <string_view>
#include <thread>
#include <utility>

#include "converter/gltf/write_gltf.h"
#include "converter/serve/http.h"
#include "converter/serve/page.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/file/scratch_folder.h"
#include "core/run/curves.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "core/system/serial_loops.h"
#include "core/system/worker.h"

namespace tg {
namespace {

using Clock = std::chrono::steady_clock;
using Bytes = std::vector<std::uint8_t>;

constexpr double kWatchedSeconds = 5;    // since the last request, which come all the time
constexpr double kModelSeconds = 1.5;    // between two models at least
constexpr double kModelShare = 0.05;     // of the time for making their files
constexpr int kHeldOutSide = 1024;       // [px] at most
constexpr std::size_t kTokenBytes = 16;  // of a random one
constexpr std::size_t kShortToken = 8, kLongToken = 128;

std::int64_t nanoseconds() { return Clock::now().time_since_epoch().count(); }

std::string randomToken() {
  unsigned char bytes[kTokenBytes];
  if (::getrandom(bytes, sizeof bytes, 0) != static_cast<ssize_t>(sizeof bytes)) {
    throw Error(ErrorKind::device, "--serve: no random numbers for a token: " + systemReason());
  }
  std::string text;
  for (const unsigned char byte : bytes) text += formatted("%02x", byte);
  return text;
}

bool isTokenCharacter(char c) {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' || c == '_' ||
         c == '.' || c == '~';
}

// Reached from this machine alone.
bool isLoopback(const std::string& host) {
  in_addr four{};
  in6_addr six{};
  if (::inet_pton(AF_INET, host.c_str(), &four) == 1) return ntohl(four.s_addr) >> 24 == 127;
  if (::inet_pton(AF_INET6, host.c_str(), &six) == 1) return IN6_IS_ADDR_LOOPBACK(&six);
  return host == "localhost";
}

// The host of a Host header: without port and brackets.
std::string hostOf(std::string header) {
  if (header.starts_with('[')) return header.substr(1, header.find(']') - 1);
  return header.substr(0, header.find(':'));
}

// In a time that says nothing about where they differ.
bool sameText(const std::string& a, const std::string& b) {
  if (a.size() != b.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) difference |= static_cast<unsigned char>(a[i] ^ b[i]);
  return difference == 0;
}

// Equal for equal texts; who sees the page learns no path by it.
std::string nameFor(std::string_view text) { return formatted("%016zx", std::hash<std::string_view>{}(text)); }

std::string nameFor(const std::vector<std::filesystem::path>& subject) {
  std::string places;
  for (const std::filesystem::path& path : subject) {
    std::error_code ignored;
    const std::filesystem::path absolute = std::filesystem::absolute(path, ignored);
    places += std::filesystem::weakly_canonical(absolute, ignored).string() + '\0';
  }
  return nameFor(places);
}

nlohmann::ordered_json numberOrNull(const std::optional<double>& value, int decimals) {
  if (!value) return nullptr;
  return rounded(*value, decimals);
}

Image small(Image image) {
  const int side = std::max(image.width, image.height);
  return side > kHeldOutSide ? downsample(image, (side + kHeldOutSide - 1) / kHeldOutSide) : std::move(image);
}

// What browsers get. Never changed once it is shown.
struct Shown {
  std::optional<RunStatus> status;
  bool paused = false;  // at some time
  std::shared_ptr<const std::vector<RunMetrics>> lines = std::make_shared<std::vector<RunMetrics>>();
  int generation = 0;  // of the lines: raised when they are others, not only more
  std::shared_ptr<const Bytes> model;
  int model_number = 0;  // 0: none yet
  std::string held_out;  // the view's name
  std::shared_ptr<const Bytes> photograph, picture;
  int held_out_number = 0;
};

struct HeldOut {
  std::string name;
  Image photograph, picture;
};

struct Work {
  std::shared_ptr<const Bundle> model;
  std::optional<HeldOut> held_out;
  std::uint64_t number = 0;  // of all that was given
};

}  // namespace

ServeOptions parseServe(const std::string& where, const std::string& token) {
  const std::size_t colon = where.rfind(':');
  const std::string port = colon == where.npos ? where : where.substr(colon + 1);
  ServeOptions options;
  if (colon != where.npos) {
    options.host = where.substr(0, colon);
    if (options.host.starts_with('[') && options.host.ends_with(']')) {
      options.host = options.host.substr(1, options.host.size() - 2);
    }
  }
  const std::optional<int> number = parseWhole<int>(port);
  if (!number || *number < 0 || *number > 65535 || options.host.empty()) {
    refuseValue("--serve", where, "[ADDRESS:]PORT with a port from 0 to 65535");
  }
  options.port = *number;
  options.local = isLoopback(options.host);
  const bool fit =
      token.size() >= kShortToken && token.size() <= kLongToken && std::ranges::all_of(token, isTokenCharacter);
  if (!token.empty() && !fit) {
    throw Error(ErrorKind::usage, "--serve-token: expected " + std::to_string(kShortToken) + " to " +
                                      std::to_string(kLongToken) + " letters, digits and -._~");
  }
  options.token = token.empty() && !options.local ? randomToken() : token;
  return options;
}

class PageServer::Pages {
 public:
  Pages(const ServeOptions& options, std::string title, const std::vector<std::filesystem::path>& subject)
      : options_(options),
        title_(std::move(title)),
        subject_(nameFor(subject)),
        worker_(startWorker(work_, [this](const std::stop_token& stop) { make(stop); })),
        server_(options.host, options.port, [this](const HttpRequest& request) { return answer(request); }) {}

  std::string url() const {
    std::string host = options_.host;
    char own[256] = {};
    const bool any = host == "0.0.0.0" || host == "::";
    if (any && ::gethostname(own, sizeof own - 1) == 0) host = own;
    return "http://" + (host.find(':') != host.npos ? "[" + host + "]" : host) + ":" + std::to_string(server_.port()) +
           "/" + (options_.token.empty() ? "" : "?token=" + options_.token);
  }

  bool watched() const { return static_cast<double>(nanoseconds() - asked_) * 1e-9 < kWatchedSeconds; }
  bool wantsModel() const { return watched() && !making_ && nanoseconds() >= next_model_; }

  void give(Work work) {
    if (work.model) making_ = true;
    work.number = ++given_;
    work_.give(std::move(work), [](Work& held, Work& fresh) {
      if (fresh.model) held.model = std::move(fresh.model);
      if (fresh.held_out) held.held_out = std::move(fresh.held_out);
      held.number = fresh.number;
    });
  }
  template <typename Change>
  void change(Change change) {
    const std::lock_guard lock(mutex_);
    change(shown_);
    ++changes_;
  }

  void show(RunStatus status) {
    change([&](Shown& shown) {
      shown.paused = shown.paused || status.phase == RunPhase::paused;
      shown.status = std::move(status);
      if (!std::exchange(lines_wait_, false)) return;
      shown.lines = std::make_shared<const std::vector<RunMetrics>>(lines_);
      shown.generation = generation_;
    });
  }
  void notePause() {
    change([](Shown& shown) { shown.paused = true; });
  }
  void clearLines() {
    lines_.clear();
    ++generation_;
    lines_wait_ = true;
  }
  void add(RunMetrics line) {
    const std::size_t before = lines_.size();
    addThinned(lines_, std::move(line));
    generation_ += lines_.size() <= before;
    lines_wait_ = true;
  }

  void linger(std::chrono::milliseconds most, const std::atomic<bool>* stop) const {
    const Clock::time_point end = Clock::now() + most;
    const auto seen = [&] {
      const std::lock_guard lock(mutex_);
      return made_ == given_ && seen_ == changes_ && model_seen_ == shown_.model_number;
    };
    while (watched() && Clock::now() < end && !seen() && !(stop && *stop)) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

 private:
  Shown shown() const {
    const std::lock_guard lock(mutex_);
    return shown_;
  }

  // The worker's life. What cannot be made is said once, and is nothing to whoever gives it.
  void make(const std::stop_token& stop) {
    runInBackground();
    const SerialLoops alone;
    const auto aloud = [this](const auto& made) {
      try {
        made();
      } catch (const std::exception& error) {
        if (!std::exchange(said_, true)) std::fprintf(stderr, "--serve: %s\n", error.what());
      }
    };
    while (std::optional<Work> work = work_.take(stop)) {
      if (work->model) {
        const double start = threadSeconds();
        aloud([&] { makeModel(*work->model); });
        pause(threadSeconds() - start);
      }
      if (work->held_out) aloud([&] { makeHeldOut(std::move(*work->held_out)); });
      made_ = work->number;
    }
  }

  void makeHeldOut(HeldOut held_out) {
    const auto photograph = std::make_shared<const Bytes>(encodePng(small(std::move(held_out.photograph))));
    const auto picture = std::make_shared<const Bytes>(encodePng(small(std::move(held_out.picture))));
    change([&](Shown& shown) {
      shown.held_out = std::move(held_out.name);
      shown.photograph = photograph;
      shown.picture = picture;
      ++shown.held_out_number;
    });
  }

  void makeModel(const Bundle& bundle) {
    const ScratchFolder scratch;
    const std::filesystem::path file = scratch.path() / "model.glb";
    WriteOptions options;
    options.lean = true;
    writeGlb(file,
             {.model = bundle.model, .cameras = bundle.cameras, .background = bundle.background, .options = options});
    auto bytes = std::make_shared<const Bytes>(readFile(file, std::uint64_t{4} << 30));
    change([&](Shown& shown) {
      shown.model = std::move(bytes);
      ++shown.model_number;
    });
  }

  // Until the next model, after one that took so long. [s]
  void pause(double cost) {
    const double pause = std::max(kModelSeconds, cost / kModelShare);
    next_model_ = nanoseconds() + static_cast<std::int64_t>(pause * 1e9);
    making_ = false;
  }

  HttpAnswer answer(const HttpRequest& request) {
    // A page of another site whose name leads here (DNS rebinding) brings that name.
    if (options_.local && !isLoopback(hostOf(request.host))) {
      return {.status = 403, .text = "this server answers to localhost alone\n"};
    }
    if (!options_.token.empty()) {
      constexpr std::string_view kBearer = "Bearer ";
      const bool bears = request.authorization.starts_with(kBearer);
      const std::string token = bears ? request.authorization.substr(kBearer.size()) : request.query("token");
      if (!sameText(token, options_.token)) {
        return {.status = 401, .text = "a token is needed: open the address that the program printed\n"};
      }
    }
    if (request.path == "/") return {.type = "text/html; charset=utf-8", .text = std::string(livePage())};
    if (request.path == "/state.json") return state(request);
    const Shown now = shown();
    if (request.path == "/model.glb" && now.model) {
      return {.type = "model/gltf-binary", .text = "", .bytes = now.model, .sent = [this, number = now.model_number] {
                const std::lock_guard lock(mutex_);  // a slower page may have an older one later
                model_seen_ = std::max(model_seen_.load(), number);
              }};
    }
    if (request.path == "/photograph.png" && now.photograph) {
      return {.type = "image/png", .text = "", .bytes = now.photograph};
    }
    if (request.path == "/picture.png" && now.picture) return {.type = "image/png", .text = "", .bytes = now.picture};
    return {.status = 404, .text = "there is no such page\n"};
  }

  // All that is not a picture: the page asks again and again for what it has not seen yet.
  HttpAnswer state(const HttpRequest& request) {
    asked_ = nanoseconds();
    std::uint64_t changes = 0;
    Shown now;
    {
      const std::lock_guard lock(mutex_);
      now = shown_;
      changes = changes_;
    }
    const std::optional<int> generation = parseWhole<int>(request.query("generation"));
    const std::optional<std::size_t> from = parseWhole<std::size_t>(request.query("from"));
    const bool more = generation == now.generation && from && *from <= now.lines->size();
    const std::size_t first = more ? *from : 0;
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    for (std::size_t i = first; i < now.lines->size(); ++i) {
      const RunMetrics& line = (*now.lines)[i];
      rows.push_back({line.stage, line.iteration, numberOrNull(line.loss, 6), numberOrNull(line.train_psnr, 3),
                      numberOrNull(line.test_psnr, 3), line.gaussians});
    }
    nlohmann::ordered_json json = {{"format", "tg-page"}, {"version", 1},  {"title", title_},
                                   {"start", start_},     {"page", page_}, {"subject", subject_}};
    json["run"] = now.status ? nlohmann::ordered_json::parse(formatStatus(*now.status)) : nullptr;
    json["paused"] = now.paused;
    json["metrics"] = {{"generation", now.generation}, {"from", first}, {"rows", std::move(rows)}};
    json["model"] = now.model_number;
    json["held_out"] = {{"number", now.held_out_number}, {"name", now.held_out}};
    seen_ = changes;
    return {.type = "application/json", .text = dumpJson(json)};
  }

  const ServeOptions options_;
  const std::string title_;
  const std::string subject_, page_ = nameFor(livePage());
  const std::uint32_t start_ = std::random_device{}();  // numbers begin again with the next one
  mutable std::mutex mutex_;  // guards the two below, which many threads read: no mailbox lets them
  Shown shown_;
  std::uint64_t changes_ = 0;
  std::atomic<std::uint64_t> seen_{0}, given_{0}, made_{0};
  std::atomic<int> model_seen_{0};
  std::atomic<std::int64_t> asked_{std::numeric_limits<std::int64_t>::min() / 2}, next_model_{0};  // [ns]
  std::atomic<bool> making_{false};
  bool said_ = false;
  std::vector<RunMetrics> lines_;  // the caller's; shown with the next status
  int generation_ = 0;
  bool lines_wait_ = false;
  LatestValue<Work> work_;
  std::jthread worker_;
  HttpServer server_;
};

PageServer::PageServer(const ServeOptions& options, std::string title,
                       const std::vector<std::filesystem::path>& subject)
    : pages_(std::make_unique<Pages>(options, std::move(title), subject)) {}
PageServer::~PageServer() = default;

std::string PageServer::url() const { return pages_->url(); }
bool PageServer::watched() const { return pages_->watched(); }
bool PageServer::wantsModel() const { return pages_->wantsModel(); }
void PageServer::show(std::shared_ptr<const Bundle> model) { pages_->give({std::move(model), std::nullopt}); }
void PageServer::show(RunStatus status) { pages_->show(std::move(status)); }
void PageServer::notePause() { pages_->notePause(); }
void PageServer::add(RunMetrics line) { pages_->add(std::move(line)); }
void PageServer::show(const std::vector<RunMetrics>& lines) {
  pages_->clearLines();
  for (const RunMetrics& line : lines) pages_->add(line);
}
void PageServer::showHeldOut(const std::string& name, Image photograph, Image picture) {
  pages_->give({nullptr, HeldOut{name, std::move(photograph), std::move(picture)}});
}
std::unique_ptr<PageServer> servePage(const std::string& where, const std::string& token, const std::string& title,
                                      const std::vector<std::filesystem::path>& subject, std::FILE* said) {
  auto page = std::make_unique<PageServer>(parseServe(where, token), title, subject);
  std::fprintf(said, "serving %s\n", page->url().c_str());
  std::fflush(said);
  return page;
}

void PageServer::linger(std::chrono::milliseconds most, const std::atomic<bool>* stop) const {
  pages_->linger(most, stop);
}

}  // namespace tg
