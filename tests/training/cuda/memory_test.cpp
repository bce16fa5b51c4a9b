// SPDX-License-Identifier: Apache-2.0
// What a CUDA run holds on the device: its bytes by arithmetic are those that it allocates, and which of the sizes that
// people train stay within the bar, 1.2 times parameters, optimiser and images, and 1 GB.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <memory>

#include "cuda_host.h"
#include "support/catch.h"
#include "support/same.h"
#include "support/scenes.h"
#include "training/cuda/engine.h"
#include "training/cuda/frame.h"
#include "training/cuda/step.h"
#include "training/step/engine.h"

using namespace tg;

namespace {

using Bytes = std::uint64_t;

struct Sizes {
  Bytes gaussians, sh_count, texels, largest_rect, pairs, width, height, images;
  bool statistics = true, filtered = false;
  cuda::StepParts parts = {};

  Bytes floats() const { return gaussians * gaussianFloats(sh_count); }
  Bytes pixels() const { return width * height; }
};

// [bytes]
struct Footprint {
  Bytes model, moments, images;                         // what any trainer needs
  Bytes gradient, texel_sums, splats, pairs, pictures;  // what a step works on

  Bytes needed() const { return model + moments + images; }
  Bytes sum() const { return needed() + gradient + texel_sums + splats + pairs + pictures; }
  double bar() const { return 1.2 * static_cast<double>(needed()) + 1e9; }
};

Footprint footprint(const Sizes& s) {
  const bool textured = s.texels > 0;
  const Bytes tiles = ((s.width + 15) / 16) * ((s.height + 15) / 16);
  const Bytes room = cuda::roomFor(s.pairs);
  Footprint f{};
  f.model = 4 * s.floats() + 16 * s.texels + (textured ? sizeof(TextureRect) * s.gaussians : 0);
  f.moments = 8 * s.floats() + 32 * s.texels;
  f.images = s.images * 3 * s.pixels();
  f.gradient = 4 * std::min<Bytes>(s.gaussians, s.parts.gaussians) * gaussianFloats(s.sh_count);
  // In ranges of depths: sums, what a pixel knows between two, where they begin in the order, in lists and in pairs.
  const Bytes ranges = (s.texels + s.parts.texels - 1) / s.parts.texels;
  f.texel_sums = 32 * s.texels;
  if (ranges > 1) {
    f.texel_sums = 32 * (s.parts.texels + s.largest_rect) + 4 * s.pixels() + 4 * (ranges + 1) * (tiles + 2);
  }
  // Statistics, 3D filter; splats with what places them; depth order; screen gradients.
  f.splats = s.gaussians * (16 + (s.filtered ? 20 : 0) + sizeof(cuda::BlendSplat) +
                            (textured ? sizeof(cuda::LocalFrame) : 0) + 36 + 24 + 8);
  f.pairs = room * (8 + 4 * cuda::pairSums(textured, s.statistics) + 1) + 4 * (tiles + 1) + sizeof(cuda::PairCount);
  // Picture and its gradient, transmittance and end, SSIM's derivatives; sums of the loss; what 32 steps leave.
  f.pictures = s.pixels() * (12 + 12 + 8 + 36) + 8 * (9 * tiles + 3) + 32 * sizeof(cuda::StepRecord) + 4;
  return f;
}

// While a round makes `after` Gaussians of fewer: what stays of a step's memory, the round's scratch, and the largest
// array of rows twice.
Bytes roundPeak(const Sizes& before, Bytes after) {
  Sizes larger = before;
  larger.gaussians = after;
  const Footprint f = footprint(larger);
  const Bytes n = before.gaussians;
  const Bytes scratch = 4 * (3 * n + 1) + 24 * (n + 1) + 12 * n + 4 * after;
  return f.needed() + n * (16 + (before.filtered ? 20 : 0)) + scratch + 12 * before.sh_count * n + f.pictures -
         20 * before.pixels();
}
// Statistics, whose buffers grow by a quarter more than they must, after a round.
Bytes spare(Bytes gaussians) { return 16 * (gaussians / 4); }

GaussianModel cloud(int gaussians, int texels, unsigned seed) {
  GaussianModel model = test::trainedLikeModel(seed, gaussians);
  if (texels == 0) {
    model.texture_mode = TextureMode::none;
    model.atlas = {};
  } else {
    model.atlas = makeUniformAtlas(model.size(), texels, texels);
  }
  return model;
}

// Rectangles of 0 to 5 texels a side; some have none.
void differSizes(GaussianModel& model) {
  Random random(3);
  std::uint32_t texels = 0;
  for (TextureRect& rect : model.atlas.rects) {
    rect = {texels, static_cast<std::uint16_t>(random.below(6)), static_cast<std::uint16_t>(random.below(6))};
    texels += rect.texelCount();
  }
  model.atlas.texels.resize(texels);
}

Sizes sizesOf(const GaussianModel& model, const Camera& camera) {
  Sizes sizes{model.size(),
              static_cast<Bytes>(model.shCount()),
              model.atlas.texels.size(),
              0,
              cuda::countPairs(model, camera),
              static_cast<Bytes>(camera.size.x),
              static_cast<Bytes>(camera.size.y),
              1};
  for (const TextureRect& rect : model.atlas.rects) {
    sizes.largest_rect = std::max<Bytes>(sizes.largest_rect, rect.texelCount());
  }
  return sizes;
}

struct Steps {
  std::size_t first_bytes, second_bytes;  // on the device
  RunState state;
  // With a round of densification and a third step after these.
  std::size_t gaussians, round_peak, third_bytes;
};
enum class Round { none, adc };
Steps twoSteps(const GaussianModel& model, const Camera& camera, const Sizes& sizes, Round round = Round::none) {
  const std::size_t before = cuda::allocatedBytes();
  const auto engine = cuda::makeTrainingEngine(0.2f, sizes.parts);
  Steps steps{};
  RunState& state = steps.state;
  state.training.model = model;
  resetMoments(state.training);
  state.statistics.reset(model.size());
  if (sizes.filtered) state.min_sigma.assign(model.size(), 1e-3f);
  auto photograph = std::make_shared<ViewPixels>();
  photograph->width = camera.size.x;
  photograph->height = camera.size.y;
  photograph->rgb.assign(3 * sizes.pixels(), 100);
  StepInput input{{.view = 0,
                   .background = glm::vec3(0.0f),
                   .background_varies = false,
                   .iteration = 1,
                   .gradient = {.statistics = sizes.statistics},
                   .gather_statistics = sizes.statistics,
                   .rates = {.mean = 1e-3f,
                             .rotation = 1e-3f,
                             .log_scale = 5e-3f,
                             .opacity_logit = 0.05f,
                             .sh = {2e-3f, 1e-4f},
                             .texels = 2e-3f},
                   .mcmc = false,
                   .opacity_weight = 0,
                   .scale_weight = 0,
                   .noise = 0,
                   .noise_seed = 0,
                   .clamp_colors = false},
                  camera,
                  photograph};
  engine->step(state, input);
  steps.first_bytes = cuda::allocatedBytes() - before;
  input.iteration = 2;
  engine->step(state, input);
  engine->losses(state, true);
  steps.second_bytes = cuda::allocatedBytes() - before;
  if (round == Round::adc) {
    cuda::takePeakBytes();
    // Of those that grow, the first come by score: sorted, as by magnitudes.
    engine->densify(state, {.extent = 1, .score_threshold = 1e-9f, .max_gaussians = sizes.gaussians + 20});
    steps.round_peak = cuda::takePeakBytes() - before;
    steps.gaussians = engine->gaussians(state);
    input.iteration = 3;
    engine->step(state, input);
    engine->losses(state, true);
    steps.third_bytes = cuda::allocatedBytes() - before;
  }
  engine->pull(state);
  return steps;
}

}  // namespace

TEST_CASE("a CUDA step allocates what the arithmetic says") {
  const int texels = GENERATE(0, 3);
  const bool filtered = GENERATE(false, true);
  const Camera camera = test::trainedLikeCamera(72, 40);
  const GaussianModel model = cloud(400, texels, 2);
  Sizes sizes = sizesOf(model, camera);
  sizes.statistics = texels == 0;
  sizes.filtered = filtered;
  REQUIRE(sizes.pairs > 256);  // else the first picture's room is enough
  INFO(texels << " texels a side, 3D filter " << filtered);
  const Steps steps = twoSteps(model, camera, sizes);
  CHECK(steps.first_bytes == footprint(sizes).sum());
  CHECK(steps.second_bytes == steps.first_bytes);
}

TEST_CASE("CUDA's rounds of densification hold what the arithmetic says, and leave a step what it needs") {
  // Most lie outside: a round holds more than a step.
  Camera camera = test::trainedLikeCamera(32, 16);
  camera.translation.x += 5;
  const GaussianModel model = cloud(1500, 0, 2);
  Sizes sizes = sizesOf(model, camera);
  sizes.parts.gaussians = 100;
  REQUIRE(sizes.pairs > 256);
  REQUIRE(sizes.pairs < 500);
  const Steps steps = twoSteps(model, camera, sizes, Round::adc);
  REQUIRE(steps.gaussians == 1520);
  CHECK(steps.second_bytes == footprint(sizes).sum());
  CHECK(steps.round_peak > steps.second_bytes);
  CHECK(steps.round_peak == roundPeak(sizes, steps.gaussians));
  sizes.gaussians = steps.gaussians;  // the room for pairs is as before
  CHECK(steps.third_bytes == footprint(sizes).sum() + spare(steps.gaussians));
}

TEST_CASE("CUDA's steps work in parts and ranges of depths to the same bytes", "[checked]") {
  struct Case {
    const char* what;
    TextureMode mode;
    bool uniform, statistics, filtered;
    IntersectionModel intersection;
  };
  constexpr auto kPlane = IntersectionModel::plane, kMaxResponse = IntersectionModel::maxResponse;
  const Case& c = GENERATE(Case{"plain", TextureMode::none, true, true, false, kPlane},
                           Case{"rgba", TextureMode::rgba, true, false, false, kMaxResponse},
                           Case{"rgba, sizes differ", TextureMode::rgba, false, true, false, kPlane},
                           Case{"rgb, 3D filter", TextureMode::rgb, false, false, true, kMaxResponse},
                           Case{"alpha, 3D filter", TextureMode::alpha, true, false, true, kPlane});
  INFO(c.what);
  const bool textured = c.mode != TextureMode::none;
  const Camera camera = test::trainedLikeCamera(40, 24);
  GaussianModel model = cloud(200, textured ? 3 : 0, 2);
  model.texture_mode = c.mode;
  model.intersection = c.intersection;
  if (!c.uniform) differSizes(model);
  Random random(5);
  for (glm::vec4& texel : model.atlas.texels) {
    for (int k = 0; k < 4; ++k) texel[k] = static_cast<float>(random.uniform()) - (k < 3 ? 0.5f : -0.2f);
  }
  Sizes sizes = sizesOf(model, camera);
  sizes.statistics = c.statistics;
  sizes.filtered = c.filtered;
  REQUIRE(sizes.pairs > 256);
  const Steps whole = twoSteps(model, camera, sizes);
  CHECK(whole.first_bytes == footprint(sizes).sum());
  sizes.parts.gaussians = 70;
  const TrainingState& a = whole.state.training;
  CHECK(a.model.mean != model.mean);
  CHECK((a.model.atlas.texels != model.atlas.texels) == textured);
  for (const std::size_t texels : {std::size_t{900}, std::size_t{100}}) {
    sizes.parts.texels = texels;
    INFO(texels << " of " << sizes.texels << " texels at a time");
    const Steps parts = twoSteps(model, camera, sizes);
    CHECK(parts.first_bytes == footprint(sizes).sum());
    CHECK(parts.first_bytes < whole.first_bytes);
    const TrainingState& b = parts.state.training;
    test::checkSame(a.model, b.model);
    test::checkSame(a.moments, b.moments);
    CHECK(whole.state.statistics.score_sum == parts.state.statistics.score_sum);
    CHECK(whole.state.statistics.magnitude_sum == parts.state.statistics.magnitude_sum);
  }
}

namespace {

// SH degree 3, 200 photographs; pairs as train_bench's scene has them.
struct Setting {
  Bytes width, height, gaussians, texels_a_side, pairs;

  Sizes sizes() const {
    const Bytes texels = gaussians * texels_a_side * texels_a_side;
    return {gaussians, 16, texels, texels_a_side * texels_a_side, pairs, width, height, 200, texels_a_side == 0};
  }
  Footprint footprint() const { return ::footprint(sizes()); }
  // cub's sort moves keys and values to and fro.
  Bytes sort() const { return 8 * std::max<Bytes>(cuda::roomFor(pairs), gaussians); }
  Bytes fixed() const { return footprint().sum() + sort(); }
  // Where the set changes, which is without textures: the larger of a step and a round.
  Bytes densified() const {
    if (texels_a_side > 0) return fixed();
    return std::max(fixed() + spare(gaussians), roundPeak(sizes(), gaussians) + spare(gaussians) + 8 * gaussians);
  }
};
constexpr Setting kSettings[] = {
    {800, 800, 100'000, 0, 560'000},     {800, 800, 100'000, 4, 560'000},       {800, 800, 500'000, 0, 1'370'000},
    {800, 800, 500'000, 4, 1'370'000},   {800, 800, 2'000'000, 0, 3'610'000},   {800, 800, 2'000'000, 4, 3'610'000},
    {1600, 1064, 100'000, 0, 980'000},   {1600, 1064, 100'000, 4, 980'000},     {1600, 1064, 500'000, 0, 2'040'000},
    {1600, 1064, 500'000, 4, 2'040'000}, {1600, 1064, 2'000'000, 0, 4'770'000}, {1600, 1064, 2'000'000, 4, 4'770'000},
};

}  // namespace

TEST_CASE("a CUDA run stays within 1.2 times parameters, optimiser and images, and 1 GB") {
  for (const Setting& s : kSettings) {
    INFO(s.width << " x " << s.height << ", " << s.gaussians << " Gaussians, " << s.texels_a_side << " texels a side");
    CHECK(static_cast<double>(s.fixed()) <= s.footprint().bar());
    CHECK(static_cast<double>(s.densified()) <= s.footprint().bar());
  }
}

// Hidden: it asserts nothing, it prints the rows of the table in docs/lab/cuda.md: `build/bin/training_cuda_test
// '[memory]'`.
TEST_CASE("CUDA's device memory in MB", "[.][memory]") {
  for (const Setting& s : kSettings) {
    const Footprint f = s.footprint();
    const auto mb = [](Bytes bytes) { return (bytes + 500'000) / 1'000'000; };
    const auto over = [&](Bytes bytes) { return static_cast<double>(bytes) > f.bar() ? "**" : ""; };
    std::printf("| %llu x %llu | %lluk | %s | %.2f M |", static_cast<unsigned long long>(s.width),
                static_cast<unsigned long long>(s.height), static_cast<unsigned long long>(s.gaussians / 1000),
                s.texels_a_side > 0 ? "4 x 4" : "none", static_cast<double>(s.pairs) * 1e-6);
    for (const Bytes bytes : {f.needed(), f.gradient, f.texel_sums, f.splats, f.pairs + s.sort(), f.pictures}) {
      std::printf(" %llu |", static_cast<unsigned long long>(mb(bytes)));
    }
    for (const Bytes bytes : {s.fixed(), s.densified()}) {
      std::printf(" %s%llu%s |", over(bytes), static_cast<unsigned long long>(mb(bytes)), over(bytes));
    }
    std::printf(" %.0f |\n", f.bar() * 1e-6);
  }
}
