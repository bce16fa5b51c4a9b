// SPDX-License-Identifier: Apache-2.0
// What every pass of the frame is given: the view, and the numbers of this dispatch. Storage buffers count from 0.
#include "shared/layout.h"
#include "shared/limits.h"
#include "shared/work.h"

layout(std140, binding = 16) uniform ViewBlock { ViewUniforms view; };
layout(std140, binding = 17) uniform PassBlock { PassUniforms pass; };

// Number of this thread in a dispatch of Work::item_groups.
uint itemIndex() {
  return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * kGroupSize + gl_LocalInvocationIndex;
}
