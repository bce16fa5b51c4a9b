// SPDX-License-Identifier: Apache-2.0
// SPZ inside glTF.
#include "converter/gltf/spz_extension.h"

#include <span>
#include <string>
#include <vector>

#include "converter/formats/spz.h"
#include "converter/gltf/axes.h"

namespace tg {
namespace {

// SPZ's axes are x right, y up, z back; the draft turns them half around y to glTF's. Its reader has given the model's.
void turnToGltf(GaussianModel& model) {
  const std::size_t count = model.shCount();
  for (std::size_t i = 0; i < model.size(); ++i) {
    model.mean[i] = turnAxes(model.mean[i]);
    model.rotation[i] = gltfFromModelRotation(model.rotation[i]);
    turnShAxes(std::span(model.sh).subspan(i * count, count));
  }
}

}  // namespace

const tinygltf::Value* findSpzExtension(const tinygltf::Value& splatting) {
  const std::string name(kSpzExtension);
  if (!splatting.Has("extensions") || !splatting.Get("extensions").Has(name)) return nullptr;
  return &splatting.Get("extensions").Get(name);
}

GaussianModel readSpzPrimitive(GltfDocument& document, const SplatPrimitive& splats, const tinygltf::Value* extension) {
  const std::string pointer =
      splats.pointer + "/extensions/" + std::string(kSplatExtension) + "/extensions/" + std::string(kSpzExtension);
  const auto& views = document.model.bufferViews;
  const bool is_index = extension && extension->Has("bufferView") && extension->Get("bufferView").IsInt();
  const int index = is_index ? extension->Get("bufferView").GetNumberAsInt() : -1;
  const std::string& named = document.spz_views.at(splats.pointer);
  const bool is_cut = std::to_string(index) != named;  // by TinyGLTF, to 32 bits
  if (index < 0 || static_cast<std::size_t>(index) >= views.size() || is_cut) {
    throw document.bad(pointer, "\"bufferView\" names no buffer view" +
                                    expectedFound("an index below " + std::to_string(views.size()), named));
  }
  const tinygltf::BufferView& view = views[static_cast<std::size_t>(index)];
  std::vector<std::uint8_t> bytes(view.byteLength);
  document.read(index, 0, bytes);
  Bundle loaded = parseSpz(bytes, document.path + ": " + pointer);
  if (loaded.model.size() != splats.count) {
    throw document.bad(pointer, "the count differs from POSITION's" + expectedFound(splats.count, loaded.model.size()));
  }
  for (const std::string& warning : loaded.warnings) document.warn(pointer, warning);
  turnToGltf(loaded.model);
  return std::move(loaded.model);
}

}  // namespace tg
