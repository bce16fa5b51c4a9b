// SPDX-License-Identifier: Apache-2.0
// Every number that forward pass, backward pass and all backends must agree on, each with its reason.
#ifndef TG_LIMITS_H
#define TG_LIMITS_H
#include "shared/lang.h"
TG_NAMESPACE_BEGIN

const uint kTileSize = 16u;                   // [px] side of a screen tile, one workgroup per tile
const uint kBlockBits = 16u;                   // of a pair's key: one for each 4 x 4 pixels of a tile
const uint kMaxTiles = 65536u;                // what the key's other bits tell apart: 4096 x 4096 px
const float kAlphaMax = 0.99f;                // 3DGS: keeps 1-alpha away from 0 for the backward division
const float kAlphaMin = 1.0f / 255.0f;        // 3DGS: a contribution that 8 bits cannot show is skipped
const float kTransmittanceStop = 1e-4f;       // = (1 - kAlphaMax)^2: two opaque splats end a ray, before blending
const float kNear = 0.2f;                     // [world units] 3DGS near plane, for the mean's depth and for a hit's t
const float kTextureExtent = 3.0f;            // [sigma] a texture covers [-3,3]^2 (paper: clip at +-3 sigma)
const float kScreenVariance = 0.1f;           // [px^2] of the screen-space low-pass (Mip-Splatting)
const float kEllipsoidAmbient = 0.25f;        // share of the light that a lit ellipsoid gets edge-on
const float kCenterRadius = 1.5f;             // [px] of a dot at a Gaussian's mean
const float kShC0 = 0.28209479177387814f;     // sqrt(1/(4 pi))
const float kThinnest = 2e-9f;                // of an axis, in units of the longest one: as thin as float can show
const float kScaleMin = 1e-18f;               // [world units] a longest sigma below is a point, which no pixel meets,
const float kScaleMax = 1e18f;                // one above is everywhere alike: the squares of 1 / sigma leave float

// Texture modes and intersection models as they cross host and device (core has the enum classes).
const uint kModeNone = 0u;
const uint kModeAlpha = 1u;
const uint kModeRgb = 2u;
const uint kModeRgba = 3u;                    // = kModeAlpha | kModeRgb: the modes are bit sets
const uint kIntersectPlane = 0u;
const uint kIntersectMaxResponse = 1u;

// What is drawn of a textured Gaussian beyond its texture, likewise: the base alone, nothing, or the border's texels.
const uint kOutsideBase = 0u;
const uint kOutsideClip = 1u;
const uint kOutsideEdge = 2u;

// What of a Gaussian the Vulkan passes put on the screen.
const uint kShapeSplats = 0u;
const uint kShapeEllipsoids = 1u;
const uint kShapeCenters = 2u;

// Where blending takes a splat's texture from: nowhere, bilinear taps, or those faded to the mean.
const uint kSampleNone = 0u;
const uint kSampleBilinear = 1u;
const uint kSampleFootprint = 2u;

// How numbers become grey or heat in pictures for people.
const float kFarthestGrey = 0.15f;          // so that the farthest hit still differs from nothing at all
const float kLowestDensity = 1.0f / 64.0f;  // [texels / px] black
const float kHighestDensity = 4.0f;         // [texels / px] white

// Which image a renderer shows (render/settings.h has the enum class).
const uint kOutputFinal = 0u;
const uint kOutputBase = 1u;
const uint kOutputTexture = 2u;
const uint kOutputAlpha = 3u;
const uint kOutputDepth = 4u;
const uint kOutputNormal = 5u;
const uint kOutputCount = 6u;
const uint kOutputDepthMedian = 7u;
const uint kOutputOverdraw = 8u;
const uint kOutputEllipsoids = 9u;
const uint kOutputCenters = 10u;
const uint kOutputTexelDensity = 11u;

TG_NAMESPACE_END
#endif
