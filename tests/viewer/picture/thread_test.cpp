// SPDX-License-Identifier: Apache-2.0
// The thread that draws pictures, on a device of images in memory.
#include "viewer/picture/thread.h"

#include <atomic>
#include <chrono>
#include <new>
#include <thread>
#include <utility>

#include "core/system/error.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "support/temporary_folder.h"

using namespace tg;

namespace {

struct Gate {
  std::atomic<int> uploads{0}, images{0}, renderers{0};
  std::atomic<bool> shut{false}, fails{false}, full{false};
  void open() {
    shut = false;
    shut.notify_all();
  }
};

// Takes the CPU's pictures, one at a time through the gate. Has no GPU: drawing there fails as on a lost device.
class MemoryDevice final : public PictureDevice {
 public:
  explicit MemoryDevice(Gate& gate) : gate_(gate) {}

  std::shared_ptr<PictureImage> makeImage(glm::ivec2 size) override {
    return std::make_shared<MemoryImage>(gate_, size);
  }
  std::unique_ptr<GpuRenderer> makeRenderer() override {
    ++gate_.renderers;
    throw Error(ErrorKind::device, gate_.full ? "full" : "lost");
  }
  bool draw(GpuRenderer&, const FrameRequest&, PictureImage&, int) override { return false; }
  void upload(const Image&, PictureImage&) override {
    ++gate_.uploads;
    gate_.uploads.notify_all();
    gate_.shut.wait(true);
    if (gate_.fails.exchange(false)) throw std::bad_alloc();
  }
  Image download(const PictureImage&) override { return {}; }

 private:
  struct MemoryImage : PictureImage {
    MemoryImage(Gate& g, glm::ivec2 s) : PictureImage(s), gate(g) { ++gate.images; }
    ~MemoryImage() override { --gate.images; }
    MemoryImage& operator=(MemoryImage&&) = delete;
    Gate& gate;
  };
  Gate& gate_;
};

struct Bench {
  Gate gate;
  std::shared_ptr<const GaussianModel> model = std::make_shared<GaussianModel>(test::trainedLikeModel(1, 20));
  PictureThread thread;

  explicit Bench(const std::string& backend, std::chrono::milliseconds device_rest = std::chrono::hours(1))
      : thread([this] { return std::make_unique<MemoryDevice>(gate); }, 1, backend, [] {}, device_rest) {}
  ~Bench() { gate.open(); }
  void ask(int width, bool in_run = false) {
    PictureRequest request;
    request.in_run = in_run;
    request.model = model;
    request.camera = test::trainedLikeCamera(width, 24);
    thread.ask(std::move(request));
  }
  void awaitUploads(int count) {
    for (int now = gate.uploads; now < count; now = gate.uploads) gate.uploads.wait(now);
  }
  // All news up to the picture of that width, or, with width 0, up to the first that it gives up.
  PictureThread::News until(int width) {
    PictureThread::News all;
    for (int i = 0; i < 60000; ++i) {
      PictureThread::News news = thread.take();
      if (!news.problem.empty()) all.problem = news.problem;
      all.given_up = all.given_up || news.given_up;
      if (news.picture) all.picture = news.picture;
      if (width == 0 ? all.given_up : all.picture && all.picture->request.camera.size.x == width) return all;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    FAIL("no such news");
    return all;
  }
};

}  // namespace

TEST_CASE("of the pictures asked for while one is drawn only the newest comes") {
  Bench bench("cpu");
  bench.gate.shut = true;
  bench.ask(32);
  bench.awaitUploads(1);
  CHECK_FALSE(bench.thread.waiting());
  for (int width = 33; width < 40; ++width) bench.ask(width);
  CHECK(bench.thread.waiting());
  bench.gate.open();
  const PictureThread::News news = bench.until(39);
  CHECK(news.problem.empty());
  CHECK_FALSE(news.given_up);
  CHECK(news.picture->backend == "cpu");
  CHECK(bench.gate.uploads == 2);
}

TEST_CASE("the CPU draws the picture on which the device fails, and says so once") {
  Bench bench("vulkan");
  bench.ask(32);
  const PictureThread::News news = bench.until(32);
  CHECK(news.problem == "The device failed, the CPU renders meanwhile: lost");
  CHECK_FALSE(news.given_up);
  CHECK(news.picture->backend == "cpu");
  bench.ask(33);
  CHECK(bench.until(33).problem.empty());
  CHECK(bench.gate.renderers == 1);
}

TEST_CASE("a device that failed is tried again, and a failure is told again only when it is another one") {
  Bench bench("vulkan", std::chrono::milliseconds(0));
  bench.ask(32);
  CHECK(bench.until(32).problem == "The device failed, the CPU renders meanwhile: lost");
  bench.ask(33);
  CHECK(bench.until(33).problem.empty());
  CHECK(bench.gate.renderers == 2);
  bench.ask(35, true);
  CHECK(bench.until(35).problem.empty());
  CHECK(bench.gate.renderers == 2);
  bench.gate.full = true;
  bench.ask(34);
  const PictureThread::News news = bench.until(34);
  CHECK(news.problem == "The device failed, the CPU renders meanwhile: full");
  CHECK(news.picture->backend == "cpu");
  CHECK_FALSE(news.given_up);
}

TEST_CASE("a picture that cannot be drawn is given up, unless another one has been asked for") {
  Bench bench("cpu");
  bench.gate.fails = true;
  bench.ask(32);
  CHECK(bench.until(0).problem == "The picture cannot be drawn: not enough memory");
  bench.ask(33);
  CHECK_FALSE(bench.until(33).given_up);

  bench.gate.fails = bench.gate.shut = true;
  bench.ask(34);
  bench.awaitUploads(3);
  bench.ask(35);
  bench.gate.open();
  const PictureThread::News news = bench.until(35);
  CHECK(news.problem == "The picture cannot be drawn: not enough memory");
  CHECK_FALSE(news.given_up);
}

TEST_CASE("the thread ends while it draws, and what waits is dropped") {
  for (int round = 0; round < 20; ++round) {
    Bench bench("cpu");
    bench.ask(32);
    if (round % 2 == 0) bench.awaitUploads(1);
    bench.ask(33);
  }
}

TEST_CASE("a photograph is read once while it is shown, and held no longer") {
  const TemporaryFolder folder;
  writeImage(folder / "a.png", Image(8, 6, 3));
  Bench bench("cpu");
  PictureRequest request;
  request.model = bench.model;
  request.other = OtherPicture{};
  request.other->photograph = folder / "a.png";
  std::weak_ptr<const Image> photograph;
  for (int width = 32; width < 34; ++width) {
    request.camera = request.other->taken = test::trainedLikeCamera(width, 24);
    bench.thread.ask(request);
    const PictureThread::News news = bench.until(width);
    REQUIRE(news.picture->photograph);
    CHECK((width == 32 || photograph.lock() == news.picture->photograph));
    photograph = news.picture->photograph;
  }
  CHECK_FALSE(photograph.expired());
  bench.ask(34);
  bench.until(34);
  CHECK(photograph.expired());
}

TEST_CASE("each of two models is drawn in its own crop box, also where both share a scale") {
  Bench bench("cpu");
  for (const Output output : {Output::final, Output::depth}) {
    INFO(name(output));
    PictureRequest request;
    request.model = bench.model;
    request.camera = test::trainedLikeCamera(32, 24);
    request.output = output;
    request.settings.crop = CropBox{glm::vec3(1000), glm::vec3(1000)};  // nothing
    request.other = OtherPicture{};
    request.other->model = std::make_shared<const GaussianModel>(test::trainedLikeModel(2, 20));
    bench.thread.ask(request);
    const auto beside = bench.until(32).picture->pair;
    std::swap(request.model, request.other->model);
    std::swap(request.settings.crop, request.other->crop);
    bench.thread.ask(request);
    const auto turned = bench.until(32).picture->pair;
    CHECK(beside->other.data == turned->first.data);
    CHECK(beside->first.data == turned->other.data);
    CHECK(beside->first.data != beside->other.data);
  }
}

TEST_CASE("a model that nobody holds is let go of with the next picture, or when told to, what was asked for stays") {
  Bench bench("cpu");
  bench.ask(32);
  bench.until(32);
  const std::weak_ptr<const GaussianModel> first = bench.model;
  bench.model = std::make_shared<GaussianModel>(test::trainedLikeModel(2, 20));
  bench.ask(33);
  bench.until(33);
  CHECK(first.expired());

  bench.gate.shut = true;
  bench.ask(34);
  bench.awaitUploads(3);
  bench.ask(35);
  bench.thread.tidy();
  bench.gate.open();
  CHECK(bench.until(35).problem.empty());

  const std::weak_ptr<const GaussianModel> last = bench.model;
  bench.model.reset();
  bench.thread.tidy();
  for (int i = 0; i < 60000 && !(last.expired() && bench.gate.images == 0); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  CHECK(last.expired());
  CHECK(bench.gate.images == 0);
}
