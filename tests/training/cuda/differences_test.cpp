// SPDX-License-Identifier: Apache-2.0
// The gradient of a whole CUDA step - 3D filter, picture, loss - against central differences of what its kernels draw.
// The loss of the pictures is taken in float64, or its rounding would drown them; pictures are float, so steps are
// large, and two of them cancel the error in h^2 (Richardson). Every Gaussian is tried along a random direction of each
// parameter.
#include <cmath>

#include "render/reference/reference.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "support/ssim_reference.h"
#include "training/cuda/frame.h"
#include "training/cuda/step.h"

using namespace tg;
using namespace tg::test;

namespace {

constexpr int kWidth = 20, kHeight = 18;  // four tiles
constexpr float kSsimWeight = 0.2f;
constexpr double kValues = 3.0 * kWidth * kHeight;
constexpr double kStep = 0.04;

Camera testCamera() { return lookAt({0.3, -0.2, -4.0}, {0.0, 0.1, 0.0}, {0.1, -1.0, 0.0}, 0.6, kWidth, kHeight); }

// Splats that cover the whole picture, so that no cut-off (least alpha, 3 sigma of a texture, transmittance stop, black
// colours) acts on it, and their textures' middle cell does: steps have no derivative, and kinks two.
GaussianModel coveringModel(IntersectionModel intersection) {
  GaussianModel model;
  model.sh_degree = 1;
  model.texture_mode = TextureMode::rgba;
  model.intersection = intersection;
  test::Random random(3);
  constexpr std::uint16_t kSizes[5][2] = {{4, 4}, {2, 4}, {1, 2}, {0, 0}, {2, 2}};
  // Each has its shortest axis towards the camera, whichever of the three it is.
  const glm::dvec3 scales[3] = {{2.3, 1.9, 0.3}, {0.25, 1.9, 2.2}, {1.8, 0.2, 2.1}};
  const double h = std::sqrt(0.5);
  const glm::dvec4 facing[3] = {{1, 0, 0, 0}, {h, 0, h, 0}, {h, h, 0, 0}};
  for (int i = 0; i < 5; ++i) {
    // Apart along z, or a step would change the order.
    model.mean.push_back(glm::vec3(random.uniformVec3(-0.2, 0.2) * glm::dvec3(1, 1, 0)) + glm::vec3(0, 0, 0.25 * i));
    const glm::dvec4 turn(0.0, random.uniformVec3(-0.15, 0.15));
    model.rotation.push_back(glm::vec4((facing[i % 3] + turn) * random.uniform(0.8, 1.3)));
    model.log_scale.push_back(glm::vec3(glm::log(scales[i % 3])));
    model.opacity_logit.push_back(static_cast<float>(random.uniform(-1.2, 0.0)));
    for (int k = 0; k < 4; ++k) {
      model.sh.push_back(glm::vec3(k == 0 ? random.uniformVec3(-1.0, 1.2) : random.uniformVec3(-0.2, 0.2)));
    }
    const auto& size = kSizes[i];
    model.atlas.rects.push_back({static_cast<std::uint32_t>(model.atlas.texels.size()), size[0], size[1]});
    for (int k = 0; k < size[0] * size[1]; ++k) {
      model.atlas.texels.push_back(glm::vec4(glm::vec3(random.uniformVec3(-0.3, 0.3)), random.uniform(0.5, 0.95)));
    }
  }
  return model;
}

// A training step's gradient without its end, on the device.
class Step {
 public:
  Step(TextureMode mode, bool filtered) : filtered_(filtered) {
    settings_.textures = mode;
    settings_.background = {0.3f, 0.5f, 0.7f};
  }

  // A photograph whose every value is a quarter above or below the picture's, in patches: no |difference| is near its
  // kink, and the pixels' shares in a gradient do not cancel, so that it stands out from the loss's rounding.
  void photograph(const GaussianModel& model) {
    forward(model);
    std::vector<float> picture(frame_.picture().size());
    frame_.picture().download(picture);
    for (std::size_t i = 0; i < picture.size(); ++i) {
      const std::size_t patch = i % 3 + i / 3 % kWidth / 7 + i / 3 / kWidth / 6;
      const bool above = picture[i] < 0.3f || (picture[i] < 0.7f && patch % 3 != 0);
      target_.push_back(static_cast<std::uint8_t>(std::lround(255 * (picture[i] + (above ? 0.25f : -0.25f)))));
      REQUIRE((picture[i] > 0.02f && picture[i] < 0.98f));
    }
  }

  double loss(const GaussianModel& model) {
    forward(model);
    std::vector<float> picture(frame_.picture().size());
    frame_.picture().download(picture);
    double l1 = 0, ssim = 0;
    for (std::size_t channel = 0; channel < 3; ++channel) {
      std::vector<double> drawn, wanted;
      for (std::size_t i = channel; i < picture.size(); i += 3) {
        drawn.push_back(picture[i]);
        wanted.push_back(target_[i] / 255.0);
        l1 += std::abs(drawn.back() - wanted.back());
      }
      ssim += referenceSsim(drawn, wanted, kWidth, kHeight);
    }
    return (1 - kSsimWeight) * l1 / kValues + kSsimWeight * (1 - ssim / 3);
  }

  ModelGradient gradient(const GaussianModel& model) {
    forward(model);
    cuda::Buffer<std::uint8_t> target;
    target.upload(target_);
    cuda::Buffer<float> v_picture;
    v_picture.resize(frame_.picture().size());
    cuda::LossBuffers buffers;
    cuda::evaluateLoss({kWidth, kHeight, kSsimWeight, kValues, frame_.picture().data(), target.data(), nullptr},
                       buffers, v_picture.data());
    cuda::DeviceModel gradient;
    gradient.resizeLike(model_);
    frame_.backward(v_picture.data(), {}, drawn(), gradient.parameters());
    cuda::chainGradients({model_.parameters(), filtered_ ? min_sigma_.data() : nullptr, false, 0, 0},
                         gradient.parameters());
    ModelGradient result;
    gradient.download(result);
    return result;
  }

  // What is drawn, for the reference.
  GaussianModel drawnModel(const GaussianModel& model) {
    forward(model);
    GaussianModel result = model;
    if (filtered_) {
      log_scale_.download(result.log_scale);
      opacity_logit_.download(result.opacity_logit);
    }
    return result;
  }
  const RenderSettings& settings() const { return settings_; }

 private:
  cuda::Parameters drawn() const {
    cuda::Parameters parameters = model_.parameters();
    if (filtered_) {
      parameters.log_scale = log_scale_.data();
      parameters.opacity_logit = opacity_logit_.data();
    }
    return parameters;
  }
  void forward(const GaussianModel& model) {
    model_.upload(model);
    min_sigma_.upload(std::vector<float>(model.size(), 0.4f));
    log_scale_.resize(3 * model.size());
    opacity_logit_.resize(model.size());
    if (filtered_) {
      cuda::applyFilter(model_.parameters(), min_sigma_.data(), log_scale_.data(), opacity_logit_.data());
    }
    frame_.forward(cuda::makeView(model, testCamera(), settings_), drawn());
  }

  const bool filtered_;
  RenderSettings settings_;
  cuda::DeviceModel model_;
  cuda::Buffer<float> min_sigma_, log_scale_, opacity_logit_;
  std::vector<std::uint8_t> target_;
  cuda::Frame frame_;
};

// The floats [begin, begin + count) of a parameter belong to one Gaussian.
struct Part {
  std::size_t begin, count;
};

// Largest |difference quotient - gradient along the same direction| over the parts, relative to the largest of the
// gradients.
double worstError(Step& step, GaussianModel& model, float* values, const float* gradient,
                  const std::vector<Part>& parts) {
  test::Random random(11);
  double worst = 0, largest = 0;
  for (const Part& part : parts) {
    const std::vector<float> at(values + part.begin, values + part.begin + part.count);
    std::vector<double> direction(part.count);
    for (double& d : direction) d = random.uniform(-1.0, 1.0);
    double expected = 0, slopes[2];
    for (std::size_t k = 0; k < part.count; ++k) expected += direction[k] * double{gradient[part.begin + k]};
    for (int half = 0; half < 2; ++half) {
      const double h = half ? kStep / 2 : kStep;
      const auto lossAt = [&](double signed_h) {
        for (std::size_t k = 0; k < part.count; ++k) {
          values[part.begin + k] = static_cast<float>(at[k] + signed_h * direction[k]);
        }
        return step.loss(model);
      };
      const double above = lossAt(h);
      slopes[half] = (above - lossAt(-h)) / (2 * h);
    }
    std::copy(at.begin(), at.end(), values + part.begin);
    worst = std::max(worst, std::abs((4 * slopes[1] - slopes[0]) / 3 - expected));
    largest = std::max(largest, std::abs(expected));
  }
  REQUIRE(largest > 1e-4);  // else there is nothing to compare
  return worst / largest;
}

std::vector<Part> rows(std::size_t gaussians, std::size_t floats) {
  std::vector<Part> parts;
  for (std::size_t i = 0; i < gaussians; ++i) parts.push_back({i * floats, floats});
  return parts;
}

void checkDifferences(IntersectionModel intersection, TextureMode mode, bool filtered) {
  GaussianModel model = coveringModel(intersection);
  Step step(mode, filtered);
  {
    const ReferenceModel drawn(step.drawnModel(model));
    const auto cut = renderReference(drawn, testCamera(), step.settings());
    const auto smooth = renderReference(drawn, testCamera(), step.settings(), {.cutoffs = false});
    for (std::size_t pixel = 0; pixel < cut.base.size(); ++pixel) {
      REQUIRE(glm::length(cut.color(pixel) - smooth.color(pixel)) < 1e-12);
    }
  }
  step.photograph(model);
  const ModelGradient g = step.gradient(model);
  const auto error = [&](auto& values, const auto& gradient, const std::vector<Part>& parts) {
    return worstError(step, model, reinterpret_cast<float*>(values.data()),
                      reinterpret_cast<const float*>(gradient.data()), parts);
  };
  forEachField(
      [&](const Field& field, auto& values, const auto& gradient) {
        INFO(field.name);
        CHECK(error(values, gradient, rows(model.size(), field.row(model.shCount()))) < 1e-3);
      },
      model, g);
  if (mode == TextureMode::none) return;
  std::vector<Part> textures;
  for (const TextureRect& rect : model.atlas.rects) {
    const std::size_t texels = static_cast<std::size_t>(rect.width) * rect.height;
    if (texels > 0) textures.push_back({4 * rect.offset, 4 * texels});
  }
  CHECK(error(model.atlas.texels, g.texels, textures) < 1e-3);
}

}  // namespace

TEST_CASE("CUDA's gradient is its loss's central differences, for every parameter, in both models") {
  for (const auto intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
    INFO(name(intersection));
    checkDifferences(intersection, TextureMode::rgba, false);
  }
}

TEST_CASE("CUDA's gradient through the 3D filter is its loss's central differences") {
  for (const auto intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
    INFO(name(intersection));
    checkDifferences(intersection, TextureMode::rgba, true);
  }
}

TEST_CASE("CUDA's gradient in other texture modes is its loss's central differences") {
  for (const auto mode : {TextureMode::none, TextureMode::alpha, TextureMode::rgb}) {
    INFO(name(mode));
    checkDifferences(IntersectionModel::maxResponse, mode, false);
  }
}
