// SPDX-License-Identifier: Apache-2.0
// A model's textures as pictures and a list.
#include "converter/gltf/write_atlas.h"

#include <nlohmann/json.hpp>
#include <string>

#include "converter/gltf/quantize.h"
#include "core/file/atomic_files.h"
#include "core/file/file.h"
#include "core/image/png16.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "shared/limits.h"

namespace tg {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kMaxBakedSide = 4096;  // [texels]

}  // namespace

GltfReport writeAtlas(const std::filesystem::path& path, const GltfContent& content) {
  const GaussianModel& model = content.model;
  if (content.atlas == AtlasFormat::exr) throw Error(ErrorKind::usage, "a .png holds no EXR (expected png8 or png16)");
  const TextureMode mode = model.texture_mode;
  PackedAtlas packed = packAtlas(model.atlas, model.size(), kMaxBakedSide);
  if (mode == TextureMode::none || packed.pages.empty()) {
    throw Error(ErrorKind::badData, path.string(), "the model has no textures");
  }
  const int bits = content.atlas == AtlasFormat::png16 ? 16 : 8;
  const std::string stem = path.stem().string();
  GltfReport report;
  AtomicFiles files(content.replace);
  Json atlases = Json::array();
  const auto put = [&](const Image& image, const std::string& name) {
    const std::vector<std::uint8_t> png = bits == 16 ? encodePng16(image) : encodePng(image);
    files.add(path.parent_path() / name, png);
    report.bytes += png.size();
    return name;
  };
  for (std::size_t p = 0; p < packed.pages.size(); ++p) {
    const QuantizedPage page = quantizePage(packed.pages[p], bits);
    report.clipped_texels += page.clipped_texels;
    report.atlas_width = packed.pages[p].width;
    report.atlas_height = packed.pages[p].height;
    const std::string name = p == 0 ? stem : stem + "_" + std::to_string(p);
    Json atlas;
    // One image has the name that was asked for, whatever the mode.
    if (hasColor(mode)) atlas["color"] = put(page.color, name + ".png");
    if (hasAlpha(mode)) {
      atlas["alpha"] = put(page.alpha, name + (hasColor(mode) ? "_alpha" : "") + ".png");
    }
    atlas["scale"] = page.scale;
    atlas["offset"] = page.offset;
    atlases.push_back(std::move(atlas));
  }
  report.atlases = static_cast<int>(packed.pages.size());
  Json rectangles = Json::array();
  for (const AtlasPlacement& at : packed.placements) {
    report.texels += std::uint64_t{at.w} * at.h;
    rectangles.push_back({at.x, at.y, at.w, at.h, at.page});
  }
  const Json root = {
      {"mode", name(model.texture_mode)},
      {"intersection", name(model.intersection)},
      {"extent", double{kTextureExtent}},
      {"filter", "bilinear"},
      {"atlases", std::move(atlases)},
      {"rectangles", {{"columns", {"x", "y", "width", "height", "atlas"}}, {"rows", std::move(rectangles)}}}};
  const std::string text = root.dump() + "\n";
  files.add(path.parent_path() / (stem + ".json"),
            std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  files.commit();
  report.bytes += text.size();
  return report;
}

}  // namespace tg
