// SPDX-License-Identifier: Apache-2.0
// Small models and pictures of them for the converter's tests.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "converter/registry/file_format.h"
#include "core/image/image.h"
#include "core/image/metrics.h"
#include "render/renderer.h"
#include "support/message_of.h"
#include "support/scenes.h"

inline tg::Image picture(const tg::GaussianModel& model, const tg::Camera& camera) {
  const auto renderer = tg::makeCpuRenderer();
  renderer->setModel(model);
  return tg::extract(renderer->render(camera, {}), tg::Output::final);
}

// What readModel throws, without the path.
inline std::string refusal(const std::filesystem::path& path) {
  const std::string text = tg::test::messageOf([&] { tg::readModel(path); }), prefix = path.string() + ": ";
  if (text.starts_with(prefix)) return text.substr(prefix.size());
  return text == "accepted" || text.starts_with("another exit code") ? text : "without the path: " + text;
}
