// SPDX-License-Identifier: Apache-2.0
// Small models and pictures of them for the converter's tests.
#pragma once
#include <cmath>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "converter/registry/file_format.h"
#include "core/image/image.h"
#include "core/image/metrics.h"
#include "core/model/verbs.h"
#include "render/renderer.h"
#include "support/message_of.h"
#include "support/scenes.h"

inline tg::Image picture(const tg::GaussianModel& model, const tg::Camera& camera) {
  const auto renderer = tg::makeCpuRenderer();
  renderer->setModel(model);
  return tg::extract(renderer->render(camera, {}), tg::Output::final);
}

// Splats without textures in a cube of +-extent, every number within what SPZ can hold.
inline tg::GaussianModel randomSplats(int degree, std::size_t count, double extent, int seed) {
  tg::test::Random random(static_cast<unsigned>(seed));
  tg::GaussianModel model;
  model.sh_degree = degree;
  for (std::size_t i = 0; i < count; ++i) {
    model.mean.emplace_back(random.uniformVec3(-extent, extent));
    model.rotation.emplace_back(random.uniform(0.2, 3.0) * random.quaternion());
    model.log_scale.emplace_back(random.uniformVec3(-9.5, 5.5));
    model.opacity_logit.push_back(static_cast<float>(random.uniform(-5.0, 5.0)));
    for (std::size_t k = 0; k < model.shCount(); ++k) model.sh.emplace_back(random.uniformVec3(-0.9, 0.9));
  }
  return model;
}

// Of SH degree 0, with so many different textures, of several sizes.
inline tg::test::TestScene sharedScene(std::size_t different) {
  tg::test::TestScene scene = tg::test::makeScene(tg::test::SceneKind::ordinary, 19, 120);
  tg::GaussianModel& model = scene.model;
  tg::setShDegree(model, 0);
  tg::TextureAtlas atlas;
  for (std::size_t i = 0; i < model.size(); ++i) {
    tg::TextureRect rect = model.atlas.rects[i % different];
    const auto from = model.atlas.texels.begin() + rect.offset;
    rect.offset = static_cast<std::uint32_t>(atlas.texels.size());
    atlas.texels.insert(atlas.texels.end(), from, from + rect.texelCount());
    atlas.rects.push_back(rect);
  }
  model.atlas = std::move(atlas);
  return scene;
}

inline double largest(glm::vec3 v) {
  return static_cast<double>(glm::max(glm::max(std::abs(v.x), std::abs(v.y)), std::abs(v.z)));
}

// What readModel throws, without the path.
inline std::string refusal(const std::filesystem::path& path) {
  const std::string text = tg::test::messageOf([&] { tg::readModel(path); }), prefix = path.string() + ": ";
  if (text.starts_with(prefix)) return text.substr(prefix.size());
  return text == "accepted" || text.starts_with("another exit code") ? text : "without the path: " + text;
}
