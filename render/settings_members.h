// SPDX-License-Identifier: Apache-2.0
// The members of RenderSettings one after the other, for what goes through all of them.
#pragma once
#include <concepts>
#include <tuple>
#include <type_traits>

#include "render/settings.h"

namespace tg {

// References to all, in their order. A new member breaks this: it needs its name here and a row in makeSettings()
// (settings.cpp). `outputs` has no row, it is what a frame holds.
template <typename Settings>
  requires std::same_as<std::remove_const_t<Settings>, RenderSettings>
auto membersOf(Settings& settings) {
  auto& [textures, intersection, outside, background, outputs, order, texture_filter, antialiasing, opacity_scale,
         splat_scale, max_sh_degree, near, crop, exposure, gain, colors, range] = settings;
  return std::tie(textures, intersection, outside, background, outputs, order, texture_filter, antialiasing,
                  opacity_scale, splat_scale, max_sh_degree, near, crop, exposure, gain, colors, range);
}

}  // namespace tg
