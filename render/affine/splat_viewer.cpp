// SPDX-License-Identifier: Apache-2.0
// What other people's viewers open, and what they do with a splat, as numbers.
#include "render/affine/splat_viewer.h"

#include <array>
#include <cstddef>

namespace tg {
namespace {

constexpr float kRoot8 = 2.82842712f;  // exp(-x^2 / 2) = exp(-4) there

// From the viewers' loaders, and what they showed of our files (docs/lab/browsers.md).
constexpr std::string_view kThreeOpens[] = {"ply", "splat", "spz", "glb", "gltf"};
constexpr std::string_view kPlayCanvasOpens[] = {"ply", "compressed.ply", "sog", "lod-meta.json", "glb", "gltf"};
constexpr std::string_view kBabylonOpens[] = {"ply", "compressed.ply", "splat", "spz",
                                              "sog", "lod-meta.json",  "glb",   "gltf"};
constexpr std::string_view kCesiumOpens[] = {"tileset.json"};
constexpr std::string_view kSparkOpens[] = {"ply", "compressed.ply", "splat", "spz", "sog"};

// Where a viewer works in half pixels, its 0.3 or 0.1 is a quarter of that in pixels, and where it works in doubled
// sigmas, too, a sixteenth.
constexpr std::array<ViewerProfile, kCount<SplatViewer>> kProfiles = {{
    {.program = "three.js 0.187.0",
     .source = "three: examples/jsm/objects/GaussianSplat.js, utils/GaussianSplatUtils.js",
     .blur = 0.3f,
     .compensated = true,
     .cut = 2.0f,
     .most_reach = 2048.0f,
     .guard = 1.4f,
     .near = 0.01f,
     .order = ViewerOrder::sphereBins,
     .opens = kThreeOpens},
    {.program = "PlayCanvas 2.23.3",
     .source = "playcanvas: src/scene/shader-lib/glsl/chunks/gsplat (gsplatCorner, gsplatCenter, gsplatCommon, gsplat, "
               "containerCompactWrite), src/scene/gsplat-unified/gsplat-params.js",
     .blur = 0.3f / 4,
     .least_variance = 0.1f / 4,
     .cut = kRoot8,
     .lifted = true,
     .most_reach = 1024.0f,
     .reach_in_picture = true,
     .least_reach = 1.0f,
     .least_alpha = 1.0f / 255,
     .premultiplied = true,
     .opens = kPlayCanvasOpens,
     .opens_meshopt = false},
    {.program = "Babylon.js 9.34.0",
     .source = "@babylonjs/core: Shaders/ShadersInclude/gaussianSplatting.js, Meshes/GaussianSplatting; "
               "@babylonjs/loaders 9.28.0: glTF/2.0/Extensions/KHR_gaussian_splatting",
     .blur = 0.3f / 4,
     .cut = kRoot8,
     .most_reach = 1024.0f,
     .guard = 1.2f,
     .near = 0.01f,
     .opens = kBabylonOpens},
    {.program = "CesiumJS 1.135 (@cesium/wasm-splats 0.1.0-alpha.2)",
     .source = "cesium: packages/engine/Source/Shaders/PrimitiveGaussianSplatVS.glsl, PrimitiveGaussianSplatFS.glsl",
     .blur = 0.3f / 16,
     .least_variance = 0.1f / 16,
     .cut = kRoot8,
     .square = true,
     .most_reach = 512.0f,
     .least_reach = 1.0f,
     .guard = 1.2f,
     .near = 0.01f,
     .premultiplied = true,
     .opens = kCesiumOpens},
    {.program = "Spark 2.2.0",
     .source = "@sparkjsdev/spark: splatVertex, splatFragment, packSplatEncoding, SparkRenderer's defaults",
     .blur = 0.3f,
     .compensated = true,
     .cut = kRoot8,
     .most_reach = 512.0f,
     .guard = 1.4f,
     .near = 0.01f,
     .least_alpha = 0.5f / 255,
     .premultiplied = true,
     .order = ViewerOrder::cameraRadius,
     .opens = kSparkOpens,
     .newest_spz = 3},
}};

}  // namespace

const ViewerProfile& profileOf(SplatViewer viewer) { return kProfiles[static_cast<std::size_t>(viewer)]; }

}  // namespace tg
