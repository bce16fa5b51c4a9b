// SPDX-License-Identifier: Apache-2.0
// A model made for somebody else's viewer, and what that viewer then shows, by emulation.
#pragma once
#include <cstddef>

#include "core/bundle/bundle.h"
#include "render/affine/splat_viewer.h"

namespace tg {

struct AdaptReport {
  SplatViewer viewer = SplatViewer::three;
  std::size_t wide = 0;        // Gaussians that are in pieces now
  std::size_t pieces = 0;      // which these are
  bool fitted = false;         // opacities, colours and, where they are the base's alone, scales
  std::size_t fit_views = 0;   // views that were fitted
  std::size_t held_views = 0;  // others, of which the figures below are
  double before = 0;           // [dB] the viewer's picture of the untouched base against ours of the source, with its textures
  double after = 0;            // [dB] the viewer's picture of what is written against the same
  double ours = 0;             // [dB] our renderer's picture of what is written, likewise; infinity when equal
};

struct Adapted {
  GaussianModel model;  // to write
  // What readers without textures get, Gaussian by Gaussian; empty where `model` itself is that.
  GaussianModel base;
  AdaptReport report;
};

// `keep_textures`: the file has colours and opacities for readers with textures beside those for others. Theirs stay as
// they are, pieces are invisible to them, and shapes are moved of pieces alone. Otherwise the result has no textures.
// The views are the model's cameras, or a ring.
Adapted adaptTo(SplatViewer viewer, const Bundle& source, bool keep_textures);

}  // namespace tg
