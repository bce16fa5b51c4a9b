// SPDX-License-Identifier: Apache-2.0
// A model made for somebody else's viewer, and what that viewer then shows, by emulation.
#pragma once
#include <cstddef>
#include <vector>

#include "converter/edit/progress.h"
#include "core/bundle/bundle.h"
#include "core/system/names.h"
#include "render/affine/splat_viewer.h"

namespace tg {

// Whose picture by our renderer the viewer's should be like: of the model, or of what stands in for its textures.
enum class FitAim : unsigned { textures, base };
constexpr auto namesOf(FitAim) { return enumNames("textures", "base"); }

// PSNR [dB] of the viewer's pictures, untouched and of what is written.
struct AdaptedPsnr {
  double before = 0, after = 0;
};

struct AdaptReport {
  SplatViewer viewer = SplatViewer::three;
  std::size_t wide = 0;        // Gaussians that are in pieces now
  std::size_t pieces = 0;      // which these are
  std::size_t skirts = 0;      // Gaussians that were added for what the viewer cuts off
  std::size_t parts = 1;       // primitives, drawn one after the other
  bool fitted = false;         // opacities, colours and scales; places where they are the base's alone
  std::size_t fit_views = 0;   // views that were fitted
  std::size_t held_views = 0;  // others, of which the figures below are
  AdaptedPsnr to_model;        // against our pictures of the source, with its textures
  AdaptedPsnr to_base;         // against those without; the same where it has none
  double ours = 0;             // [dB] our pictures of what is written against those of the source; infinity when equal
};

struct Adapted {
  GaussianModel model;  // to write
  // What readers without textures get, Gaussian by Gaussian; empty where `model` itself is that.
  GaussianModel base;
  std::vector<std::size_t> parts;  // where each primitive but the last ends
  AdaptReport report;
};

// `as_gltf`: the file has primitives, and colours, opacities and scales for readers with textures beside those for
// others. Theirs stay as they are, pieces and skirts are invisible to them; the order may change. Otherwise the result
// has no textures. The views are the model's cameras, or a ring.
Adapted adaptTo(SplatViewer viewer, const Bundle& source, bool as_gltf, FitAim aim = FitAim::textures,
                const ConvertListener& listener = {});

}  // namespace tg
