// SPDX-License-Identifier: Apache-2.0
// Textures of 8-bit texels as the passes read them (render/gpu/model_buffers.h).
#ifndef TG_TEXELS_H
#define TG_TEXELS_H
#include "shared/lang.h"
TG_NAMESPACE_BEGIN

// The place of a texture of 8-bit texels: its first cell in the lower bits, the exponent of its colours above them:
// 2^(exponent + kTexelExponentMin) is at least its largest colour.
const uint kCellBits = 27u;
const int kTexelExponentMin = -12;
const int kTexelExponentMax = 19;

TG_NAMESPACE_END
#endif
