// SPDX-License-Identifier: Apache-2.0
// What holds for every model, tried on models that RapidCheck makes up and makes smaller where one fails. Another
// choice, or more of them: RC_PARAMS="seed=7 max_success=1000".
#include <rapidcheck.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <glm/gtc/quaternion.hpp>
#include <numeric>
#include <string>
#include <tuple>

#include "converter/edit/merge.h"
#include "converter/edit/quality.h"
#include "converter/edit/select.h"
#include "converter/edit/transform.h"
#include "converter/edits.h"
#include "converter/registry/file_format.h"
#include "converter/scratch.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;

namespace tg {

void showValue(const GaussianModel& model, std::ostream& out) {
  out << model.size() << " Gaussians, SH degree " << model.sh_degree << ", textures " << name(model.texture_mode);
  forEachField(
      [&](const Field& field, const auto& values) {
        out << "\n" << field.name << ":";
        const auto* floats = reinterpret_cast<const float*>(values.data());
        for (std::size_t i = 0; i < values.size() * field.floats; ++i) out << " " << floats[i];
      },
      model);
  for (const TextureRect& rect : model.atlas.rects) out << "\n" << rect.offset << ": " << rect.width << " x " << rect.height;
}

}  // namespace tg

namespace {

// In [low, high], in 1,024 steps that shrink towards `low`; now and then one of both ends or 0. Halves hold the texels
// below, as model.tgz does.
rc::Gen<float> number(float low, float high) {
  const auto step = rc::gen::map(rc::gen::inRange(0, 1025), [=](int i) {
    return low + (high - low) * static_cast<float>(i) / 1024.0f;
  });
  return rc::gen::weightedOneOf<float>({{8, step}, {1, rc::gen::element(low, high, 0.0f)}});
}

glm::vec3 vector(float low, float high) { return {*number(low, high), *number(low, high), *number(low, high)}; }

// 1 to 8 Gaussians of any SH degree and kind of texture. `far` [world units]: means lie within +-far.
rc::Gen<GaussianModel> models(float far, bool textured) {
  return rc::gen::exec([=] {
    GaussianModel model;
    model.sh_degree = *rc::gen::inRange(0, 4);
    const int count = *rc::gen::inRange(1, 9);
    if (textured) {
      model.texture_mode = *rc::gen::element(TextureMode::none, TextureMode::alpha, TextureMode::rgb, TextureMode::rgba);
      model.intersection = *rc::gen::element(IntersectionModel::plane, IntersectionModel::maxResponse);
    }
    for (int i = 0; i < count; ++i) {
      model.mean.push_back(vector(-far, far));
      const glm::vec4 rotation{*number(0.1f, 1.0f), *number(-1.0f, 1.0f), *number(-1.0f, 1.0f), *number(-1.0f, 1.0f)};
      model.rotation.push_back(rotation);
      model.log_scale.push_back(vector(-9.0f, 5.0f));
      model.opacity_logit.push_back(*number(-5.0f, 5.0f));
      for (std::size_t k = 0; k < model.shCount(); ++k) model.sh.push_back(vector(-0.9f, 0.9f));
      if (model.texture_mode == TextureMode::none) continue;
      TextureRect rect{static_cast<std::uint32_t>(model.atlas.texels.size())};
      rect.width = static_cast<std::uint16_t>(*rc::gen::inRange(0, 6));
      rect.height = static_cast<std::uint16_t>(rect.width == 0 ? 0 : *rc::gen::inRange(1, 6));
      if (rect.width == 0) rect.offset = 0;
      model.atlas.rects.push_back(rect);
      const bool colour = model.texture_mode != TextureMode::alpha, alpha = model.texture_mode != TextureMode::rgb;
      for (std::uint32_t t = 0; t < rect.texelCount(); ++t) {
        const glm::vec3 rgb = colour ? vector(-0.5f, 0.5f) : glm::vec3(0.0f);
        model.atlas.texels.emplace_back(rgb, alpha ? *number(0.0f, 1.0f) : 1.0f);
      }
    }
    return model;
  });
}

Similarity similarity() {
  const float w = *number(0.1f, 1.0f), x = *number(-1.0f, 1.0f), y = *number(-1.0f, 1.0f), z = *number(-1.0f, 1.0f);
  const glm::dquat turn = glm::normalize(glm::dquat(double{w}, double{x}, double{y}, double{z}));
  return {std::exp2(double{*number(-3.0f, 3.0f)}), glm::mat3_cast(turn), glm::dvec3(vector(-10.0f, 10.0f))};
}

Bundle through(const Format& format, const GaussianModel& model, const Scratch& scratch) {
  const auto path = scratch.folder() / ("a." + std::string(format.name));
  Bundle source;
  source.model = model;
  Written written;
  writeModel(format, path, source, {}, written);
  return readModel(path);
}

GaussianModel kept(GaussianModel model, const std::vector<std::uint8_t>& keep) {
  keepGaussians(model, keep);
  return model;
}

void holds(const std::string& what, const auto& property) {
  setenv("RC_PARAMS", "seed=1 max_success=40", 0);
  CHECK(rc::check(what, property));
}

}  // namespace

TEST_CASE("a model.tgz is the model again, whatever the model") {
  const Scratch scratch;
  holds("model.tgz", [&] {
    const GaussianModel model = *models(1e30f, true);
    RC_ASSERT(through(*findFormat("tgz"), model, scratch).model == model);
  });
}

TEST_CASE("a PLY is the model again, whatever the model without textures") {
  const Scratch scratch;
  holds("PLY", [&] {
    const GaussianModel model = *models(1e30f, false);
    RC_ASSERT(through(*findFormat("ply"), model, scratch).model == model);
  });
}

// By means, which formats whose order is their own keep apart.
GaussianModel inOrder(const GaussianModel& model) {
  std::vector<std::uint32_t> order(model.size());
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::stable_sort(order, [&](std::uint32_t a, std::uint32_t b) {
    const glm::vec3 &m = model.mean[a], &n = model.mean[b];
    return std::tie(m.x, m.y, m.z) < std::tie(n.x, n.y, n.z);
  });
  GaussianModel sorted;
  for (const std::uint32_t i : order) {
    std::vector<std::uint8_t> one(model.size());
    one[i] = 1;
    if (sorted.size() == 0) {
      sorted = kept(model, one);
    } else {
      mergeModel(sorted, kept(model, one), "one more");
    }
  }
  return sorted;
}

TEST_CASE("what a format made of a model it makes of it again") {
  const Scratch scratch;
  for (const Format& format : formats()) {
    if (!format.write || !format.read) continue;
    holds(std::string(format.name), [&] {
      const GaussianModel model = *models(100.0f, true);
      const GaussianModel once = through(format, model, scratch).model;
      RC_ASSERT(once.size() == model.size());
      const GaussianModel twice = through(format, once, scratch).model;
      const std::optional<Deviation> deviation = deviationOf(inOrder(once), inOrder(twice));
      RC_ASSERT(deviation.has_value());
      RC_LOG() << "mean " << deviation->mean << " shape " << deviation->shape << " opacity " << deviation->opacity
               << " colour " << deviation->color << " sh " << deviation->sh << " texel " << deviation->texel << "\n";
      const Deviation& d = *deviation;
      RC_ASSERT(std::max({d.mean, d.color, d.sh}) < 1e-4);
      // Steps of a quaternion depend on its length; a base baked from a texture of 8 bits may be a step beside itself.
      const bool exact = format.holds(kKeepsFloats);
      RC_ASSERT(d.shape < (exact ? 1e-7 : 0.03));
      RC_ASSERT(std::max(d.opacity, d.texel) < (exact ? 1e-7 : 3.5 / 255));
    });
  }
}

const auto parts = rc::gen::element<std::uint8_t>(0, 1);

TEST_CASE("two parts of a model merge into the model") {
  holds("split and merge", [] {
    const GaussianModel model = *models(100.0f, true);
    const auto keep = *rc::gen::container<std::vector<std::uint8_t>>(model.size(), parts);
    std::vector<std::uint8_t> rest(keep.size());
    for (std::size_t i = 0; i < keep.size(); ++i) rest[i] = static_cast<std::uint8_t>(1 - keep[i]);
    RC_PRE(std::ranges::find(keep, 1) != keep.end());
    GaussianModel merged = kept(model, keep);
    mergeModel(merged, kept(model, rest), "the rest");
    std::vector<std::uint32_t> order;
    for (const int part : {1, 0}) {
      for (std::uint32_t i = 0; i < keep.size(); ++i) {
        if (keep[i] == part) order.push_back(i);
      }
    }
    RC_ASSERT(merged.size() == model.size());
    for (std::uint32_t i = 0; i < order.size(); ++i) {
      std::vector<std::uint8_t> one(model.size()), other(model.size());
      other[i] = one[order[i]] = 1;
      RC_ASSERT(kept(merged, other) == kept(model, one));
    }
  });
}

TEST_CASE("a part of a moved model is the moved part") {
  holds("keep and transform", [] {
    const GaussianModel model = *models(100.0f, true);
    const Similarity moved = similarity();
    const auto keep = *rc::gen::container<std::vector<std::uint8_t>>(model.size(), parts);
    GaussianModel first = model, then = kept(model, keep);
    transformModel(first, moved);
    transformModel(then, moved);
    RC_ASSERT(kept(first, keep) == then);
  });
}

TEST_CASE("any move leaves the picture through the moved cameras as it was") {
  holds("transform and render", [] {
    const auto kind = *rc::gen::elementOf(std::vector<test::SceneKind>(test::kSceneKinds.begin(), test::kSceneKinds.end()));
    const test::TestScene scene = test::makeScene(kind, *rc::gen::inRange(0u, 1000u), 30, 24, 18);
    Similarity moved = similarity();
    moved.scale = 1;  // near planes stay where they are
    GaussianModel model = scene.model;
    std::vector<Camera> cameras{scene.camera};
    transformModel(model, moved);
    transformCameras(cameras, moved);
    const double likeness = framePsnr(referenceFrame(scene.model, scene.camera), referenceFrame(model, cameras[0]));
    RC_LOG() << test::name(kind) << ": " << likeness << " dB\n";
    RC_ASSERT(likeness > 60.0);
  });
}

TEST_CASE("rectangles packed into pages come out as they were") {
  holds("atlas", [] {
    const GaussianModel model = *models(1.0f, true);
    const PackedAtlas packed = packAtlas(model.atlas, model.size(), 16);
    RC_ASSERT(unpackAtlas(packed, "pages") == model.atlas || model.atlas.rects.empty());
  });
}
