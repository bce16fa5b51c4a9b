// SPDX-License-Identifier: Apache-2.0
// Uses every struct of shared/layout.h, so that its offsets can be read back from the SPIR-V.
#version 450
#extension GL_GOOGLE_include_directive : require
#include "shared/layout.h"

layout(local_size_x = 1) in;
layout(std140, binding = 0) uniform View { ViewUniforms view; };
layout(std430, binding = 1) buffer Splats { Splat splats[]; };
layout(std430, binding = 2) buffer Records { SplatRecord records[]; };

void main() {
  splats[view.gaussian_count].d0_size = view.background;
  records[view.gaussian_count].outline = view.background;
}
