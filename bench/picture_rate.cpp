// SPDX-License-Identifier: Apache-2.0
// The loop of each SIMD target on made-up splats.
#include "picture_rate.h"

#include <algorithm>
#include <ctime>
#include <thread>
#include <vector>

#include "core/system/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "picture_rate.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "render/cpu/pages.h"
#include "render/cpu/picture-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {

// What a thread works on.
struct Bench {
  HitBatch batch;
  TileState state;
};

// Calls of blendBatch on a batch of wide, faint splats: every pixel of the tile stays alive. textured: with 4 x 4
// texels of which the tile shows about nine cells. Returns pixel-splats.
double runBatches(int rounds, bool textured) {
  thread_local Bench bench;
  HitBatch& batch = bench.batch;
  TileState& state = bench.state;
  for (std::uint32_t& live : state.live) live = ~0u;
  for (PixelBlock& block : state.blocks) {
    hn::Store(set(1.0f), df, block.transmittance);
    for (float* color : block.color) hn::Store(hn::Zero(df), df, color);
  }
  PictureSplat s{};
  s.w_xx = s.w_yy = 0.01f;
  s.d_x1 = 1.0f;
  s.log2_opacity = -7.0f;
  s.base = glm::vec3(0.5f);
  s.y1 = kTileHeight;
  glm::vec4 texels[16];
  for (int i = 0; i < 16; ++i) texels[i] = glm::vec4(0.01f * static_cast<float>(i), 0.1f, -0.1f, 0.9f);
  PictureHit hit{};
  hit.wx.y = hit.wy.x = 0.1f;
  hit.d0.z = 1.0f;
  hit.near = -1.0f;
  hit.texture_width = hit.texture_height = 4;
  batch.count = 0;
  for (int slot = 0; slot < kBatch; ++slot) {
    s.center_x = s.center_y = static_cast<float>(slot);
    addSplat(s, slot, 0, 0, state, batch);
    batch.splats[slot] = &s;
    batch.hits[slot] = textured ? &hit : nullptr;
    batch.ends[slot] = batch.count;
  }
  View view;
  view.texture_rgb = view.texture_alpha = true;
  const TileView tile{view, {texels, nullptr}, 0, 0};
  for (int round = 0; round < rounds; ++round) blendBatch(batch, kBatch, tile, state.blocks);
  return static_cast<double>(rounds) * batch.count * kLanes;
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::cpu {
HWY_EXPORT(runBatches);
namespace {
double runBatchesOnce(int rounds, bool textured) { return HWY_DYNAMIC_DISPATCH(runBatches)(rounds, textured); }
}  // namespace
}  // namespace tg::cpu

namespace tg {
namespace {

double processorSeconds(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Pixel-splats a second of many short runs: a run takes below a millisecond, between two interruptions.
std::vector<double> peakRuns(bool textured) {
  constexpr int kRounds = 50, kRuns = 400;
  std::vector<double> rates;
  for (int run = 0; run < kRuns; ++run) {
    const double start = processorSeconds(CLOCK_THREAD_CPUTIME_ID);
    const double done = cpu::runBatchesOnce(kRounds, textured);
    rates.push_back(done / (processorSeconds(CLOCK_THREAD_CPUTIME_ID) - start));
  }
  return rates;
}

}  // namespace

double picturePeak(bool textured) { return std::ranges::max(peakRuns(textured)); }

double picturePeakTogether(bool textured) {
  std::vector<std::vector<double>> rates(static_cast<std::size_t>(threadCount()));
  std::vector<std::thread> threads;
  for (std::vector<double>& of_thread : rates) {
    threads.emplace_back([&of_thread, textured] { of_thread = peakRuns(textured); });
  }
  for (std::thread& thread : threads) thread.join();
  std::vector<double> all;
  for (const std::vector<double>& of_thread : rates) all.insert(all.end(), of_thread.begin(), of_thread.end());
  const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
  std::nth_element(all.begin(), middle, all.end());
  return *middle;
}

PictureRate pictureRate(const GaussianModel& model, const Camera& camera, const RenderSettings& settings, int frames) {
  const cpu::View view = cpu::makeView(model, camera, settings);
  cpu::enlargePages(model.atlas.texels.data(), model.atlas.texels.size() * sizeof(glm::vec4));  // as the renderer does
  Frame frame(camera.size.x, camera.size.y, settings.outputs);
  cpu::PictureScene scene;
  std::vector<double> seconds;
  for (int i = 0; i < frames; ++i) {
    cpu::projectPicture(view, model, scene);
    cpu::listPicture(scene);
    const double start = processorSeconds(CLOCK_PROCESS_CPUTIME_ID);
    cpu::blendPicture(view, scene, {model.atlas.texels.data(), nullptr}, frame);
    seconds.push_back(processorSeconds(CLOCK_PROCESS_CPUTIME_ID) - start);
  }
  std::nth_element(seconds.begin(), seconds.begin() + frames / 2, seconds.end());
  return {static_cast<double>(scene.pixel_splats), seconds[static_cast<std::size_t>(frames / 2)]};
}

}  // namespace tg
#endif
