// SPDX-License-Identifier: Apache-2.0
// Photographs that are sent beside the kernels: same bytes as those that stay.
#include <algorithm>
#include <atomic>
#include <stdexcept>

#include "core/system/error.h"
#include "support/catch.h"
#include "support/cuda_orders.h"
#include "training/cuda/memory.h"
#include "training/cuda/photographs.h"
#include "training/cuda/renderer.h"
#include "training/cuda/upload.h"
#include "training/run/trainer.h"
#include "training/sample_dataset.h"

using namespace tg;

namespace {

std::vector<std::uint8_t> downloadBytes(const std::uint8_t* from, std::size_t bytes) {
  std::vector<std::uint8_t> to(bytes);
  cuda::copyToHost(to.data(), from, bytes);
  return to;
}

std::shared_ptr<const ViewPixels> pixels(std::uint8_t value, bool masked) {
  auto result = std::make_shared<ViewPixels>();
  result->width = 5;
  result->height = 3;
  for (std::uint8_t i = 0; i < 45; ++i) result->rgb.push_back(static_cast<std::uint8_t>(value + i));
  if (masked) result->mask = {255, 0, 255, 255, 0, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255};
  return result;
}

Dataset smallDataset() {
  return test::sampleDataset({.size = 20, .train_views = 3, .test_views = 1, .points = 50, .supersampling = 1});
}
TrainSettings shortRun() {
  TrainSettings settings;
  settings.iterations = 7;
  settings.texture_iterations = 7;
  settings.filter_3d = true;
  settings.densification = Densification::none;
  return settings;
}

}  // namespace

TEST_CASE("a streamed buffer holds what was begun, as often as it is filled") {
  cuda::StreamedBuffer buffer;
  for (std::uint8_t turn = 1; turn < 6; ++turn) {
    std::vector<std::uint8_t> first(1000 * turn, turn), second(turn % 2 ? 77 : 0, 200);
    buffer.begin(first, second);
    std::fill(first.begin(), first.end(), 0);  // ours again
    buffer.acquire();
    const std::vector<std::uint8_t> found = downloadBytes(buffer.data(), first.size() + second.size());
    buffer.release();
    CHECK(std::all_of(found.begin(), found.begin() + 1000 * turn, [&](std::uint8_t v) { return v == turn; }));
    CHECK(std::all_of(found.begin() + 1000 * turn, found.end(), [](std::uint8_t v) { return v == 200; }));
  }
}

TEST_CASE("a photograph on the device is the one asked for, with its mask", "[checked]") {
  cuda::DevicePhotographs photographs;
  for (std::uint8_t turn = 0; turn < 7; ++turn) {
    const auto asked = pixels(static_cast<std::uint8_t>(20 * turn), turn % 3 == 1);
    const auto found = photographs.get(0, asked, true);
    CHECK(downloadBytes(found.rgb, 45) == asked->rgb);
    CHECK((found.mask != nullptr) == !asked->mask.empty());
    if (found.mask) CHECK(downloadBytes(found.mask, 15) == asked->mask);
    CHECK(found.counted == (asked->mask.empty() ? 45 : 39));
    photographs.release();
  }
}

TEST_CASE("a CUDA run over random backgrounds ends where the CPU's does") {
  Dataset dataset = smallDataset();
  dataset.random_background = true;
  const auto cpu = makeCpuDifferentiableRenderer();
  const auto cuda = makeCudaDifferentiableRenderer();
  const TrainResult expected = train(dataset, shortRun(), *cpu);
  const TrainResult found = train(dataset, shortRun(), *cuda);
  REQUIRE(found.report.textured);
  CHECK(found.report.textured->loss == Approx(expected.report.textured->loss).epsilon(1e-3));
}

TEST_CASE("photographs that stay on the device are decoded for their first step alone") {
  const Dataset whole = smallDataset();
  Dataset decoding = whole;
  std::atomic<int> decoded = 0;
  decoding.photographs = std::make_shared<PhotographStore>(whole.views.size(), 0, [&](std::size_t view) {
    decoded += !whole.views[view].test;
    return *whole.photographs->get(view);
  });
  const auto renderer = makeCudaDifferentiableRenderer();
  const TrainResult expected = train(whole, shortRun(), *renderer);
  const TrainResult found = train(decoding, shortRun(), *renderer);
  CHECK(found.model == expected.model);
  CHECK(decoded >= 3);
  CHECK(decoded <= 4);  // once more where a view's first step is followed by its second
#ifndef TG_CUDA_ON_DEVICE
  decoded = 0;
  cuda::setFreeMemory((std::size_t{1} << 28) + 2000);  // the quarter, and nothing for a photograph
  const TrainResult streamed = train(decoding, shortRun(), *renderer);
  cuda::setFreeMemory(std::size_t{1} << 30);
  CHECK(streamed.model == expected.model);
  CHECK(decoded >= 14);
#endif
}

#ifndef TG_CUDA_ON_DEVICE
TEST_CASE("photographs that do not fit on the device are streamed to the same bytes") {
  const Dataset dataset = smallDataset();
  const auto renderer = makeCudaDifferentiableRenderer();
  const TrainResult kept = train(dataset, shortRun(), *renderer);
  cuda::setFreeMemory((std::size_t{1} << 28) + 2000);  // the quarter, and nothing for a photograph
  const TrainResult streamed = train(dataset, shortRun(), *renderer);
  cuda::setFreeMemory(std::size_t{1} << 30);
  CHECK(streamed.model == kept.model);
}

TEST_CASE("the host's streamed buffer finds turns that are left out", "[checked]") {
  const std::vector<std::uint8_t> bytes(10, 1);
  cuda::StreamedBuffer buffer;
  CHECK_THROWS_AS(buffer.acquire(), std::logic_error);
  buffer.begin(bytes, {});
#ifdef TG_CUDA_CHECK
  CHECK_THROWS_AS(downloadBytes(buffer.data(), 10), std::logic_error);  // not there before acquire()
#else
  CHECK(downloadBytes(buffer.data(), 10) != bytes);
#endif
  CHECK_THROWS_AS(buffer.begin(bytes, {}), std::logic_error);
  buffer.acquire();
  CHECK_THROWS_AS(buffer.begin(bytes, {}), std::logic_error);  // kernels still read it
}
#endif
