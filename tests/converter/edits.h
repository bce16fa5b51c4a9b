// SPDX-License-Identifier: Apache-2.0
// Reference pictures of edited models and how far they differ.
#pragma once
#include <cmath>
#include <limits>
#include <span>
#include <string>

#include "converter/edit/edit.h"
#include "render/reference/reference.h"
#include "scenes.h"
#include "support/message_of.h"

inline tg::FrameT<double> referenceFrame(const tg::GaussianModel& model, const tg::Camera& camera) {
  return tg::renderReference(tg::ReferenceModel(model), camera, {});
}

// [dB], peak 1, not clamped.
inline double framePsnr(const tg::FrameT<double>& a, const tg::FrameT<double>& b) {
  double sum = 0.0;
  for (std::size_t p = 0; p < a.base.size(); ++p) {
    const glm::dvec3 difference = a.color(p) - b.color(p);
    sum += glm::dot(difference, difference);
  }
  return sum == 0.0 ? std::numeric_limits<double>::infinity()
                    : -10.0 * std::log10(sum / (3.0 * static_cast<double>(a.base.size())));
}

// The message with which an edit is refused as misused.
inline std::string usageErrorOf(const tg::GaussianModel& model, const tg::Edit& edit) {
  tg::Bundle loaded;
  loaded.model = model;
  return tg::test::messageOf([&] { tg::applyEdits(loaded, std::span(&edit, 1), false); }, tg::ErrorKind::usage);
}
