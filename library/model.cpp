// SPDX-License-Identifier: Apache-2.0
// Models: what callers hand in is checked as what files hold.
#include "textured_gaussians/model.h"

#include <algorithm>
#include <cstring>
#include <type_traits>

#include "converter/registry/file_format.h"
#include "library/access.h"
#include "textured_gaussians/version.h"

namespace textured_gaussians {
namespace {

static_assert(static_cast<int>(TextureMode::rgba) == static_cast<int>(tg::TextureMode::rgba));
static_assert(static_cast<int>(Intersection::maxResponse) == static_cast<int>(tg::IntersectionModel::maxResponse));
static_assert(static_cast<int>(TextureOutside::edge) == static_cast<int>(tg::TextureOutside::edge));
static_assert(static_cast<int>(ErrorKind::device) == static_cast<int>(tg::ErrorKind::device));

template <typename Value>
std::span<const float> floatsOf(const std::vector<Value>& values) {
  static_assert(sizeof(Value) % sizeof(float) == 0 && std::is_trivially_copyable_v<Value>);
  return {reinterpret_cast<const float*>(values.data()), values.size() * sizeof(Value) / sizeof(float)};
}

// `each` floats make a value. Throws tg::Error for a count that is no multiple of it.
template <typename Value>
std::vector<Value> valuesOf(const std::vector<float>& floats, const char* name) {
  constexpr std::size_t each = sizeof(Value) / sizeof(float);
  if (floats.size() % each != 0) {
    throw tg::Error(tg::ErrorKind::badData, "model",
                    std::string(name) + ": no whole number of values (expected a multiple of " + std::to_string(each) +
                        " floats, found " + std::to_string(floats.size()) + ")");
  }
  std::vector<Value> values(floats.size() / each);
  if (!floats.empty()) std::memcpy(static_cast<void*>(values.data()), floats.data(), floats.size() * sizeof(float));
  return values;
}

// Of a model of n Gaussians. Throws tg::Error(badData).
void requireLengths(const ModelData& data, std::size_t n) {
  const auto require = [](std::size_t found, std::size_t expected, const char* name) {
    if (found != expected) {
      throw tg::Error(tg::ErrorKind::badData, "model",
                      std::string(name) + ": wrong length" + tg::expectedFound(expected, found));
    }
  };
  require(data.rotations.size(), 4 * n, "rotations");
  require(data.log_scales.size(), 3 * n, "log_scales");
  require(data.opacity_logits.size(), n, "opacity_logits");
  require(data.sh.size(), 3 * tg::shCountOf(data.sh_degree) * n, "sh");
  if (!data.texture_rects.empty()) require(data.texture_rects.size(), n, "texture_rects");
}

// Whatever one of the three says alone would be lost without a word. Throws tg::Error(badData).
void requireWholeTextures(const ModelData& data, std::size_t n) {
  const auto refuse = [](const std::string& what) { throw tg::Error(tg::ErrorKind::badData, "model", what); };
  const std::string found = data.texels.empty() ? "texture_rects" : "texels";
  if (data.texture_mode == TextureMode::none && !(data.texels.empty() && data.texture_rects.empty())) {
    refuse("texture_mode: none beside " + found + " (expected alpha, rgb or rgba)");
  }
  if (n > 0 && !data.texels.empty() && data.texture_rects.empty()) {
    refuse("texels: without texture_rects (expected one a Gaussian)");
  }
  const auto textured = [](const TextureRect& rect) { return rect.width > 0 && rect.height > 0; };
  if (data.texels.empty() && std::ranges::any_of(data.texture_rects, textured)) {
    refuse("texture_rects: without texels (expected those that they name)");
  }
}

std::vector<float> copyOf(std::span<const float> floats) { return {floats.begin(), floats.end()}; }

}  // namespace

const char* version() { return TG_VERSION; }

Model Access::model(tg::Bundle bundle) {
  return Model(std::make_shared<const Model::Parts>(Model::Parts{std::move(bundle)}));
}

Model::Model(const ModelData& data)
    : parts_(guarded([&] {
        tg::Bundle bundle;
        tg::GaussianModel& model = bundle.model;
        if (data.sh_degree < 0 || data.sh_degree > 3) {
          throw tg::Error(tg::ErrorKind::badData, "model",
                          "no such SH degree (expected 0 to 3, found " + std::to_string(data.sh_degree) + ")");
        }
        model.sh_degree = data.sh_degree;
        model.texture_mode = modeOf(data.texture_mode);
        model.intersection =
            enumOf<tg::IntersectionModel>(data.intersection, Intersection::maxResponse, "intersection");
        model.outside = enumOf<tg::TextureOutside>(data.outside, TextureOutside::edge, "outside");
        model.mean = valuesOf<glm::vec3>(data.means, "means");
        requireLengths(data, model.size());
        requireWholeTextures(data, model.size());
        // Files have the quaternion's real part first, as .x.
        model.rotation = valuesOf<glm::vec4>(data.rotations, "rotations");
        model.log_scale = valuesOf<glm::vec3>(data.log_scales, "log_scales");
        model.opacity_logit = data.opacity_logits;
        model.sh = valuesOf<glm::vec3>(data.sh, "sh");
        model.atlas.texels = valuesOf<glm::vec4>(data.texels, "texels");
        model.atlas.rects.reserve(data.texture_rects.size());
        for (const TextureRect& rect : data.texture_rects) {
          model.atlas.rects.push_back({rect.offset, rect.width, rect.height});
        }
        tg::checkModel(model, "model");
        if (!allFinite(data.background)) {
          throw tg::Error(tg::ErrorKind::badData, "model", "background: is not finite");
        }
        bundle.background = colorOf(data.background);
        for (const Camera& camera : data.cameras) bundle.cameras.push_back(cameraOf(camera));
        return std::make_shared<const Parts>(Parts{std::move(bundle)});
      })) {}

Model Model::load(const std::filesystem::path& path) {
  return guarded([&] {
    requirePath(path);
    return Access::model(tg::readModel(path));
  });
}

std::vector<std::string> Model::save(const std::filesystem::path& path) const {
  return guarded([&] {
    requirePath(path);
    const tg::Format& format = tg::modelFormat(path);
    tg::Written written;
    tg::writeModel(format, path, parts_->bundle, {}, written);
    return written.warnings;
  });
}

std::size_t Model::size() const { return parts_->bundle.model.size(); }
int Model::shDegree() const { return parts_->bundle.model.sh_degree; }
TextureMode Model::textureMode() const { return static_cast<TextureMode>(parts_->bundle.model.texture_mode); }
Intersection Model::intersection() const { return static_cast<Intersection>(parts_->bundle.model.intersection); }
TextureOutside Model::outside() const { return static_cast<TextureOutside>(parts_->bundle.model.outside); }
std::array<float, 3> Model::background() const { return colorOf(parts_->bundle.background); }
std::vector<std::string> Model::warnings() const { return parts_->bundle.warnings; }

std::vector<Camera> Model::cameras() const {
  std::vector<Camera> cameras;
  for (const tg::Camera& camera : parts_->bundle.cameras) cameras.push_back(cameraOf(camera));
  return cameras;
}

std::vector<TextureRect> Model::textureRects() const {
  std::vector<TextureRect> rects;
  rects.reserve(parts_->bundle.model.atlas.rects.size());
  for (const tg::TextureRect& rect : parts_->bundle.model.atlas.rects) {
    rects.push_back({rect.offset, rect.width, rect.height});
  }
  return rects;
}

std::span<const float> Model::means() const { return floatsOf(parts_->bundle.model.mean); }
std::span<const float> Model::rotations() const { return floatsOf(parts_->bundle.model.rotation); }
std::span<const float> Model::logScales() const { return floatsOf(parts_->bundle.model.log_scale); }
std::span<const float> Model::opacityLogits() const { return floatsOf(parts_->bundle.model.opacity_logit); }
std::span<const float> Model::sh() const { return floatsOf(parts_->bundle.model.sh); }
std::span<const float> Model::texels() const { return floatsOf(parts_->bundle.model.atlas.texels); }

ModelData Model::data() const {
  ModelData data;
  data.means = copyOf(means());
  data.rotations = copyOf(rotations());
  data.log_scales = copyOf(logScales());
  data.opacity_logits = copyOf(opacityLogits());
  data.sh = copyOf(sh());
  data.sh_degree = shDegree();
  data.texture_mode = textureMode();
  data.intersection = intersection();
  data.outside = outside();
  data.texture_rects = textureRects();
  data.texels = copyOf(texels());
  data.cameras = cameras();
  data.background = background();
  return data;
}

}  // namespace textured_gaussians
