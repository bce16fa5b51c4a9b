// SPDX-License-Identifier: Apache-2.0
// CUDA's densification, opacity reset, SH growth and 3D filter, against the CPU's: the same Gaussians in the
// same order, from the same random numbers.
#include "training/cuda/density.h"

#include <array>
#include <cmath>

#include "core/model/wide_splats.h"
#include "support/catch.h"
#include "support/cuda_orders.h"
#include "support/same.h"
#include "training/step/filter_3d.h"
#include "training/step/mcmc.h"

using namespace tg;
using test::numbers;
using test::sameNumbers;

namespace {

// Everything of random values: some Gaussians nearly transparent, some wide; scores in steps, so that many are equal.
RunState randomState(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  const auto value = [&] { return static_cast<float>(random.normal()); };
  RunState state;
  GaussianModel& model = state.training.model;
  model.sh_degree = 1;
  for (std::size_t i = 0; i < count; ++i) {
    model.mean.emplace_back(value(), value(), value());
    model.rotation.emplace_back(value(), value(), value(), value());
    model.log_scale.emplace_back(value() - 4, value() - 4, value() - 4);
    model.opacity_logit.push_back(i % 5 == 0 ? value() - 6 : value());
    for (int k = 0; k < 4; ++k) model.sh.emplace_back(value(), value(), value());
  }
  resetMoments(state.training);
  forEachField(
      [&](const Field&, Moments& moments) {
        for (float& first : moments.first) first = value();
        for (float& second : moments.second) second = static_cast<float>(random.uniform());
      },
      state.training.moments);
  state.statistics.reset(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t views = random.below(4);
    state.statistics.view_count[i] = static_cast<std::uint32_t>(views);
    state.statistics.score_sum[i] = 1e-4f * static_cast<float>(views * random.below(5));
    state.statistics.magnitude_sum[i] = views > 0 ? 1e-3f * static_cast<float>(random.below(200)) : 0.0f;
    state.statistics.max_radius[i] = static_cast<float>(40 * random.uniform());
  }
  return state;
}

void checkSame(const RunState& found, const RunState& expected) {
  const TrainingState& a = found.training;
  const TrainingState& b = expected.training;
  forEachField(
      [](const Field& field, const auto& x, const auto& y) {
        INFO(field.name);
        CHECK(sameNumbers(numbers(x), numbers(y)));
      },
      a.model, b.model);
  test::checkSame(a.moments, b.moments);
  CHECK(found.statistics.score_sum == expected.statistics.score_sum);
  CHECK(found.statistics.magnitude_sum == expected.statistics.magnitude_sum);
  CHECK(found.statistics.view_count == expected.statistics.view_count);
  CHECK(found.statistics.max_radius == expected.statistics.max_radius);
  CHECK(found.densify_random.state() == expected.densify_random.state());
}

// A run's state on the device while `change` works on it, then back.
template <typename Change>
void onDevice(RunState& state, const Change& change) {
  cuda::DeviceState device;
  cuda::upload(state, {}, device);
  change(device);
  cuda::download(device, state);
}

}  // namespace

TEST_CASE("CUDA's ADC makes the CPU's Gaussians", "[checked]") {
  struct Case {
    const char* what;
    DensifyScore score;
    bool prune_large;
    std::size_t most;
  };
  using enum DensifyScore;
  for (const Case& c :
       {Case{"no limit", sum, false, 0}, Case{"magnitudes", magnitudes, false, 0},
        Case{"magnitudes only", magnitudesOnly, false, 0}, Case{"large ones pruned", sum, true, 0},
        Case{"room for some", sum, false, 600}, Case{"room for some, magnitudes", magnitudes, false, 650},
        Case{"no room", magnitudes, false, 100}, Case{"room for all", sum, false, 5000}}) {
    INFO(c.what);
    test::inOtherOrders([&] {
      RunState expected = randomState(700, 11);
      RunState found = expected;
      DensifySettings settings;
      settings.extent = 2;
      settings.score = c.score;
      settings.prune_radius = 20;
      settings.prune_large = c.prune_large;
      settings.max_gaussians = c.most;
      cuda::DensityScratch scratch;
      // A second round on other statistics meets buffers of another size.
      for (int round = 0; round < 2; ++round) {
        const DensifyResult a = densify(expected.training, expected.statistics, settings, expected.densify_random);
        DensifyResult b;
        onDevice(found, [&](cuda::DeviceState& device) {
          b = cuda::densify(device, settings, found.densify_random, scratch);
        });
        CHECK(b.pruned == a.pruned);
        CHECK(b.cloned == a.cloned);
        CHECK(b.split == a.split);
        if (round == 0) {
          CHECK(a.pruned > 0);
          CHECK((c.most == 100 || (a.cloned > 0 && a.split > 0)));
          if (c.most == 600 || c.most == 650) CHECK(expected.training.model.size() == c.most);
        }
        checkSame(found, expected);
        for (RunState* state : {&expected, &found}) {
          Random random(3);
          for (std::size_t i = 0; i < state->training.model.size(); ++i) {
            state->statistics.view_count[i] = 1;
            state->statistics.score_sum[i] = 1e-4f * static_cast<float>(random.below(6));
            state->statistics.magnitude_sum[i] = static_cast<float>(random.uniform());
          }
        }
      }
    });
  }
}

TEST_CASE("CUDA's ADC leaves alone what no gradient pulls, and prunes all that is transparent") {
  RunState state = randomState(300, 2);
  state.statistics.reset(300);
  for (float& logit : state.training.model.opacity_logit) logit = 2;
  cuda::DensityScratch scratch;
  DensifySettings settings;
  settings.score = DensifyScore::magnitudes;
  const GaussianModel before = state.training.model;
  onDevice(state, [&](cuda::DeviceState& device) { cuda::densify(device, settings, state.densify_random, scratch); });
  CHECK(state.training.model.mean == before.mean);
  for (float& logit : state.training.model.opacity_logit) logit = -20;
  onDevice(state, [&](cuda::DeviceState& device) {
    CHECK(cuda::densify(device, settings, state.densify_random, scratch).pruned == 300);
  });
  CHECK(state.training.model.size() == 0);
  CHECK(state.statistics.view_count.empty());
}

TEST_CASE("CUDA's MCMC draws the CPU's Gaussians", "[checked]") {
  test::inOtherOrders([] {
    RunState expected = randomState(600, 21);
    RunState found = expected;
    McmcSettings settings;
    settings.max_gaussians = 700;
    settings.growth = 0.1f;
    cuda::DensityScratch scratch;
    for (int round = 0; round < 3; ++round) {
      const McmcResult a = relocateAndGrow(expected.training, settings, expected.densify_random);
      expected.statistics.reset(expected.training.model.size());
      McmcResult b;
      onDevice(found, [&](cuda::DeviceState& device) {
        b = cuda::relocateAndGrow(device, settings, found.densify_random, scratch);
      });
      INFO("round " << round);
      CHECK(b.relocated == a.relocated);
      CHECK(b.added == a.added);
      if (round == 0) CHECK(a.relocated > 0);
      checkSame(found, expected);
    }
    CHECK(found.training.model.size() == 700);
  });
}

TEST_CASE("when all are dead nothing moves with CUDA either") {
  RunState expected = randomState(40, 3);
  for (float& logit : expected.training.model.opacity_logit) logit = -10;
  expected.statistics.reset(40);
  RunState found = expected;
  cuda::DensityScratch scratch;
  onDevice(found, [&](cuda::DeviceState& device) {
    CHECK(cuda::relocateAndGrow(device, {100}, found.densify_random, scratch).added == 0);
  });
  checkSame(found, expected);
}

TEST_CASE("CUDA's opacity reset and SH growth are the CPU's", "[checked]") {
  RunState expected = randomState(300, 4);
  RunState found = expected;
  resetOpacity(expected.training);
  growShDegree(expected.training, 3);
  onDevice(found, [&](cuda::DeviceState& device) {
    cuda::resetOpacity(device);
    cuda::growShDegree(device, 3);
    found.training.model.sh_degree = 3;
  });
  checkSame(found, expected);
}

TEST_CASE("CUDA's 3D filter has the CPU's sizes", "[checked]") {
  RunState state = randomState(500, 5);
  std::vector<Pinhole> cameras;
  for (const double focal : {100.0, 300.0}) {
    cameras.push_back({glm::dmat3(1.0), {0, 0, focal / 60}, {focal, focal * 1.1}, {50, 25}, {100, 50}});
  }
  const std::vector<float> expected = minSigmas(cameras, state.training.model);
  cuda::Buffer<Pinhole> device_cameras;
  device_cameras.upload(cameras);
  cuda::Buffer<std::uint32_t> largest;
  onDevice(state, [&](cuda::DeviceState& device) { cuda::updateFilter(device, device_cameras, largest); });
  CHECK(sameNumbers(state.min_sigma, expected));
  CHECK(*std::min_element(expected.begin(), expected.end()) > 0);
}

TEST_CASE("CUDA finds wide Gaussians where the CPU does", "[checked]") {
  const std::array<glm::dvec3, 3> eyes = {{{0, 0, -4}, {2, 1, -3}, {-5, 0.5, 0.5}}};
  cuda::Buffer<glm::dvec3> device_eyes;
  device_eyes.upload(eyes);
  cuda::Buffer<std::uint32_t> found;
  const auto mayHave = [&](const RunState& state, double bound) {
    cuda::DeviceState device;
    cuda::upload(state, {}, device);
    return cuda::mayHaveWide(device.model.parameters(), device_eyes, bound, found);
  };
  int wide = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const RunState state = randomState(seed % 4 == 0 ? 300 : 2, seed);
    const double bound = seed % 4 == 0 ? 0.2 : 0.02;
    const bool expected = !splitWide(state.training.model, eyes, {.bound = bound, .rounds = 1}).wide.empty();
    wide += expected;
    CAPTURE(seed);
    CHECK(mayHave(state, bound) == expected);
  }
  CHECK(wide >= 10);
  CHECK(wide <= 30);

  // Its nearest eye is 5 away.
  RunState one = randomState(1, 1);
  one.training.model.mean[0] = {-5, 0.5, 5.5};
  one.training.model.log_scale[0] = {-6, 0, -6};
  CHECK(mayHave(one, 1 / 5.001));
  CHECK(mayHave(one, 1 / 5.0));  // it leaves the last bits to the CPU
  CHECK_FALSE(mayHave(one, 1 / 4.999));
  CHECK(splitWide(one.training.model, eyes, {.bound = 1 / 5.0, .rounds = 1}).wide.empty());
}
