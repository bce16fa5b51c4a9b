// SPDX-License-Identifier: Apache-2.0
// SPZ inside glTF.
#include "converter/gltf/spz_extension.h"

#include <array>
#include <string>
#include <vector>

#include "converter/formats/spz.h"

namespace tg {
namespace {

// The half turn about y: (x, y, z) -> (-x, y, -z).
void turnAboutY(GaussianModel& model) {
  // Of degrees 0 to 3, order -l to l.
  constexpr std::array<float, 16> signs = {1, 1, -1, -1, -1, -1, 1, 1, 1, 1, 1, 1, -1, -1, -1, -1};
  const std::size_t count = model.shCount();
  for (std::size_t i = 0; i < model.size(); ++i) {
    glm::vec3& mean = model.mean[i];
    mean = {-mean.x, mean.y, -mean.z};
    glm::vec4& q = model.rotation[i];
    q = {-q.z, q.w, q.x, -q.y};  // (w, x, y, z) = (0, 0, 1, 0) * q
    for (std::size_t k = 0; k < count; ++k) model.sh[i * count + k] *= signs[k];
  }
}

}  // namespace

const tinygltf::Value* findSpzExtension(const tinygltf::Value& splatting) {
  const std::string name(kSpzExtension);
  if (!splatting.Has("extensions") || !splatting.Get("extensions").Has(name)) return nullptr;
  return &splatting.Get("extensions").Get(name);
}

GaussianModel readSpzPrimitive(GltfDocument& document, const SplatPrimitive& splats, const tinygltf::Value& extension) {
  const std::string pointer =
      splats.pointer + "/extensions/" + std::string(kSplatExtension) + "/extensions/" + std::string(kSpzExtension);
  const auto& views = document.model.bufferViews;
  const bool is_index = extension.IsObject() && extension.Has("bufferView") && extension.Get("bufferView").IsInt();
  const int index = is_index ? extension.Get("bufferView").GetNumberAsInt() : -1;
  if (index < 0 || static_cast<std::size_t>(index) >= views.size()) {
    throw document.bad(
        pointer, "\"bufferView\" names no buffer view (expected an index below " + std::to_string(views.size()) + ")");
  }
  const tinygltf::BufferView& view = views[static_cast<std::size_t>(index)];
  std::vector<std::uint8_t> bytes(view.byteLength);
  document.read(index, 0, bytes);
  Bundle loaded = parseSpz(bytes, document.path + ": " + pointer);
  if (loaded.model.size() != splats.count) {
    throw document.bad(pointer, "the count differs from POSITION's" + expectedFound(splats.count, loaded.model.size()));
  }
  for (const std::string& warning : loaded.warnings) document.warn(pointer, warning);
  turnAboutY(loaded.model);
  return std::move(loaded.model);
}

}  // namespace tg
