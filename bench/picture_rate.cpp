// SPDX-License-Identifier: Apache-2.0
#include "picture_rate.h"

#include <algorithm>
#include <ctime>
#include <vector>

// Structs hold vectors here, which the scalable targets forbid.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "picture_rate.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "render/cpu/picture-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {

// Calls of blendBatch on a batch of wide, faint splats: every pixel of the tile stays alive. Returns pixel-splats.
double runBatches(int rounds) {
  static Batch batch;
  static TileState state;
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
  batch.count = 0;
  for (int slot = 0; slot < kBatch; ++slot) {
    s.center_x = s.center_y = static_cast<float>(slot);
    addSplat(s, slot, 0, 0, state, batch);
    batch.splats[slot] = &s;
    batch.hits[slot] = nullptr;
    batch.ends[slot] = batch.count;
  }
  for (int round = 0; round < rounds; ++round) blendBatch(batch, kBatch, 0, 0, state.blocks);
  return static_cast<double>(rounds) * batch.count * kLanes;
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::cpu {
HWY_EXPORT(runBatches);
namespace {
double runBatchesOnce(int rounds) { return HWY_DYNAMIC_DISPATCH(runBatches)(rounds); }
}  // namespace
}  // namespace tg::cpu

namespace tg {
namespace {

double processorSeconds(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

double picturePeak() {
  constexpr int kRounds = 200, kRuns = 200;  // a run takes about a millisecond: between two interruptions
  double best = 0;
  for (int run = 0; run < kRuns; ++run) {
    const double start = processorSeconds(CLOCK_THREAD_CPUTIME_ID);
    const double done = cpu::runBatchesOnce(kRounds);
    best = std::max(best, done / (processorSeconds(CLOCK_THREAD_CPUTIME_ID) - start));
  }
  return best;
}

PictureRate pictureRate(const GaussianModel& model, const Camera& camera, const RenderSettings& settings, int frames) {
  const cpu::View view = cpu::makeView(model, camera, settings);
  Frame frame(camera.width, camera.height, settings.outputs);
  cpu::PictureScene scene;
  std::vector<double> seconds;
  for (int i = 0; i < frames; ++i) {
    cpu::projectPicture(view, model, scene);
    cpu::listPicture(scene);
    const double start = processorSeconds(CLOCK_PROCESS_CPUTIME_ID);
    cpu::blendPicture(view, scene, frame);
    seconds.push_back(processorSeconds(CLOCK_PROCESS_CPUTIME_ID) - start);
  }
  std::nth_element(seconds.begin(), seconds.begin() + frames / 2, seconds.end());
  return {static_cast<double>(scene.pixel_splats), seconds[static_cast<std::size_t>(frames / 2)]};
}

}  // namespace tg
#endif
