// SPDX-License-Identifier: Apache-2.0
// Small models and pictures of them for the converter's tests.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "converter/registry/file_format.h"
#include "core/image/image.h"
#include "core/image/metrics.h"
#include "core/system/error.h"
#include "render/renderer.h"
#include "support/scenes.h"

inline tg::Image picture(const tg::GaussianModel& model, const tg::Camera& camera) {
  const auto renderer = tg::makeCpuRenderer();
  renderer->setModel(model);
  return tg::extract(renderer->render(camera, {}), tg::Output::final);
}

// What readModel throws, without the path; "accepted" when it does not.
inline std::string refusal(const std::filesystem::path& path) {
  try {
    tg::readModel(path);
  } catch (const tg::Error& error) {
    const std::string text = error.what();
    const std::string prefix = path.string() + ": ";
    if (error.kind != tg::ErrorKind::badData) return "another exit code: " + text;
    return text.rfind(prefix, 0) == 0 ? text.substr(prefix.size()) : "without the path: " + text;
  }
  return "accepted";
}
