// SPDX-License-Identifier: Apache-2.0
// Writes a model as GLB.
#include "converter/write_gltf.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "converter/axes.h"
#include "converter/fallback.h"
#include "converter/gltf_cameras.h"
#include "converter/gltf_document.h"
#include "converter/gltf_numbers.h"
#include "converter/plane_order.h"
#include "converter/quantize.h"
#include "converter/repair.h"
#include "core/error.h"
#include "core/file.h"
#include "shared/limits.h"

namespace tg {
namespace {

using tinygltf::Value;

constexpr int kMaxAtlasSide = 4096;                                 // [texels] what every WebGL 2 device can load
constexpr std::uint64_t kMaxGlbBytes = 0xFFFFFFFFull - (1u << 20);  // the header's 32 bits, less room for the JSON
constexpr const char* kGenerator = "Textured Gaussians tgconvert";

std::string attributeName(std::string_view extension, const std::string& name) {
  return std::string(extension) + ":" + name;
}

// IEC 61966-2-1; colours of COLOR_0 are linear by glTF's rule.
double linearFromSrgb(double c) { return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4); }

// Appends to one buffer, one view per attribute or image.
class Writer {
 public:
  explicit Writer(const std::string& path) : path_(path) { model.buffers.emplace_back(); }

  // fill(i, out) writes `components` values of type T for element i. Elements are padded to 4 bytes (glTF's rule).
  template <typename T, typename Fill>
  int addAccessor(int gltf_type, int component_type, bool normalized, std::size_t count, Fill fill) {
    const int components = tinygltf::GetNumComponentsInType(gltf_type);
    const std::size_t element = components * sizeof(T);
    const std::size_t stride = (element + 3) / 4 * 4;
    unsigned char* to = grow(count * stride);
    std::vector<T> values(components);
    for (std::size_t i = 0; i < count; ++i, to += stride) {
      fill(i, values.data());
      std::memcpy(to, values.data(), element);
    }
    model.bufferViews.back().target = TINYGLTF_TARGET_ARRAY_BUFFER;
    if (stride != element) model.bufferViews.back().byteStride = stride;
    tinygltf::Accessor accessor;
    accessor.bufferView = static_cast<int>(model.bufferViews.size()) - 1;
    accessor.componentType = component_type;
    accessor.normalized = normalized;
    accessor.count = count;
    accessor.type = gltf_type;
    model.accessors.push_back(std::move(accessor));
    return static_cast<int>(model.accessors.size()) - 1;
  }
  template <typename Fill>
  int addFloats(int gltf_type, std::size_t count, Fill fill) {
    return addAccessor<float>(gltf_type, TINYGLTF_COMPONENT_TYPE_FLOAT, false, count, fill);
  }

  // Returns the index of a texture that shows it.
  int addPng(const std::vector<std::uint8_t>& bytes, const std::string& name) {
    std::memcpy(grow(bytes.size()), bytes.data(), bytes.size());
    tinygltf::Image image;
    image.name = name;
    image.mimeType = "image/png";
    image.bufferView = static_cast<int>(model.bufferViews.size()) - 1;
    model.images.push_back(std::move(image));
    tinygltf::Texture texture;
    texture.source = static_cast<int>(model.images.size()) - 1;
    texture.sampler = 0;
    model.textures.push_back(std::move(texture));
    return static_cast<int>(model.textures.size()) - 1;
  }

  tinygltf::Model model;

 private:
  // Room for a new view of `bytes` bytes, 4-byte aligned, zero-filled.
  unsigned char* grow(std::size_t bytes) {
    std::vector<unsigned char>& data = model.buffers.front().data;
    const std::size_t offset = (data.size() + 3) / 4 * 4;
    if (offset + bytes > kMaxGlbBytes) {
      throw Error(ErrorKind::badData, path_, "the model does not fit a GLB (expected at most 4 GiB)");
    }
    data.resize(offset + bytes);
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = offset;
    view.byteLength = bytes;
    model.bufferViews.push_back(std::move(view));
    return data.data() + offset;
  }

  std::string path_;
};

using Attributes = std::map<std::string, int>;

void addPositions(Writer& writer, const GaussianModel& model, Attributes& attributes) {
  glm::vec3 low(std::numeric_limits<float>::max());
  glm::vec3 high(std::numeric_limits<float>::lowest());
  attributes["POSITION"] = writer.addFloats(TINYGLTF_TYPE_VEC3, model.size(), [&](std::size_t i, float* out) {
    const glm::vec3 p = turnAxes(model.mean[i]);
    low = glm::min(low, p);
    high = glm::max(high, p);
    std::memcpy(out, &p, sizeof(p));
  });
  writer.model.accessors.back().minValues = {low.x, low.y, low.z};
  writer.model.accessors.back().maxValues = {high.x, high.y, high.z};
}

// Rotation and scale; local axes in the order of the texture extension when it is there.
void addShape(Writer& writer, const GaussianModel& model, bool textured, Attributes& attributes) {
  std::vector<glm::vec3> log_scale = model.log_scale;
  std::vector<glm::vec4> rotation = model.rotation;
  if (textured) orderAxesForGltf(log_scale, rotation);
  attributes[attributeName(kSplatExtension, "ROTATION")] =
      writer.addFloats(TINYGLTF_TYPE_VEC4, model.size(), [&](std::size_t i, float* out) {
        const glm::vec4 q = gltfRotation(rotation[i]);
        const float xyzw[4] = {q.y, q.z, q.w, q.x};
        std::memcpy(out, xyzw, sizeof(xyzw));
      });
  attributes[attributeName(kSplatExtension, "SCALE")] =
      writer.addFloats(TINYGLTF_TYPE_VEC3, model.size(), [&](std::size_t i, float* out) {
        const glm::vec3 scale = gltfScale(log_scale[i]);
        std::memcpy(out, &scale, sizeof(scale));
      });
}

// What of a Gaussian a reader of the glTF numbers gets back with other last bits.
struct Changed {
  bool rotation = false, log_scale = false, opacity = false;
};

Changed changedByGltf(const GaussianModel& model, bool textured) {
  Changed changed;
  for (std::size_t i = 0; i < model.size(); ++i) {
    glm::vec3 log_scale = model.log_scale[i];
    glm::vec4 q = model.rotation[i];
    if (textured) orderAxesForGltf(log_scale, q);
    log_scale = logFromScale(gltfScale(log_scale));
    q = modelFromGltfRotation(gltfRotation(q));
    if (textured && model.atlas.rects[i].texelCount() != 0) orderAxesForModel(log_scale, q);
    const float logit = logitFromOpacity(gltfOpacity(model.opacity_logit[i]));
    changed.rotation = changed.rotation || std::memcmp(&q, &model.rotation[i], sizeof(q)) != 0;
    changed.log_scale = changed.log_scale || std::memcmp(&log_scale, &model.log_scale[i], sizeof(log_scale)) != 0;
    changed.opacity = changed.opacity || std::memcmp(&logit, &model.opacity_logit[i], sizeof(logit)) != 0;
  }
  return changed;
}

// The numbers the model came with, beside those glTF has words for. An attribute is left out where nothing would
// change.
void addSource(Writer& writer, const GaussianModel& model, bool textured, Attributes& attributes) {
  const Changed changed = changedByGltf(model, textured);
  if (changed.rotation) {
    attributes[kSourceRotation] = writer.addFloats(TINYGLTF_TYPE_VEC4, model.size(), [&](std::size_t i, float* out) {
      std::memcpy(out, &model.rotation[i], sizeof(model.rotation[i]));
    });
  }
  if (changed.log_scale) {
    attributes[kSourceLogScale] = writer.addFloats(TINYGLTF_TYPE_VEC3, model.size(), [&](std::size_t i, float* out) {
      std::memcpy(out, &model.log_scale[i], sizeof(model.log_scale[i]));
    });
  }
  if (changed.opacity) {
    attributes[kSourceLogit] = writer.addFloats(TINYGLTF_TYPE_SCALAR, model.size(),
                                                [&](std::size_t i, float* out) { *out = model.opacity_logit[i]; });
  }
}

void addOpacity(Writer& writer, const GaussianModel& model, std::string_view extension, Attributes& attributes) {
  attributes[attributeName(extension, "OPACITY")] =
      writer.addFloats(TINYGLTF_TYPE_SCALAR, model.size(),
                       [&](std::size_t i, float* out) { *out = gltfOpacity(model.opacity_logit[i]); });
}

void addColors(Writer& writer, const GaussianModel& model, Attributes& attributes) {
  const std::size_t count = model.shCount();
  for (int l = 0, k = 0; l <= model.sh_degree; ++l) {
    for (int m = 0; m <= 2 * l; ++m, ++k) {
      // Signs of the half turn: functions of even index are even in (x, y).
      const float sign = k % 2 == 0 ? 1.0f : -1.0f;
      const std::string name = "SH_DEGREE_" + std::to_string(l) + "_COEF_" + std::to_string(m);
      attributes[attributeName(kSplatExtension, name)] =
          writer.addFloats(TINYGLTF_TYPE_VEC3, model.size(), [&](std::size_t i, float* out) {
            const glm::vec3 coefficient = sign * model.sh[i * count + k];
            std::memcpy(out, &coefficient, sizeof(coefficient));
          });
    }
  }
  attributes["COLOR_0"] = writer.addAccessor<std::uint16_t>(
      TINYGLTF_TYPE_VEC4, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, true, model.size(),
      [&](std::size_t i, std::uint16_t* out) {
        for (int c = 0; c < 4; ++c) {
          const double value = c == 3
                                   ? gltfOpacity(model.opacity_logit[i])
                                   : linearFromSrgb(std::clamp(0.5 + double{kShC0} * model.sh[i * count][c], 0.0, 1.0));
          out[c] = static_cast<std::uint16_t>(std::lround(value * 65535.0));
        }
      });
}

Value numbers(const std::array<double, 4>& values) {
  Value::Array list;
  for (const double v : values) list.emplace_back(v);
  return Value(std::move(list));
}

// Atlases, rectangles and the values to use with them. Returns the extension object.
Value addTextures(Writer& writer, const GaussianModel& model, Attributes& attributes, GltfReport& report) {
  const unsigned mode = static_cast<unsigned>(model.texture_mode);
  PackedAtlas packed = packAtlas(model.atlas, model.size(), kMaxAtlasSide);
  attributes[attributeName(kTextureExtension, "RECT")] =
      writer.addAccessor<std::uint16_t>(TINYGLTF_TYPE_VEC4, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, false, model.size(),
                                        [&](std::size_t i, std::uint16_t* out) {
                                          const AtlasPlacement& p = packed.placements[i];
                                          const std::uint16_t rect[4] = {p.x, p.y, p.w, p.h};
                                          std::memcpy(out, rect, sizeof(rect));
                                        });
  if (packed.pages.size() > 1) {
    attributes[attributeName(kTextureExtension, "ATLAS")] = writer.addAccessor<std::uint8_t>(
        TINYGLTF_TYPE_SCALAR, TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, false, model.size(),
        [&](std::size_t i, std::uint8_t* out) { *out = packed.placements[i].page; });
  }
  if ((mode & kModeAlpha) != 0) addOpacity(writer, model, kTextureExtension, attributes);
  if ((mode & kModeRgb) != 0) {
    attributes[attributeName(kTextureExtension, "SH_DEGREE_0_COEF_0")] = writer.addFloats(
        TINYGLTF_TYPE_VEC3, model.size(),
        [&](std::size_t i, float* out) { std::memcpy(out, &model.sh[i * model.shCount()], sizeof(glm::vec3)); });
  }

  tinygltf::Sampler sampler;
  sampler.magFilter = TINYGLTF_TEXTURE_FILTER_LINEAR;
  sampler.minFilter = TINYGLTF_TEXTURE_FILTER_LINEAR;
  sampler.wrapS = TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE;
  sampler.wrapT = TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE;
  writer.model.samplers.push_back(sampler);
  Value::Array atlases;
  for (std::size_t p = 0; p < packed.pages.size(); ++p) {
    for (glm::vec4& texel : packed.pages[p].texels) {  // terms that the mode lacks do not count
      if ((mode & kModeRgb) == 0) texel = glm::vec4(0.0f, 0.0f, 0.0f, texel.a);
      if ((mode & kModeAlpha) == 0) texel.a = 1.0f;
    }
    const QuantizedPage page = quantizePage(packed.pages[p]);
    report.atlas_width = packed.pages[p].width;
    report.atlas_height = packed.pages[p].height;
    packed.pages[p].texels = {};
    report.clipped_texels += page.clipped_texels;
    Value::Object atlas;
    const std::string name = "atlas_" + std::to_string(p);
    if ((mode & kModeRgb) != 0) atlas["color"] = Value(writer.addPng(encodePng(page.color), name + "_color"));
    if ((mode & kModeAlpha) != 0) atlas["alpha"] = Value(writer.addPng(encodePng(page.alpha), name + "_alpha"));
    atlas["scale"] = numbers(page.scale);
    atlas["offset"] = numbers(page.offset);
    atlases.emplace_back(std::move(atlas));
  }
  report.atlases = static_cast<int>(packed.pages.size());
  for (const AtlasPlacement& p : packed.placements) report.texels += std::uint64_t{p.w} * p.h;

  Value::Object extension;
  extension["mode"] = Value(std::string(name(model.texture_mode)));
  extension["intersection"] = Value(std::string(name(model.intersection)));
  extension["extent"] = Value(double{kTextureExtent});
  extension["filter"] = Value(std::string("bilinear"));
  extension["atlases"] = Value(std::move(atlases));
  return Value(std::move(extension));
}

// The root, nodes and the primitive around the attributes.
void addScene(tinygltf::Model& gltf, const GltfContent& content, Attributes attributes, Value::Object nested) {
  Value::Object splatting;
  splatting["kernel"] = Value(std::string("ellipse"));
  splatting["colorSpace"] = Value(std::string("srgb_rec709_display"));
  gltf.extensionsUsed.emplace_back(kSplatExtension);
  if (!nested.empty()) {
    gltf.extensionsUsed.emplace_back(kTextureExtension);
    splatting["extensions"] = Value(std::move(nested));
  }
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_POINTS;
  primitive.attributes = std::move(attributes);
  primitive.extensions[std::string(kSplatExtension)] = Value(std::move(splatting));
  tinygltf::Mesh mesh;
  mesh.primitives.push_back(std::move(primitive));
  gltf.meshes.push_back(std::move(mesh));
  tinygltf::Node node;
  node.name = "gaussians";
  node.mesh = 0;
  gltf.nodes.push_back(std::move(node));
  gltf.scenes.emplace_back();
  gltf.scenes.front().nodes = {0};
  gltf.defaultScene = 0;
  addCameras(gltf, content.cameras);

  Value::Object ours;
  ours["intersection"] = Value(std::string(name(content.model.intersection)));
  Value::Array background;
  for (int c = 0; c < 3; ++c) background.emplace_back(double{content.background[c]});
  ours["background"] = Value(std::move(background));
  gltf.asset.version = "2.0";
  gltf.asset.generator = kGenerator;
  gltf.asset.extras = Value(Value::Object{{kExtrasKey, Value(std::move(ours))}});
}

}  // namespace

GltfReport writeGlb(const std::filesystem::path& path, const GltfContent& content) {
  const GaussianModel& model = content.model;
  if (model.size() == 0) throw Error(ErrorKind::badData, path.string(), "the model has no Gaussians");
  const bool textured =
      model.texture_mode != TextureMode::none && std::any_of(model.atlas.rects.begin(), model.atlas.rects.end(),
                                                             [](const TextureRect& r) { return r.texelCount() != 0; });
  GltfReport report;
  Writer writer(path.string());
  Attributes attributes;
  addPositions(writer, model, attributes);
  addShape(writer, model, textured, attributes);
  Value::Object nested;
  if (textured) {
    {
      const GaussianModel base = bakeFallback(model);
      addOpacity(writer, base, kSplatExtension, attributes);
      addColors(writer, base, attributes);
    }
    nested[std::string(kTextureExtension)] = addTextures(writer, model, attributes, report);
  } else {
    addOpacity(writer, model, kSplatExtension, attributes);
    addColors(writer, model, attributes);
  }
  if (!content.lean) addSource(writer, model, textured, attributes);
  addScene(writer.model, content, std::move(attributes), std::move(nested));

  writeFileAtomically(path, [&](const std::filesystem::path& temporary) {
    std::ofstream stream(temporary, std::ios::binary | std::ios::trunc);
    tinygltf::TinyGLTF gltf;
    bool ok = false;
    std::string why = "the disk is full or not writable";
    try {
      ok = stream.good() && gltf.WriteGltfSceneToStream(&writer.model, stream, false, true);
    } catch (const std::exception& exception) {
      why = exception.what();
    }
    stream.close();
    if (!ok || stream.fail()) throw Error(ErrorKind::cannotWrite, path.string(), "cannot be written: " + why);
    report.bytes = std::filesystem::file_size(temporary);
  });
  return report;
}

}  // namespace tg
