// SPDX-License-Identifier: Apache-2.0
// What every pass of the frame is given: the view, and the numbers of this dispatch. Storage buffers count from 0.
#include "shared/layout.h"
#include "shared/limits.h"
#include "shared/work.h"

layout(std140, binding = 16) uniform ViewBlock { ViewUniforms view; };
layout(std140, binding = 17) uniform PassBlock { PassUniforms pass; };

// A number of the blocks above that decides a branch or a loop's end by itself goes through this. lavapipe compiles
// such a shader anew for what it takes for that number, which in Mesa 22.3 is the first one of the block: a turning
// camera then has a compilation to every picture. No dispatch has more than one layer of groups, which the driver does
// not know.
uint decider(uint number) { return number | (gl_NumWorkGroups.z - 1u); }

// Number of this thread in a dispatch of Work::item_groups.
uint itemIndex() {
  return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * kGroupSize + gl_LocalInvocationIndex;
}
