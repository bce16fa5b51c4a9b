// SPDX-License-Identifier: Apache-2.0
// The page's server as browsers, and what is no browser, meet it: curl, and sockets of our own.
#include "converter/serve/page_server.h"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <stop_token>
#include <thread>

#include "converter/gltf/read_gltf.h"
#include "converter/scenes.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

using namespace tg;

namespace {

std::string noCurl() { return std::system("curl --version >/dev/null 2>&1") == 0 ? "" : "no curl"; }

struct Answer {
  std::string head, body;
  int status() const { return head.size() > 12 ? std::atoi(head.c_str() + 9) : 0; }
};

Answer get(const std::string& url, const std::string& more = "") {
  std::FILE* curl = ::popen(("curl -s --max-time 20 -i " + more + " '" + url + "'").c_str(), "r");
  if (!curl) throw std::runtime_error("cannot start curl");
  std::string said;
  std::array<char, 4096> piece;
  for (std::size_t got = 0; (got = std::fread(piece.data(), 1, piece.size(), curl)) > 0;)
    said.append(piece.data(), got);
  ::pclose(curl);
  const std::size_t end = std::min(said.find("\r\n\r\n"), said.size());
  return {said.substr(0, end), said.substr(std::min(end + 4, said.size()))};
}

// A socket of this machine's that waits `seconds` for a byte at most.
int connectedTo(int port, int seconds) {
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int held = 1 << 16;  // [bytes] for who does not take them
  ::setsockopt(socket, SOL_SOCKET, SO_RCVBUF, &held, sizeof held);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    throw std::runtime_error("cannot connect");  // in threads, where Catch2 asserts nothing
  }
  const timeval limit{seconds, 0};
  ::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  ::setsockopt(socket, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
  return socket;
}

void say(int socket, const std::string& text) {
  std::size_t sent = 0;
  while (sent < text.size()) {
    const ssize_t some = ::send(socket, text.data() + sent, text.size() - sent, MSG_NOSIGNAL);
    if (some <= 0) break;
    sent += static_cast<std::size_t>(some);
  }
}

// Until the server closes the socket, or says nothing any more.
std::string heardFrom(int socket) {
  std::string heard;
  std::array<char, 1 << 16> piece;
  for (ssize_t got = 0; (got = ::recv(socket, piece.data(), piece.size(), 0)) > 0;) {
    heard.append(piece.data(), static_cast<std::size_t>(got));
  }
  ::close(socket);
  return heard;
}

// What a socket hears that says `text`, until the server closes it or `seconds` have passed.
std::string saidTo(int port, const std::string& text, int seconds) {
  const int socket = connectedTo(port, seconds);
  say(socket, text);
  return heardFrom(socket);
}

int portOf(const PageServer& page) {
  const std::string url = page.url();
  return std::atoi(url.c_str() + url.rfind(':') + 1);
}

nlohmann::json stateOf(const PageServer& page, const std::string& query = "") {
  return nlohmann::json::parse(get(page.url() + "state.json" + query).body);
}

template <typename Condition>
bool soon(const Condition& condition) {
  for (int i = 0; i < 6000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

}  // namespace

TEST_CASE("where to serve is a port, or an address and a port, and others than this machine want a token", "[serve]") {
  CHECK(parseServe("8080", "").host == "127.0.0.1");
  CHECK(parseServe("8080", "").port == 8080);
  CHECK(parseServe("8080", "").token.empty());
  CHECK(parseServe("localhost:1", "").token.empty());
  CHECK(parseServe("[::1]:80", "").host == "::1");
  CHECK(parseServe("[::1]:80", "").token.empty());
  const ServeOptions open = parseServe("0.0.0.0:8080", ""), again = parseServe("0.0.0.0:8080", "");
  CHECK(open.token.size() == 32);
  CHECK(open.token != again.token);
  CHECK_FALSE(open.local);
  CHECK(parseServe("0.0.0.0:8080", "letters-and.digits_1~").token == "letters-and.digits_1~");
  for (const char* wrong : {"", "port", "65536", "-1", ":80", "host:", "80:", "8080x"}) {
    INFO(wrong);
    CHECK_THAT(test::messageOf([&] { parseServe(wrong, ""); }), Contains("--serve: expected [ADDRESS:]PORT"));
  }
  for (const char* wrong : {"short", "with spaces in it", "quotes'quotes'"}) {
    CHECK_THAT(test::messageOf([&] { parseServe("80", wrong); }), Contains("--serve-token: expected 8 to 128"));
  }
}

TEST_CASE("a port that is taken is one line and the code of a device", "[serve]") {
  const PageServer first(parseServe("0", ""), "a");
  try {
    const PageServer second(parseServe(std::to_string(portOf(first)), ""), "b");
    FAIL("two servers on one port");
  } catch (const Error& error) {
    CHECK(error.kind == ErrorKind::device);
    CHECK_THAT(error.what(), Contains("cannot listen here: Address already in use"));
  }
}

TEST_CASE("a page, its state and its model come by HTTP, and nothing else does", "[serve]") {
  TG_SKIP_IF(noCurl());
  PageServer page(parseServe("0", ""), "a \"title\" <b>");
  CHECK_FALSE(page.watched());
  const Answer front = get(page.url());
  CHECK(front.status() == 200);
  CHECK_THAT(front.head, Contains("Content-Security-Policy: default-src 'none'"));
  CHECK_THAT(front.body, Contains("startLive()"));
  CHECK(get(page.url() + "model.glb").status() == 404);
  CHECK_FALSE(page.watched());

  nlohmann::json state = stateOf(page);
  CHECK(page.watched());
  CHECK(page.wantsModel());
  CHECK(state["title"] == "a \"title\" <b>");
  CHECK(state["run"].is_null());
  CHECK(state["model"] == 0);

  auto bundle = std::make_shared<Bundle>();
  bundle->model = test::trainedLikeModel(1, 50);
  bundle->background = glm::vec3(0.5f);
  const auto given = std::chrono::steady_clock::now();
  page.show(bundle);
  REQUIRE(soon([&] { return stateOf(page)["model"] == 1; }));
  const bool wants = page.wantsModel();  // not that often
  CHECK((!wants || std::chrono::steady_clock::now() - given > std::chrono::milliseconds(1500)));
  const TemporaryFolder folder;
  std::ofstream(folder / "model.glb", std::ios::binary) << get(page.url() + "model.glb").body;
  CHECK(readGltf(folder / "model.glb").model.size() == bundle->model.size());

  RunMetrics line;
  line.stage = "plain";
  line.iteration = 10;
  line.iterations = 100;
  line.train_psnr = 20.5;
  page.add(line);
  page.show(RunStatus{RunPhase::training, "fox", line});
  state = stateOf(page);
  CHECK(state["run"]["phase"] == "training");
  CHECK(state["metrics"]["rows"] == nlohmann::json::parse(R"([["plain",10,null,20.5,null,0]])"));
  line.iteration = 20;
  page.add(line);
  page.show(RunStatus{RunPhase::training, "fox", line});
  const std::string generation = state["metrics"]["generation"].dump();
  CHECK(stateOf(page, "?generation=" + generation + "&from=1")["metrics"]["rows"].size() == 1);
  CHECK(stateOf(page, "?generation=77&from=1")["metrics"]["rows"].size() == 2);
  CHECK(stateOf(page, "?generation=" + generation + "&from=99999999999999999999")["metrics"]["rows"].size() == 2);

  page.showHeldOut("test/r_0", Image(8, 4, 3, 0.5f), Image(8, 4, 3, 0.25f));
  REQUIRE(soon([&] { return stateOf(page)["held_out"]["number"] == 1; }));
  const std::string png = get(page.url() + "photograph.png").body;
  CHECK(decodeImage(std::span(reinterpret_cast<const std::uint8_t*>(png.data()), png.size()), "p").width == 8);

  for (const char* path : {"etc/passwd", "../../../../etc/passwd", "..%2f..%2fetc%2fpasswd", "%2e%2e/", "page.html",
                           "model.glb/", "STATE.JSON"}) {
    INFO(path);
    CHECK(get(page.url() + path, "--path-as-is").status() == 404);
  }
  CHECK(get(page.url(), "-X POST -d pause").status() == 405);
  CHECK(get(page.url(), "-X DELETE").status() == 405);
  const Answer whole = get(page.url(), "-H 'Range: bytes=0-0,0-0'");
  CHECK(whole.status() == 200);
  CHECK(whole.body == front.body);
}

TEST_CASE("a model that cannot be made into a file ends nothing", "[serve]") {
  TG_SKIP_IF(noCurl());
  PageServer page(parseServe("0", ""), "a");
  auto bundle = std::make_shared<Bundle>();
  bundle->model = test::trainedLikeModel(1, 50);
  const char* const before = std::getenv("TMPDIR");
  const std::string temporary = before ? before : "/tmp";
  ::setenv("TMPDIR", "/nonexistent", 1);
  for (int i = 1; i <= 3; ++i) {
    CHECK_NOTHROW(page.show(bundle));
    CHECK_NOTHROW(page.showHeldOut("view", Image(8, 4, 3, 0.5f), Image(8, 4, 3, 0.25f)));
    CHECK(soon([&] { return stateOf(page)["held_out"]["number"] == i; }));  // made behind the model
  }
  CHECK(stateOf(page)["model"] == 0);
  ::setenv("TMPDIR", temporary.c_str(), 1);
  page.show(bundle);
  CHECK(soon([&] { return stateOf(page)["model"] == 1; }));
}

TEST_CASE("a name that only leads to this machine gets nothing, nor does who has no token", "[serve]") {
  TG_SKIP_IF(noCurl());
  const PageServer local(parseServe("0", ""), "a");
  CHECK(get(local.url() + "state.json", "-H 'Host: evil.example'").status() == 403);
  CHECK(get(local.url() + "state.json", "-H 'Host: localhost.evil.example:80'").status() == 403);
  CHECK(get(local.url() + "state.json", "-H 'Host:'").status() >= 400);
  CHECK(get(local.url() + "state.json", "-H 'Host: localhost:1234'").status() == 200);  // through a tunnel

  const PageServer page(parseServe("127.0.0.1:0", "0123456789abcdef"), "a");
  const std::string bare = "http://127.0.0.1:" + std::to_string(portOf(page)) + "/";
  CHECK_THAT(page.url(), Contains("?token=0123456789abcdef"));
  CHECK(get(page.url()).status() == 200);
  for (const char* path : {"", "state.json", "model.glb", "photograph.png", "nothing"}) {
    INFO(path);
    CHECK(get(bare + path).status() == 401);
    CHECK(get(bare + path + "?token=0123456789abcdee").status() == 401);
  }
  CHECK_FALSE(page.watched());
  CHECK(get(bare + "state.json", "-H 'Authorization: Bearer 0123456789abcdef'").status() == 200);
  CHECK(get(bare + "state.json", "-H 'Authorization: Bearer 0123456789abcdef0'").status() == 401);
}

TEST_CASE("requests without end, of strange bytes and from sleepers end by themselves, and others are served meanwhile",
          "[serve]") {
  TG_SKIP_IF(noCurl());
  const PageServer page(parseServe("0", ""), "a");
  std::string headers = "GET / HTTP/1.1\r\n";
  for (int i = 0; i < 100'000; ++i) headers += "X-" + std::to_string(i) + ": y\r\n";
  CHECK(saidTo(portOf(page), headers, 8).size() < 1000);
  CHECK(saidTo(portOf(page), "GET /" + std::string(1 << 20, 'a'), 8).size() < 2000);
  saidTo(portOf(page), std::string("\0\xff\xfe\r\n\r\n\r\n", 9), 8);
  saidTo(portOf(page), "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n\r\nx", 8);
  std::vector<std::thread> sleepers;
  for (int i = 0; i < 8; ++i) sleepers.emplace_back([&] { saidTo(portOf(page), "GET / HT", 2); });
  CHECK(get(page.url()).status() == 200);
  for (std::thread& sleeper : sleepers) sleeper.join();
  CHECK(get(page.url()).status() == 200);
}

TEST_CASE("a model is seen once all of it has come", "[serve]") {
  TG_SKIP_IF(noCurl());
  PageServer page(parseServe("0", ""), "a");
  stateOf(page);
  auto bundle = std::make_shared<Bundle>();
  bundle->model = test::trainedLikeModel(1, 60000);  // more than the sockets hold
  page.show(bundle);
  REQUIRE(soon([&] { return stateOf(page)["model"] == 1; }));
  const auto seenWithin = [&](int milliseconds) {
    stateOf(page);
    const auto start = std::chrono::steady_clock::now();
    page.linger(std::chrono::milliseconds(milliseconds), nullptr);
    return std::chrono::steady_clock::now() - start < std::chrono::milliseconds(milliseconds);
  };
  get(page.url() + "model.glb", "--head");
  CHECK_FALSE(seenWithin(200));
  const int slow = connectedTo(portOf(page), 20);
  say(slow, "GET /model.glb HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  char first = 0;
  REQUIRE(::recv(slow, &first, 1, 0) == 1);
  CHECK_FALSE(seenWithin(300));
  const std::jthread reader([&] { heardFrom(slow); });
  const std::jthread asker([&](const std::stop_token& stop) {  // lest nobody watches any more
    while (!stop.stop_requested()) get(page.url() + "state.json");
  });
  CHECK(seenWithin(60000));
}

TEST_CASE("a program says whether an open page may go on with it and whether its run was paused", "[serve]") {
  TG_SKIP_IF(noCurl());
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "a");
  std::filesystem::create_directory_symlink(folder / "a", folder / "link");
  const auto stateWith = [&](const std::vector<std::filesystem::path>& subject) {
    return stateOf(PageServer(parseServe("0", ""), "model.tgz", subject));
  };
  const nlohmann::json state = stateWith({folder / "a/model.tgz"}), again = stateWith({folder / "link/model.tgz"});
  CHECK(state["start"] != again["start"]);
  CHECK(state["subject"] == again["subject"]);
  CHECK(state["page"] == again["page"]);
  CHECK(state["page"].get<std::string>().size() == 16);
  CHECK(state["subject"] != stateWith({folder / "b/model.tgz"})["subject"]);
  CHECK(state["subject"] != stateWith({folder / "a/model.tgz", ""})["subject"]);

  PageServer page(parseServe("0", ""), "a");
  RunStatus status;
  page.show(status);
  CHECK(stateOf(page)["paused"] == false);
  status.phase = RunPhase::paused;
  page.show(status);
  status.phase = RunPhase::training;
  page.show(status);
  CHECK(stateOf(page)["paused"] == true);
  PageServer unseen(parseServe("0", ""), "a");
  unseen.notePause();
  CHECK(stateOf(unseen)["paused"] == true);
}

TEST_CASE("a server goes at once, whoever still listens", "[serve]") {
  auto page = std::make_unique<PageServer>(parseServe("0", ""), "a");
  std::vector<std::thread> sleepers;
  for (int i = 0; i < 4; ++i) sleepers.emplace_back([port = portOf(*page)] { saidTo(port, "GET / HT", 20); });
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  const auto start = std::chrono::steady_clock::now();
  page.reset();
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(5));
  for (std::thread& sleeper : sleepers) sleeper.join();
}
