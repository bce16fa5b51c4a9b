// SPDX-License-Identifier: Apache-2.0
// CUDA's loss, Adam, 3D filter, regularisers, noise and statistics against the CPU's.
#include <algorithm>
#include <cstring>

#include "support/catch.h"
#include "support/cuda_orders.h"
#include "support/scenes.h"
#include "training/cuda/frame.h"
#include "training/cuda/state.h"
#include "training/cuda/step.h"
#include "training/cuda/texels.h"
#include "training/step/filter_3d.h"
#include "training/step/loss.h"
#include "training/step/mcmc.h"
#include "training/step/optimizer.h"

using namespace tg;
using test::numbers;
using test::sameNumbers;

namespace {

struct Pictures {
  int width, height;
  std::vector<glm::vec3> picture;
  std::vector<std::uint8_t> target;
  std::vector<std::uint8_t> mask;
};
Pictures randomPictures(int width, int height, bool masked, std::uint64_t seed) {
  Random random(seed);
  Pictures p{width, height, {}, {}, {}};
  for (int i = 0; i < width * height; ++i) {
    const auto value = [&] { return static_cast<float>(random.uniform() * 1.2 - 0.1); };
    p.picture.emplace_back(value(), value(), value());
    for (int c = 0; c < 3; ++c) p.target.push_back(static_cast<std::uint8_t>(random.below(256)));
    if (masked) p.mask.push_back(random.uniform() < 0.3 ? 0 : 255);
  }
  return p;
}

struct DeviceLoss {
  double sums[3];
  std::vector<glm::vec3> v_picture;
};
DeviceLoss lossCuda(const Pictures& p, double counted) {
  cuda::Buffer<float> picture, v_picture;
  cuda::Buffer<std::uint8_t> target, mask;
  cuda::LossBuffers buffers;
  picture.upload(p.picture);
  target.upload(p.target);
  if (!p.mask.empty()) mask.upload(p.mask);
  v_picture.resize(3 * p.picture.size());
  cuda::evaluateLoss({p.width, p.height, 0.2f, counted, picture.data(), target.data(), mask.data()}, buffers,
                     v_picture.data());
  DeviceLoss loss;
  buffers.sums.download(loss.sums);
  loss.v_picture.resize(p.picture.size());
  v_picture.download(loss.v_picture);
  return loss;
}

// Everything of random values; a third of the Gaussians nearly transparent.
TrainingState randomState(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  const auto value = [&] { return static_cast<float>(random.normal()); };
  TrainingState state;
  GaussianModel& model = state.model;
  model.sh_degree = 1;
  for (std::size_t i = 0; i < count; ++i) {
    model.mean.emplace_back(value(), value(), value());
    model.rotation.emplace_back(value(), value(), value(), value());
    model.log_scale.emplace_back(value() - 3, value() - 3, value() - 3);
    model.opacity_logit.push_back(i % 3 == 0 ? value() - 5 : value());
    for (int k = 0; k < 4; ++k) model.sh.emplace_back(value(), value(), value());
  }
  resetMoments(state);
  return state;
}

std::vector<float> download(const cuda::Buffer<float>& from) {
  std::vector<float> to(from.size());
  from.download(to);
  return to;
}

cuda::DeviceMoments onDevice(const Moments& moments) {
  cuda::DeviceMoments device;
  device.first.upload(moments.first);
  device.second.upload(moments.second);
  return device;
}

}  // namespace

TEST_CASE("CUDA's loss and its gradient are the CPU's, with masks and at every border", "[checked]") {
  for (const auto& [width, height] : {std::pair{64, 48}, std::pair{37, 5}, std::pair{1, 1}, std::pair{16, 33}}) {
    for (const bool masked : {false, true}) {
      const Pictures p = randomPictures(width, height, masked, 3);
      INFO(width << " x " << height << (masked ? ", masked" : ""));
      std::vector<glm::vec3> v_picture(p.picture.size());
      const LossValue expected = PhotometricLoss(0.2f).evaluate(width, height, p.picture, p.target, v_picture, p.mask);
      const auto ignored = static_cast<double>(std::count(p.mask.begin(), p.mask.end(), 0));
      const double counted = 3.0 * std::max<double>(static_cast<double>(p.picture.size()) - ignored, 1.0);
      const DeviceLoss found = lossCuda(p, counted);
      CHECK(found.sums[0] / counted == Approx(expected.l1).epsilon(1e-6));
      CHECK(found.sums[1] / counted == Approx(expected.ssim).epsilon(1e-4).margin(1e-6));
      CHECK(found.sums[2] / counted == Approx(expected.mean_squared_error).epsilon(1e-6));
      float largest = 0.0f, difference = 0.0f;
      for (std::size_t i = 0; i < v_picture.size(); ++i) {
        largest = std::max(largest, glm::length(v_picture[i]));
        difference = std::max(difference, glm::length(v_picture[i] - found.v_picture[i]));
      }
      CHECK(difference <= 1e-4f * largest);
      test::inOtherOrders([&] {
        const DeviceLoss again = lossCuda(p, counted);
        CHECK(std::memcmp(again.sums, found.sums, sizeof(found.sums)) == 0);
        CHECK(again.v_picture == found.v_picture);
      });
    }
  }
}

TEST_CASE("CUDA's Adam moves parameters and moments as the CPU's does", "[checked]") {
  TrainingState state = randomState(50, 1);
  Random random(2);
  ModelGradient gradient;
  forEachField([](const Field&, auto& v, const auto& values) { v.resize(values.size()); }, gradient, state.model);
  for (glm::vec3& v : gradient.sh) v = glm::vec3(random.normal(), random.normal(), random.normal());
  cuda::Buffer<float> value, v_value;
  value.upload(state.model.sh);
  v_value.upload(gradient.sh);
  const cuda::DeviceMoments moments = onDevice(state.moments.sh);
  const LearningRates rates;
  for (int step = 1; step <= 3; ++step) {
    adamStep(state, gradient, rates);
    cuda::adamStep(
        {value.data(), v_value.data(), moments, value.size(), 12, 3, rates.sh.first, rates.sh.rest, adamScales(step)});
  }
  CHECK(sameNumbers(download(value), numbers(state.model.sh)));
  CHECK(sameNumbers(download(moments.first), numbers(state.moments.sh.first)));
  CHECK(sameNumbers(download(moments.second), numbers(state.moments.sh.second)));
}

TEST_CASE("CUDA's texels move as the CPU's do, from sums that are zero afterwards, and stay when they must",
          "[checked]") {
  const bool clamp_colors = GENERATE(false, true);
  TrainingState state = randomState(200, 6);
  state.model.texture_mode = TextureMode::rgba;
  Random random(7);
  TextureAtlas& atlas = state.model.atlas;
  for (std::size_t i = 0; i < state.model.size(); ++i) {
    const auto side = [&] { return static_cast<std::uint16_t>(random.below(7)); };
    atlas.rects.push_back({static_cast<std::uint32_t>(atlas.texels.size()), side(), side()});
    atlas.texels.resize(atlas.texels.size() + atlas.rects.back().texelCount());
  }
  ModelGradient gradient;
  forEachField([](const Field&, auto& v, const auto& values) { v.resize(values.size()); }, gradient, state.model);
  std::vector<std::uint32_t> tile_counts;
  std::vector<std::int64_t> sums;
  for (const TextureRect& rect : atlas.rects) {
    const bool drawn = random.below(3) > 0;
    tile_counts.push_back(drawn);
    for (std::uint32_t k = rect.offset; k < rect.offset + rect.texelCount(); ++k) {
      gradient.texels.emplace_back(0.0f);
      for (int c = 0; c < 4; ++c) {
        atlas.texels[k][c] = static_cast<float>(3 * random.uniform() - 1);
        sums.push_back(drawn ? static_cast<std::int64_t>(random.below(1u << 30)) - (1 << 29) : 0);
        const bool clamped = c == 3 && (atlas.texels[k].a < 0.0f || atlas.texels[k].a > 1.0f);
        if (!clamped) gradient.texels.back()[c] = static_cast<float>(sums.back()) / cuda::kTexelUnits;
      }
    }
  }
  resetMoments(state);
  for (float& first : state.moments.texels.first) first = static_cast<float>(1e-6 * random.normal());
  for (float& second : state.moments.texels.second) second = static_cast<float>(1e-12 * random.uniform());
  cuda::DeviceModel device;
  device.upload(state.model);
  const cuda::DeviceMoments moments = onDevice(state.moments.texels);
  cuda::Buffer<std::uint32_t> counts, stop;
  counts.upload(tile_counts);
  stop.upload(std::vector<std::uint32_t>{1});
  cuda::Buffer<long long> device_sums;
  LearningRates rates;
  rates.texel_decay = clamp_colors ? 0.0f : 0.3f;
  const auto move = [&](const std::uint32_t* stopped) {
    device_sums.upload(sums);
    cuda::moveTexels({device_sums.data(), counts.data(), nullptr, nullptr, nullptr},
                     {device.parameters(), moments, rates.texels, rates.texels * rates.texel_decay, adamScales(1),
                      clamp_colors, stopped});
    std::vector<std::int64_t> left;
    device_sums.downloadAll(left);
    CHECK(left == std::vector<std::int64_t>(sums.size()));
  };
  move(stop.data());
  CHECK(sameNumbers(download(device.texels), numbers(atlas.texels)));
  CHECK(download(moments.first) == state.moments.texels.first);
  move(nullptr);
  adamStep(state, gradient, rates);
  if (clamp_colors) {
    for (glm::vec4& texel : atlas.texels) texel = glm::clamp(texel, glm::vec4(0.0f), glm::vec4(1.0f));
  }
  CHECK(sameNumbers(download(device.texels), numbers(atlas.texels)));
  CHECK(sameNumbers(download(moments.first), numbers(state.moments.texels.first)));
  CHECK(sameNumbers(download(moments.second), numbers(state.moments.texels.second)));
}

TEST_CASE("a state whose textures are shared comes to the device with the moments of each group's first", "[checked]") {
  RunState run;
  run.training = randomState(6, 4);
  run.training.model.texture_mode = TextureMode::rgba;
  run.training.model.atlas = makeUniformAtlas(6, 1, 1);
  resetMoments(run.training);
  run.statistics.reset(6);
  const std::vector<std::uint32_t> groups = {0, 1, 0, 1, 1, 2};
  Moments& texels = run.training.moments.texels;
  for (const std::size_t owner : {0, 1, 5}) {  // as the CPU leaves them
    texels.first[4 * owner] = texels.second[4 * owner] = static_cast<float>(owner + 1);
  }
  cuda::DeviceState device;
  cuda::upload(run, groups, device);
  for (const auto* moments : {&device.moments.texels.first, &device.moments.texels.second}) {
    const std::vector<float> found = download(*moments);
    REQUIRE(found.size() == 12);
    CHECK(found[0] == 1);
    CHECK(found[4] == 2);
    CHECK(found[8] == 6);
  }
}

TEST_CASE("CUDA moves the textures of owners alone, whether these are drawn or not", "[checked]") {
  TrainingState state = randomState(40, 8);
  state.model.texture_mode = TextureMode::rgba;
  state.model.atlas = makeUniformAtlas(40, 3, 2);
  resetMoments(state);
  ModelGradient gradient;
  forEachField([](const Field&, auto& v, const auto& values) { v.resize(values.size()); }, gradient, state.model);
  std::vector<std::int64_t> sums;
  Random random(9);
  std::vector<std::uint32_t> owners, drawn(40, 0);
  for (std::uint32_t i = 0; i < 40; ++i) {
    const bool owns = i % 3 == 1;
    if (owns) owners.push_back(i);
    for (int texel = 0; texel < 6; ++texel) {
      gradient.texels.emplace_back(0.0f);
      for (int c = 0; c < 4; ++c) {
        sums.push_back(static_cast<std::int64_t>(random.below(1u << 30)) - (1 << 29));
        if (owns) gradient.texels.back()[c] = static_cast<float>(sums.back()) / cuda::kTexelUnits;
      }
    }
  }
  cuda::DeviceModel device;
  device.upload(state.model);
  const cuda::DeviceMoments moments = onDevice(state.moments.texels);
  cuda::Buffer<std::uint32_t> counts, moved;
  counts.upload(drawn);
  moved.upload(owners);
  cuda::Buffer<long long> device_sums;
  device_sums.upload(sums);
  const LearningRates rates;
  cuda::moveTexels(
      {device_sums.data(), counts.data(), nullptr, nullptr, nullptr},
      {device.parameters(), moments, rates.texels, 0.0f, adamScales(1), false, nullptr, moved.data(), moved.size()});
  std::vector<std::int64_t> left;
  device_sums.downloadAll(left);
  for (std::size_t k = 0; k < sums.size(); ++k) CHECK(left[k] == (k / 24 % 3 == 1 ? 0 : sums[k]));
  const GaussianModel before = state.model;
  adamStep(state, gradient, rates);
  CHECK(sameNumbers(download(device.texels), numbers(state.model.atlas.texels)));
  CHECK_FALSE(sameNumbers(download(device.texels), numbers(before.atlas.texels)));
}

TEST_CASE("CUDA's 3D filter, regularisers and exploration noise are the CPU's", "[checked]") {
  TrainingState state = randomState(300, 4);
  GaussianModel& model = state.model;
  std::vector<float> min_sigma(model.size());
  Random random(5);
  for (float& sigma : min_sigma) sigma = static_cast<float>(0.1 * random.uniform());
  ModelGradient gradient;
  for (std::size_t i = 0; i < model.size(); ++i) {
    gradient.log_scale.emplace_back(random.normal(), random.normal(), random.normal());
    gradient.opacity_logit.push_back(static_cast<float>(random.normal()));
  }
  cuda::DeviceModel device;
  device.upload(model);
  cuda::Buffer<float> sigmas, log_scale, logit, v_log_scale, v_logit;
  sigmas.upload(min_sigma);
  log_scale.resize(3 * model.size());
  logit.resize(model.size());
  v_log_scale.upload(gradient.log_scale);
  v_logit.upload(gradient.opacity_logit);

  EffectiveParameters effective;
  applyFilter(model, min_sigma, effective);
  cuda::applyFilter(device.parameters(), sigmas.data(), log_scale.data(), logit.data());
  CHECK(sameNumbers(download(log_scale), numbers(effective.log_scale)));
  CHECK(sameNumbers(download(logit), numbers(effective.opacity_logit)));

  filterGradient(model, min_sigma, gradient);
  addRegularizerGradient(model, 0.5f, 0.25f, gradient);
  cuda::Parameters v{};
  v.log_scale = v_log_scale.data();
  v.opacity_logit = v_logit.data();
  const auto count = static_cast<double>(model.size());
  cuda::chainGradients({device.parameters(), sigmas.data(), true, 0.5f / count, 0.25f / count}, v);
  CHECK(sameNumbers(download(v_log_scale), numbers(gradient.log_scale)));
  CHECK(sameNumbers(download(v_logit), numbers(gradient.opacity_logit)));

  const std::vector<glm::vec3> before = model.mean;
  addExplorationNoise(model, 100.0f, 77, 5);
  cuda::addNoise(device.parameters(), 100.0f, 77, 5);
  GaussianModel found = model;
  found.mean = before;
  device.download(found);
  CHECK(sameNumbers(numbers(found.mean), numbers(model.mean)));
  CHECK(model.mean != before);
}
