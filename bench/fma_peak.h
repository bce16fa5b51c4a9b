// SPDX-License-Identifier: Apache-2.0
// What this machine's arithmetic can do at best: the yardstick of the kernels' speed.
#pragma once

namespace tg::bench {

// Fused multiply-adds of one thread in registers, best of several short runs [flop/s]; an FMA counts two.
double fmaPeak();
// Lanes of the vectors that both this and the kernels use.
int vectorLanes();

}  // namespace tg::bench
