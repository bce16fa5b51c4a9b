// SPDX-License-Identifier: Apache-2.0
// Decoding, masks and the store that keeps, streams and reads ahead.
#include "training/data/photographs.h"

#include <atomic>
#include <chrono>
#include <limits>
#include <set>
#include <thread>

#include "core/system/error.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/data/dataset.h"
#include "training/data/sample.h"
#include "training/run/trainer.h"
#include "core/system/random.h"

namespace {

tg::Photograph gray(std::size_t bytes, std::uint8_t value) {
  tg::Photograph photograph;
  photograph.pixels.rgb.assign(bytes, value);
  return photograph;
}

// Photograph i holds the value i; counts how often each is decoded.
struct Files {
  std::size_t bytes = 300;
  std::vector<std::atomic<int>> decoded;
  explicit Files(std::size_t count) : decoded(count) {}
  tg::PhotographStore::Decode decode() {
    return [this](std::size_t view) {
      ++decoded[view];
      return gray(bytes, static_cast<std::uint8_t>(view));
    };
  }
};

void waitUntil(const std::atomic<int>& count, int value) {
  for (int i = 0; count < value && i < 60000; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  REQUIRE(count == value);
}

void offerAll(tg::PhotographStore& store, Files& files) {
  for (std::size_t i = 0; i < files.decoded.size(); ++i) {
    store.offer(i, gray(files.bytes, static_cast<std::uint8_t>(i)));
  }
  store.finishOffers();
}

}  // namespace

TEST_CASE("a store inside its limit never decodes again", "[photographs]") {
  Files files(10);
  tg::PhotographStore store(10, 3000, files.decode());
  offerAll(store, files);
  CHECK(store.keptViews() == 10);
  CHECK(store.keptBytes() == 3000);
  for (std::size_t i = 0; i < 10; ++i) {
    store.prefetch(i);
    CHECK(store.get(i)->pixels.rgb == std::vector<std::uint8_t>(300, static_cast<std::uint8_t>(i)));
    CHECK(files.decoded[i] == 0);
  }
}

TEST_CASE("beyond the limit photographs are decoded when asked for, with room left for those in flight",
          "[photographs]") {
  Files files(10);
  tg::PhotographStore store(10, 2999, files.decode());
  offerAll(store, files);
  CHECK(store.keptViews() == 6);  // 1,800 bytes, and 900 for the three in flight
  CHECK(store.keptBytes() + (tg::PhotographStore::kReadAhead + 1) * files.bytes <= 2999);
  int streamed = 0;
  for (int round = 0; round < 3; ++round) {
    for (std::size_t i = 0; i < 10; ++i) CHECK(store.get(i)->pixels.rgb[0] == i);
  }
  for (std::size_t i = 0; i < 10; ++i) streamed += files.decoded[i] == 3;
  CHECK(streamed == 4);

  tg::PhotographStore none(10, 0, files.decode());
  offerAll(none, files);
  CHECK(none.keptViews() == 0);
  CHECK(none.get(9)->pixels.rgb[299] == 9);
}

TEST_CASE("a hint is decoded in the background, once", "[photographs]") {
  Files files(4);
  tg::PhotographStore store(4, 0, files.decode());
  store.prefetch(2);
  store.prefetch(2);
  waitUntil(files.decoded[2], 1);
  CHECK(store.get(2)->pixels.rgb[0] == 2);
  CHECK(files.decoded[2] == 1);
  CHECK(store.get(2)->pixels.rgb[0] == 2);  // not kept: decoded again
  CHECK(files.decoded[2] == 2);
}

TEST_CASE("hints that nobody follows give way to new ones", "[photographs]") {
  Files files(6);
  tg::PhotographStore store(6, 0, files.decode());
  for (std::size_t i = 0; i < 5; ++i) {
    store.prefetch(i);
    waitUntil(files.decoded[i], 1);
  }
  CHECK(store.get(4)->pixels.rgb[0] == 4);
  CHECK(files.decoded[4] == 1);
  CHECK(store.get(0)->pixels.rgb[0] == 0);
  CHECK(files.decoded[0] == 2);
}

TEST_CASE("the order of hints and reads never changes what is read", "[photographs]") {
  Files files(20);
  tg::PhotographStore store(20, 2000, files.decode());
  offerAll(store, files);
  tg::Random random(5);
  std::vector<std::size_t> order;
  for (int i = 0; i < 500; ++i) order.push_back(static_cast<std::size_t>(random.below(20)));
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (std::size_t ahead = i + 1; ahead < std::min(i + 4, order.size()); ++ahead) store.prefetch(order[ahead]);
    const auto photograph = store.get(order[i]);
    CHECK(photograph->pixels.rgb == std::vector<std::uint8_t>(300, static_cast<std::uint8_t>(order[i])));
  }
}

TEST_CASE("an error of the background thread reaches who asks for the photograph", "[photographs]") {
  std::atomic<int> calls = 0;
  tg::PhotographStore store(2, 0, [&](std::size_t) -> tg::Photograph {
    ++calls;
    throw tg::Error(tg::ErrorKind::badData, "a.png", "broken");
  });
  store.prefetch(1);
  waitUntil(calls, 1);
  CHECK_THROWS_WITH(store.get(1), Contains("a.png: broken"));
  CHECK_THROWS_AS(store.get(0), tg::Error);
}

TEST_CASE("straight alpha is composited late as it is early, in 8 bit", "[photographs]") {
  const tg::TemporaryFolder folder;
  tg::Image image(16, 16, 4);
  tg::Random random(3);
  for (float& value : image.data) value = static_cast<float>(random.below(256)) / 255.0f;
  tg::writeImage(folder / "a.png", image);
  for (const glm::vec3 background : {glm::vec3(1.0f), glm::vec3(0.0f), glm::vec3(0.2f, 0.7f, 1.0f / 3)}) {
    const tg::Photograph early = tg::decodePhotograph({folder / "a.png", {}, 1, background});
    CHECK(early.alpha.empty());
    const auto late =
        std::make_shared<const tg::Photograph>(tg::decodePhotograph({folder / "a.png", {}, 1, std::nullopt}));
    CHECK(late->alpha.size() == 256);
    CHECK(tg::compositeOver(late, background)->rgb == early.pixels.rgb);
  }
  tg::writeImage(folder / "b.png", tg::Image(4, 4, 3, 0.6f));
  const auto opaque =
      std::make_shared<const tg::Photograph>(tg::decodePhotograph({folder / "b.png", {}, 1, std::nullopt}));
  CHECK(opaque->alpha.empty());
  CHECK(tg::compositeOver(opaque, glm::vec3(0.0f)).get() == &opaque->pixels);
}

TEST_CASE("an EXR's numbers are limited before pixels are mixed", "[photographs]") {
  const tg::TemporaryFolder folder;
  tg::Image image(4, 2, 3, 0.0f);
  for (int c = 0; c < 3; ++c) {
    image.at(0, 0, c) = 8.0f;
    image.at(2, 0, c) = std::numeric_limits<float>::quiet_NaN();
    image.at(3, 0, c) = image.at(2, 1, c) = image.at(3, 1, c) = 1.0f;
  }
  tg::writeImage(folder / "a.exr", image);
  const tg::Photograph half = tg::decodePhotograph({folder / "a.exr", {}, 2, glm::vec3(0.0f)});
  CHECK(half.pixels.rgb == std::vector<std::uint8_t>{64, 64, 64, 191, 191, 191});
}

TEST_CASE("a mask hides where it is zero, a downscaled pixel counts when its whole box does", "[photographs]") {
  const tg::TemporaryFolder folder;
  tg::writeImage(folder / "a.png", tg::Image(9, 6, 3, 0.5f));
  tg::Image mask(9, 6, 1, 1.0f / 255.0f);  // 1 of 255 counts, as in label images
  mask.at(2, 3, 0) = 0;
  tg::writeImage(folder / "mask.png", mask);
  const std::vector<std::uint8_t> full =
      tg::decodePhotograph({folder / "a.png", folder / "mask.png", 1, glm::vec3(0.0f)}).pixels.mask;
  REQUIRE(full.size() == 54);
  for (std::size_t i = 0; i < 54; ++i) CHECK((full[i] == 0) == (i == 3 * 9 + 2));
  const tg::Photograph half = tg::decodePhotograph({folder / "a.png", folder / "mask.png", 2, glm::vec3(0.0f)});
  REQUIRE(half.pixels.width == 4);
  REQUIRE(half.pixels.mask.size() == 12);
  for (std::size_t i = 0; i < 12; ++i) CHECK((half.pixels.mask[i] == 0) == (i == 1 * 4 + 1));

  SECTION("a mask of twice the size is reduced") {
    tg::Image large(18, 13, 3, 1.0f);
    for (int c = 0; c < 3; ++c) large.at(17, 0, c) = 0;
    tg::writeImage(folder / "large.png", large);
    const auto pixels = tg::decodePhotograph({folder / "a.png", folder / "large.png", 1, glm::vec3(0.0f)}).pixels;
    CHECK(pixels.mask[8] == 0);
    CHECK(std::count(pixels.mask.begin(), pixels.mask.end(), 0) == 1);
  }
  SECTION("or says what is background, which counts") {
    const glm::vec3 white(1.0f);
    const tg::PhotographSource source{.image = folder / "a.png",
                                      .mask = folder / "mask.png",
                                      .background = white,
                                      .mask_meaning = tg::MaskMeaning::background};
    const tg::ViewPixels cut = tg::decodePhotograph(source).pixels;
    CHECK(cut.mask.empty());
    for (std::size_t i = 0; i < 54; ++i) CHECK(cut.rgb[3 * i] == (i == 3 * 9 + 2 ? 255 : 128));
    tg::PhotographSource halves = source;
    halves.downscale = 2;
    const tg::ViewPixels mixed = tg::decodePhotograph(halves).pixels;
    for (std::size_t i = 0; i < 12; ++i) CHECK(mixed.rgb[3 * i] == (i == 1 * 4 + 1 ? 160 : 128));
    halves.background.reset();
    CHECK(tg::decodePhotograph(halves).alpha.at(5) == 191);
  }
  SECTION("other sizes, and masks that hide everything, are refused") {
    tg::writeImage(folder / "small.png", tg::Image(8, 6, 1, 1.0f));
    CHECK_THROWS_WITH(tg::decodePhotograph({folder / "a.png", folder / "small.png", 1, glm::vec3(0.0f)}),
                      Contains("small.png: mask and image differ in size (expected 9 x 6 or an enlargement") &&
                          Contains("found 8 x 6"));
    tg::writeImage(folder / "none.png", tg::Image(9, 6, 1, 0.0f));
    CHECK_THROWS_WITH(tg::decodePhotograph({folder / "a.png", folder / "none.png", 1, glm::vec3(0.0f)}),
                      Contains("none.png: the mask hides every pixel"));
  }
}

TEST_CASE("a mask fits what its photograph was reduced to whichever side is longer", "[photographs]") {
  const tg::TemporaryFolder folder;
  const auto fits = [&](int width, int height, int mask_width, int mask_height) {
    tg::writeImage(folder / "a.png", tg::Image(width, height, 3, 0.5f));
    tg::writeImage(folder / "mask.png", tg::Image(mask_width, mask_height, 1, 1.0f));
    try {
      return tg::decodePhotograph({folder / "a.png", folder / "mask.png", 1, glm::vec3(0.0f)}).pixels.width == width;
    } catch (const tg::Error&) {
      return false;
    }
  };
  // The shorter side was rounded from 6.5.
  CHECK(fits(7, 24, 13, 48));
  CHECK(fits(24, 7, 48, 13));
  CHECK_FALSE(fits(7, 24, 11, 48));
  CHECK_FALSE(fits(24, 7, 48, 11));
}

TEST_CASE("training gives the same model whether photographs are kept or streamed", "[photographs]") {
  const tg::TemporaryFolder folder;
  tg::writeSample(folder / "scene", {.size = 24, .train_views = 6, .test_views = 1, .points = 80, .supersampling = 1},
                  false);
  tg::TrainSettings settings;
  settings.iterations = 30;
  settings.texture_iterations = 10;
  std::vector<tg::GaussianModel> models;
  for (const bool random_background : {false, true}) {
    for (const std::uint64_t memory : {std::uint64_t{1} << 30, std::uint64_t{9000}, std::uint64_t{0}}) {
      tg::DatasetOptions options;
      options.image_memory = memory;
      options.random_background = random_background;
      const tg::Dataset dataset = tg::loadDataset(folder / "scene", options);
      CHECK((dataset.photographs->keptViews() == 7) == (memory > 9000));
      const auto renderer = tg::makeCpuDifferentiableRenderer();
      models.push_back(tg::train(dataset, settings, *renderer).model);
    }
  }
  for (const std::size_t i : {1, 2, 4, 5}) {
    const tg::GaussianModel& kept = models[i - i % 3];
    CHECK(models[i].mean == kept.mean);
    CHECK(models[i].sh == kept.sh);
    CHECK(models[i].atlas.texels == kept.atlas.texels);
  }
  CHECK(models[0].sh != models[3].sh);  // random backgrounds are another training
}
