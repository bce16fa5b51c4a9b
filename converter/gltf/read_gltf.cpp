// SPDX-License-Identifier: Apache-2.0
// Reads glTF and GLB files with KHR_gaussian_splatting, with or without our texture extension.
#include "converter/gltf/read_gltf.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string_view>

#include "converter/formats/repair.h"
#include "converter/gltf/accessor.h"
#include "converter/gltf/axes.h"
#include "converter/gltf/cameras.h"
#include "converter/gltf/core_rules.h"
#include "converter/gltf/document.h"
#include "converter/gltf/document_check.h"
#include "converter/gltf/extension_lists.h"
#include "converter/gltf/gltf_json.h"
#include "converter/gltf/json_members.h"
#include "converter/gltf/linear_colors.h"
#include "converter/gltf/nodes.h"
#include "converter/gltf/numbers.h"
#include "converter/gltf/spz_extension.h"
#include "converter/gltf/texture_layer.h"
#include "core/bundle/ply.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"

namespace tg {
namespace {

using nlohmann::json;

constexpr std::size_t kInstanceBlock = 16384;  // splats whose numbers are held beside the model
constexpr float kNormTolerance = 1e-3f;        // of |q|^2 from 1
constexpr float kByteNormTolerance = 2e-2f;    // 8-bit quaternions are off by their rounding alone
constexpr int kMaxGltfDegree = 3;

struct SplatInstance {
  SplatPrimitive splats;
  RigidScale place;
  int node = 0;
  int degree = 0;
  bool linear = false;  // its colours
  bool log_scales = false;
  std::optional<GaussianModel> packed;  // an SPZ's splats, which stand for the attributes
};

// Numbers of a primitive's splats as stored, lengths range.count x components.
struct BaseArrays {
  SplatRange range;
  std::vector<float> position, rotation, scale, opacity;
  std::vector<std::vector<float>> sh;                                  // [coefficient][count * 3]
  bool byte_rotation = false;                                          // stored in 8 bit
  std::vector<float> source_rotation, source_log_scale, source_logit;  // empty where the file has none
};

// What had to be put right, in Gaussians.
struct Repairs {
  std::size_t rotation = 0, opacity = 0, scale = 0, dropped = 0, plane = 0;
};

std::string splatName(std::string_view attribute) {
  return std::string(kSplatExtension) + ":" + std::string(attribute);
}

std::string coefficientName(int degree, int k) {
  return splatName("SH_DEGREE_" + std::to_string(degree) + "_COEF_" + std::to_string(k));
}

// The highest complete degree. Throws when a degree has gaps or stands on a missing one.
int findDegree(const GltfDocument& document, const SplatPrimitive& splats) {
  int degree = 0;
  for (int l = 1; l <= kMaxGltfDegree; ++l) {
    int present = 0;
    std::string missing;
    for (int k = 0; k <= 2 * l; ++k) {
      const std::string name = coefficientName(l, k);
      if (splats.has(name)) {
        ++present;
      } else if (missing.empty()) {
        missing = name;
      }
    }
    if (present == 0) continue;
    if (!missing.empty()) {
      throw document.bad(splats.pointer + "/attributes",
                         "SH degree " + std::to_string(l) + " is incomplete: " + missing + " is missing");
    }
    if (degree != l - 1) {
      throw document.bad(splats.pointer + "/attributes",
                         "SH degree " + std::to_string(l) + " stands without degree " + std::to_string(l - 1));
    }
    degree = l;
  }
  return degree;
}

bool hasHigherDegree(const SplatPrimitive& splats) {
  const std::string prefix = splatName("SH_DEGREE_");
  return std::ranges::any_of(splats.primitive->attributes, [&](const auto& attribute) {
    int degree = 0;
    const char *at = attribute.first.data(), *end = at + attribute.first.size();
    return attribute.first.starts_with(prefix) && std::from_chars(at + prefix.size(), end, degree).ec == std::errc() &&
           degree > kMaxGltfDegree;
  });
}

void checkExtensionPlaces(const GltfDocument& document) {
  const std::string ours(kTextureExtension);
  for (const std::string& pointer : document.hollow_layers) {
    document.attempt([&] { throw document.bad(pointer, "is no object with a \"mode\""); });
  }
  const auto refuse = [&](const tinygltf::ExtensionMap& extensions, const std::string& pointer) {
    if (extensions.count(ours) == 0) return;
    document.attempt([&] {
      throw document.bad(pointer + "/extensions/" + ours,
                         "wrong place (expected inside " + std::string(kSplatExtension) + ")");
    });
  };
  refuse(document.model.extensions, "");
  for (std::size_t m = 0; m < document.model.meshes.size(); ++m) {
    const tinygltf::Mesh& mesh = document.model.meshes[m];
    const std::string pointer = "/meshes/" + std::to_string(m);
    refuse(mesh.extensions, pointer);
    for (std::size_t p = 0; p < mesh.primitives.size(); ++p) {
      refuse(mesh.primitives[p].extensions, pointer + "/primitives/" + std::to_string(p));
    }
  }
}

// The Khronos extension object itself.
void checkSplatExtension(GltfDocument& document, const SplatPrimitive& splats, const tinygltf::Value& extension) {
  const std::string pointer = splats.pointer + "/extensions/" + std::string(kSplatExtension);
  const auto text = [&](const char* key) {
    return extension.Has(key) && extension.Get(key).IsString() ? extension.Get(key).Get<std::string>() : std::string();
  };
  const auto has = [&](const char* key) {
    return extension.Has(key) || document.wrong_types.contains(pointer + "/" + key);
  };
  const auto wrongType = [&](const char* key) {
    return "wrong type of \"" + std::string(key) + "\"" +
           expectedFound("a string", document.wrong_types.at(pointer + "/" + key));
  };
  const auto word = [&](const char* key, const std::string& otherwise) {
    if (!has(key)) return otherwise;
    if (extension.Has(key) && extension.Get(key).IsString()) return extension.Get(key).Get<std::string>();
    document.mend(pointer, wrongType(key), "taken for " + otherwise);
    return otherwise;
  };
  const tinygltf::Primitive& primitive = *splats.primitive;
  if (primitive.attributes.count("_ROTATION") != 0 || primitive.attributes.count("_SCALE") != 0) {
    throw document.bad(splats.pointer, "a pre-release draft of " + std::string(kSplatExtension) +
                                           " (attributes _ROTATION, _SCALE) is not supported");
  }
  document.attempt([&] {
    if (primitive.mode == TINYGLTF_MODE_POINTS) return;
    throw document.bad(splats.pointer + "/mode",
                       "wrong mode for splats (expected 0, POINTS, found " + std::to_string(primitive.mode) + ")");
  });
  const bool packed = document.spz_views.contains(splats.pointer);
  if (packed && !has("kernel")) {
    document.warn(pointer, "no \"kernel\", taken for ellipse: the SPZ draft's files have none");
  }
  document.attempt([&] {
    if (text("kernel") == "ellipse" || (packed && !has("kernel"))) return;
    const bool layered = extension.Has("extensions") && extension.Get("extensions").Has(std::string(kTextureExtension));
    if (!text("kernel").empty() && !layered) {  // as KHR_gaussian_splatting has it
      document.warn(pointer, "unknown \"kernel\", taken for ellipse: found \"" + text("kernel") + "\"");
      return;
    }
    if (!has("kernel")) throw document.bad(pointer, "\"kernel\" is missing (expected \"ellipse\")");
    if (document.wrong_types.contains(pointer + "/kernel")) throw document.bad(pointer, wrongType("kernel"));
    throw document.bad(pointer, "\"kernel\" is not supported (expected \"ellipse\", found \"" + text("kernel") + "\")");
  });
  const std::string encoded = "srgb_rec709_display";
  if (!has("colorSpace") && !packed) {
    document.mend(pointer, "\"colorSpace\" is missing (expected \"srgb_rec709_display\" or \"lin_rec709_display\")",
                  "taken for " + encoded);
  }
  if (const std::string space = word("colorSpace", encoded); space == "lin_rec709_display") {
    document.warn(pointer,
                  "colours of linear light: turned to sRGB Gaussian by Gaussian, which blends a little differently");
  } else if (space != encoded) {
    document.warn(pointer, "unknown colorSpace \"" + space + "\", taken for " + encoded);
  }
  for (const auto& [key, known] : {std::pair{"projection", "perspective"}, {"sortingMethod", "cameraDistance"}}) {
    if (const std::string found = word(key, known); found != known) {
      document.warn(pointer, "unknown " + std::string(key) + " \"" + found + "\", taken for " + known);
    }
  }
  if (!extension.Has("extensions") || !extension.Get("extensions").IsObject()) return;
  for (const std::string& name : extension.Get("extensions").Keys()) {
    if (name == kTextureExtension || name == kSpzExtension) continue;
    if (name.find("compression") != std::string::npos) {
      throw document.bad(pointer + "/extensions/" + name,
                         "this compression of splats is not supported (" + std::string(kSpzExtension) + " is)");
    }
    document.warn(pointer + "/extensions/" + name, "unknown extension, ignored");
  }
}

std::vector<SplatInstance> findSplats(GltfDocument& document, const std::vector<PlacedNode>& nodes) {
  std::vector<SplatInstance> instances;
  const tinygltf::Model& model = document.model;
  std::size_t total = 0;
  if (model.scenes.size() > 1) document.warn("/scenes", "one scene is read, the default or first one");
  for (const PlacedNode& placed : nodes) {
    const int mesh = model.nodes[placed.node].mesh;
    if (mesh < 0) continue;
    for (std::size_t p = 0; p < model.meshes[mesh].primitives.size(); ++p) {
      document.attempt([&] {
        SplatInstance instance;
        instance.splats.primitive = &model.meshes[mesh].primitives[p];
        instance.splats.pointer = "/meshes/" + std::to_string(mesh) + "/primitives/" + std::to_string(p);
        const auto& extensions = instance.splats.primitive->extensions;
        const auto found = extensions.find(std::string(kSplatExtension));
        const std::string pointer = instance.splats.pointer + "/extensions/" + std::string(kSplatExtension);
        if (const auto wrong = document.wrong_types.find(pointer); wrong != document.wrong_types.end()) {
          throw document.bad(pointer, "wrong type" + expectedFound("an object", wrong->second));
        }
        if (found == extensions.end()) {
          document.warn(instance.splats.pointer, "no " + std::string(kSplatExtension) + ", ignored");
          return;
        }
        checkSplatExtension(document, instance.splats, found->second);
        const auto position = instance.splats.primitive->attributes.find("POSITION");
        if (position == instance.splats.primitive->attributes.end()) {
          throw document.bad(instance.splats.pointer + "/attributes", "the attribute POSITION is missing");
        }
        const tinygltf::Accessor& accessor = model.accessors[position->second];
        const bool bounded = !accessor.minValues.empty() && !accessor.maxValues.empty();
        if (!bounded && document.errors == nullptr) {  // tgconvert check has an error of its own for it
          document.warn(instance.splats.pointer + "/attributes/POSITION", "no min and max");
        }
        if (instance.splats.primitive->indices >= 0) {
          document.warn(instance.splats.pointer + "/indices", "ignored: every splat is read");
        }
        instance.splats.count = accessor.count;
        total += accessor.count;
        if (accessor.count > kMaxGaussians || total > kMaxGaussians) {
          throw document.bad(instance.splats.pointer, "too many splats" + atMost(kMaxGaussians, total));
        }
        if (document.spz_views.contains(instance.splats.pointer)) {
          instance.packed = readSpzPrimitive(document, instance.splats, findSpzExtension(found->second));
          instance.degree = instance.packed->sh_degree;
        } else {
          // Zeros, of which a few bytes of JSON ask for gigabytes.
          if (accessor.bufferView < 0) {
            throw document.bad(instance.splats.pointer + "/attributes/POSITION",
                               "without a bufferView is not supported");
          }
          instance.degree = findDegree(document, instance.splats);
          if (hasHigherDegree(instance.splats)) {
            document.warn(instance.splats.pointer + "/attributes", "SH above degree 3 is left out");
          }
        }
        instance.place = decomposeStretched(document, placed);
        instance.node = placed.node;
        instance.linear = found->second.Has("colorSpace") && found->second.Get("colorSpace").IsString() &&
                          found->second.Get("colorSpace").Get<std::string>() == "lin_rec709_display";
        instances.push_back(std::move(instance));
      });
    }
  }
  if (instances.empty() && (document.errors == nullptr || document.errors->empty())) {
    throw Error(ErrorKind::badData, document.path,
                "the scene holds no splats (expected a primitive with " + std::string(kSplatExtension) + ")");
  }
  return instances;
}

// An SPZ's splats as the numbers of attributes.
BaseArrays unpackedBase(const GaussianModel& model) {
  BaseArrays base;
  base.range = {0, model.size()};
  const std::size_t count = model.shCount();
  base.sh.resize(count);
  for (std::size_t i = 0; i < model.size(); ++i) {
    const glm::vec4& q = model.rotation[i];
    const glm::vec3& mean = model.mean[i];
    const glm::vec3 scale = gltfScale(model.log_scale[i]);
    base.position.insert(base.position.end(), {mean.x, mean.y, mean.z});
    base.rotation.insert(base.rotation.end(), {q.y, q.z, q.w, q.x});
    base.scale.insert(base.scale.end(), {scale.x, scale.y, scale.z});
    base.opacity.push_back(gltfOpacity(model.opacity_logit[i]));
    for (std::size_t k = 0; k < count; ++k) {
      const glm::vec3& sh = model.sh[i * count + k];
      base.sh[k].insert(base.sh[k].end(), {sh.x, sh.y, sh.z});
    }
  }
  base.byte_rotation = true;  // off unit length by the rounding of its 8 or 9 bits
  return base;
}

// How many splats are read at once: all where errors are to be told once, and where values lie sparse.
std::size_t blockOf(const GltfDocument& document, const SplatInstance& instance) {
  if (document.errors != nullptr || instance.packed) return instance.splats.count;
  for (const auto& [semantic, accessor] : instance.splats.primitive->attributes) {
    if (document.model.accessors[static_cast<std::size_t>(accessor)].sparse.isSparse) return instance.splats.count;
  }
  return std::min(kInstanceBlock, instance.splats.count);
}

// Whether SCALE has logarithms, as the extension's first release candidate had them: of signed integers all, else where
// half of the splats have one below 0, which no scale is.
bool hasLogScales(const GltfDocument& document, const SplatInstance& instance) {
  const auto& attributes = instance.splats.primitive->attributes;
  const auto scale = attributes.find(splatName("SCALE"));
  if (instance.packed || scale == attributes.end()) return false;
  const int type = document.model.accessors[static_cast<std::size_t>(scale->second)].componentType;
  if (type == TINYGLTF_COMPONENT_TYPE_BYTE || type == TINYGLTF_COMPONENT_TYPE_SHORT) return true;
  if (type != TINYGLTF_COMPONENT_TYPE_FLOAT) return false;
  std::size_t negative = 0;
  const std::size_t block = blockOf(document, instance);
  for (std::size_t first = 0; first < instance.splats.count; first += block) {
    const SplatRange range{first, std::min(block, instance.splats.count - first)};
    std::vector<float> scales;
    try {
      scales = readAttribute(document, instance.splats, {scale->first, 3, kFloat}, range);
    } catch (const Error&) {  // which reading them says
      return false;
    }
    for (std::size_t i = 0; i < range.count; ++i) {
      negative += std::min({scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]}) < 0.0f;
    }
  }
  return negative > 0 && 2 * negative >= instance.splats.count;
}

BaseArrays readBase(const GltfDocument& document, const SplatInstance& instance, SplatRange range) {
  if (instance.packed) return unpackedBase(*instance.packed);
  constexpr unsigned integers = kByte | kUnsignedByte | kShort | kUnsignedShort | kByteNormalized |
                                kUnsignedByteNormalized | kShortNormalized | kUnsignedShortNormalized;
  const bool quantized = std::count(document.model.extensionsUsed.begin(), document.model.extensionsUsed.end(),
                                    "KHR_mesh_quantization") != 0;
  BaseArrays base;
  base.range = range;
  const SplatPrimitive& splats = instance.splats;
  const auto read = [&](std::vector<float>& to, const AttributeRule& rule) {
    document.attempt([&] { to = readAttribute(document, splats, rule, range); });
  };
  read(base.position, {"POSITION", 3, quantized ? kFloat | integers : unsigned{kFloat}});
  read(base.rotation, {splatName("ROTATION"), 4, kFloat | kByteNormalized | kShortNormalized});
  if (splats.has(splatName("ROTATION"))) {
    base.byte_rotation =
        document.model.accessors[splats.primitive->attributes.at(splatName("ROTATION"))].componentType ==
        TINYGLTF_COMPONENT_TYPE_BYTE;
  }
  read(base.scale, {splatName("SCALE"), 3, kFloat | integers});
  if (instance.log_scales) {
    for (float& scale : base.scale) scale = std::exp(scale);
  }
  read(base.opacity, {splatName("OPACITY"), 1, kFloat | kUnsignedByteNormalized | kUnsignedShortNormalized});
  const auto readIfThere = [&](std::vector<float>& to, const char* semantic, int components) {
    if (splats.has(semantic)) read(to, {semantic, components});
  };
  readIfThere(base.source_rotation, kSourceRotation, 4);
  readIfThere(base.source_log_scale, kSourceLogScale, 3);
  readIfThere(base.source_logit, kSourceLogit, 1);
  for (int l = 0; l <= instance.degree; ++l) {
    for (int k = 0; k <= 2 * l; ++k) read(base.sh.emplace_back(), {coefficientName(l, k), 3});
  }
  return base;
}

bool isFinite(const BaseArrays& base, const TextureLayer* layer, std::size_t i) {
  bool ok = std::isfinite(base.opacity[i]);
  const std::size_t splat = base.range.first + i;
  if (layer && layer->opacity) ok = ok && std::isfinite((*layer->opacity)[splat]);
  for (int k = 0; k < 3 && layer && layer->dc; ++k) ok = ok && std::isfinite((*layer->dc)[splat * 3 + k]);
  for (int k = 0; k < 3 && layer && layer->scale; ++k) ok = ok && std::isfinite((*layer->scale)[splat * 3 + k]);
  for (int k = 0; k < 4; ++k) ok = ok && std::isfinite(base.rotation[i * 4 + k]);
  for (int k = 0; k < 3; ++k) {
    ok = ok && std::isfinite(base.position[i * 3 + k]) && std::isfinite(base.scale[i * 3 + k]);
  }
  for (const std::vector<float>& coefficient : base.sh) {
    for (int k = 0; k < 3; ++k) ok = ok && std::isfinite(coefficient[i * 3 + k]);
  }
  return ok;
}

// Puts the numbers that the file was made from in place of those read back from glTF's, where the splat's glTF numbers
// are still what they give: a splat that another program moved or shaped keeps what that program wrote. `ordered`: the
// writer put local axes in the order of the texture extension.
void restoreSource(const BaseArrays& base, std::size_t i, bool ordered, glm::vec3 stored_scale, float opacity,
                   glm::vec3& log_scale, glm::vec4& rotation, float& logit) {
  if (!base.source_logit.empty() && std::isfinite(base.source_logit[i]) &&
      gltfOpacity(base.source_logit[i]) == opacity) {
    logit = base.source_logit[i];
  }
  if (base.source_rotation.empty() && base.source_log_scale.empty()) return;
  glm::vec3 source_scale = log_scale;
  glm::vec4 source_rotation = rotation;
  if (!base.source_log_scale.empty()) {
    const float* from = &base.source_log_scale[i * 3];
    source_scale = {from[0], from[1], from[2]};
  }
  if (!base.source_rotation.empty()) {
    const float* from = &base.source_rotation[i * 4];
    source_rotation = {from[0], from[1], from[2], from[3]};
  }
  for (int k = 0; k < 3; ++k) {
    if (!std::isfinite(source_scale[k])) return;
  }
  if (!hasLength(source_rotation)) return;
  glm::vec3 scale = source_scale;
  glm::vec4 q = source_rotation;
  if (ordered) orderAxesForGltf(scale, q);
  scale = gltfScale(scale);
  q = gltfRotation(q);
  const float* stored_q = &base.rotation[i * 4];
  if (scale != stored_scale || q != glm::vec4(stored_q[3], stored_q[0], stored_q[1], stored_q[2])) {
    return;
  }
  log_scale = source_scale;
  rotation = source_rotation;
}

// The shape of a splat without a texture under a node that scales axes differently.
void stretch(const RigidScale& place, glm::vec3& scale, glm::vec4& q) {
  glm::dmat3 axes = matrixFromQuaternion(glm::dvec4(q)), rotation;
  for (int axis = 0; axis < 3; ++axis) {
    axes[axis] = place.scale * (place.rotation * (place.stretch * axes[axis])) * static_cast<double>(scale[axis]);
  }
  scale = glm::vec3(principalAxes(axes, rotation));
  q = glm::vec4(quaternionFromMatrix(rotation));
}

// Appends splats of a primitive in the model's world. `layer` may be null.
void append(const SplatInstance& instance, const BaseArrays& base, const TextureLayer* layer, GaussianModel& model,
            Repairs& repairs) {
  const float norm_tolerance = base.byte_rotation ? kByteNormTolerance : kNormTolerance;
  const ShRotation sh_rotation(instance.place.rotation);
  const glm::dvec4 node_rotation = quaternionFromMatrix(instance.place.rotation);
  std::vector<glm::vec3> sh(model.shCount());
  const bool ordered = findTextureExtension(*instance.splats.primitive) != nullptr;
  for (std::size_t i = 0; i < base.range.count; ++i) {
    const std::size_t splat = base.range.first + i;
    glm::vec4 q(base.rotation[i * 4 + 3], base.rotation[i * 4], base.rotation[i * 4 + 1], base.rotation[i * 4 + 2]);
    const float norm = glm::dot(q, q);
    if (!isFinite(base, layer, i) || !(norm > 1e-12f)) {
      ++repairs.dropped;
      continue;
    }
    if (std::abs(norm - 1.0f) > norm_tolerance) {
      ++repairs.rotation;
      q = glm::vec4(glm::normalize(glm::dvec4(q)));
    }
    float opacity = layer && layer->opacity ? (*layer->opacity)[splat] : base.opacity[i];
    if (!(opacity >= 0.0f && opacity <= 1.0f)) {
      ++repairs.opacity;
      opacity = opacity > 1.0f ? 1.0f : 0.0f;
    }
    const float* stored = layer && layer->scale ? &(*layer->scale)[splat * 3] : &base.scale[i * 3];
    const glm::vec3 stored_scale(stored[0], stored[1], stored[2]);
    glm::vec3 scale = stored_scale;
    if (scale.x < 0.0f || scale.y < 0.0f || scale.z < 0.0f) ++repairs.scale;
    scale = glm::abs(scale);
    glm::vec3 mean(base.position[i * 3], base.position[i * 3 + 1], base.position[i * 3 + 2]);
    std::fill(sh.begin(), sh.end(), glm::vec3(0.0f));
    for (std::size_t k = 0; k < base.sh.size(); ++k) {
      const bool layered = k == 0 && layer && layer->dc;
      const float* from = layered ? &(*layer->dc)[splat * 3] : &base.sh[k][i * 3];
      sh[k] = {from[0], from[1], from[2]};
    }
    if (!instance.place.identity) {
      mean = glm::vec3(instance.place.scale * (instance.place.rotation * (instance.place.stretch * glm::dvec3(mean))) +
                       instance.place.translation);
      if (instance.place.stretch == glm::dvec3(1.0)) {
        q = glm::vec4(multiply(node_rotation, glm::normalize(glm::dvec4(q))));
        scale *= static_cast<float>(instance.place.scale);
      } else {
        stretch(instance.place, scale, q);
      }
      sh_rotation.apply(sh);
    }
    turnShAxes(sh);
    q = modelFromGltfRotation(q);
    glm::vec3 log_scale = logFromScale(scale);
    const TextureRect rect = layer ? layer->atlas.rects[splat] : TextureRect{};
    if (rect.texelCount() != 0 && !orderAxesForModel(log_scale, q)) ++repairs.plane;
    float logit = logitFromOpacity(opacity);
    if (instance.place.identity) restoreSource(base, i, ordered, stored_scale, opacity, log_scale, q, logit);
    model.mean.push_back(turnAxes(mean));
    model.rotation.push_back(q);
    model.log_scale.push_back(log_scale);
    model.opacity_logit.push_back(logit);
    model.sh.insert(model.sh.end(), sh.begin(), sh.end());
    if (rect.texelCount() != 0) {
      const auto first = layer->atlas.texels.begin() + rect.offset;
      model.atlas.rects.push_back({static_cast<std::uint32_t>(model.atlas.texels.size()), rect.width, rect.height});
      model.atlas.texels.insert(model.atlas.texels.end(), first, first + rect.texelCount());
    } else {
      model.atlas.rects.push_back({});
    }
  }
}

void warnRepairs(GltfDocument& document, const SplatInstance& instance, const Repairs& repairs) {
  const auto say = [&](std::size_t count, const std::string& what, const std::string& how) {
    if (count != 0) document.mend(instance.splats.pointer, std::to_string(count) + " splats " + what, how);
  };
  say(repairs.rotation, "with a quaternion that is not of unit length", "normalised");
  say(repairs.opacity, "with an opacity outside [0, 1]", "clamped");
  say(repairs.scale, "with a negative scale", "sign dropped");
  say(repairs.dropped, "with values that are not finite or a quaternion of length 0", "dropped");
  say(repairs.plane, "with a texture whose SCALE.z is not the smallest", "it lies on the two longer axes");
}

// What write_gltf.cpp keeps in asset.extras.
void readAssetExtras(GltfDocument& document, const RigidScale& world_from_scene, Bundle& loaded) {
  loaded.knows_background = false;
  const tinygltf::Value& extras = document.model.asset.extras;
  if (!extras.Has(kExtrasKey)) return;
  const tinygltf::Value& ours = extras.Get(kExtrasKey);
  if (ours.Has("intersection") && ours.Get("intersection").IsString()) {
    const auto intersection = parse<IntersectionModel>(ours.Get("intersection").Get<std::string>());
    if (intersection) loaded.model.intersection = *intersection;
  }
  if (ours.Has("outside") && ours.Get("outside").IsString()) {
    const auto outside = parse<TextureOutside>(ours.Get("outside").Get<std::string>());
    if (outside) loaded.model.outside = *outside;
  }
  if (ours.Has("views")) {
    std::size_t skipped = 0;
    loaded.views = readViews(ours.Get("views"), world_from_scene, skipped);
    if (skipped > 0) {
      document.warn("/asset/extras/" + std::string(kExtrasKey) + "/views",
                    std::to_string(skipped) + " views skipped (expected a pose, an image size and focal lengths)");
    }
  }
  if (!ours.Has("background")) return;
  const tinygltf::Value& background = ours.Get("background");
  glm::vec3 color(0.0f);
  bool known = background.IsArray() && background.ArrayLen() == 3;
  for (int c = 0; known && c < 3; ++c) {
    const tinygltf::Value& number = background.Get(c);
    if (number.IsNumber()) color[c] = static_cast<float>(number.GetNumberAsDouble());
    known = number.IsNumber() && std::isfinite(color[c]);
  }
  if (!known) {
    document.warn("/asset/extras/" + std::string(kExtrasKey) + "/background",
                  "ignored (expected three finite numbers)");
    return;
  }
  loaded.background = color;
  loaded.knows_background = true;
}

// The model of a document that has been checked. Takes its warnings.
Bundle assemble(GltfDocument& document, const ReadOptions& options,
                const glm::dmat4& world_from_scene = glm::dmat4(1.0)) {
  std::string wrong;
  const std::optional<RigidScale> place = decompose(world_from_scene, wrong);
  TG_ASSERT(place, "a scene stands at a uniform scale, a rotation and a translation");
  document.warnings = document.unread;
  document.mended.clear();
  if (!options.base_only) checkExtensionPlaces(document);
  const std::vector<PlacedNode> nodes = placeNodes(document, world_from_scene);
  std::vector<SplatInstance> instances = findSplats(document, nodes);

  Bundle loaded;
  GaussianModel& model = loaded.model;
  readAssetExtras(document, *place, loaded);
  for (SplatInstance& instance : instances) {
    model.sh_degree = std::max(model.sh_degree, instance.degree);
    instance.log_scales = hasLogScales(document, instance);
    if (!instance.log_scales) continue;
    document.mend(instance.splats.pointer + "/attributes/" + splatName("SCALE"), "logarithms (expected scales)",
                  "as the extension's first release candidate had them");
  }
  bool textured = false;
  DecodedAtlases decoded;
  for (const SplatInstance& instance : instances) {
    std::optional<TextureLayer> layer;
    const tinygltf::Value* extension = findTextureExtension(*instance.splats.primitive);
    if (extension != nullptr && !options.base_only) {
      if (instance.place.stretch != glm::dvec3(1.0)) {
        throw document.bad(nodePointer(instance.node),
                           "a transform that stretches is not supported of splats with textures (expected a uniform "
                           "scale, a rotation and a translation)");
      }
      layer = readTextureLayer(document, instance.splats, *extension, decoded);
      if (&instance == &instances.back()) decoded.pages = {};
      if (textured && layer->intersection != model.intersection) {
        throw document.bad(instance.splats.pointer, "another intersection model than the primitives before (expected " +
                                                        std::string(name(model.intersection)) + ", found " +
                                                        std::string(name(layer->intersection)) + ")");
      }
      if (model.atlas.texels.size() + layer->atlas.texels.size() > kMaxModelTexels) {
        throw document.bad(instance.splats.pointer,
                           "too many texels in all (expected at most " + std::to_string(kMaxModelTexels) + ")");
      }
      textured = true;
      model.intersection = layer->intersection;
      model.texture_mode = model.texture_mode | layer->mode;
    }
    Repairs repairs;
    const std::size_t before = model.size();
    const std::size_t block = blockOf(document, instance);
    for (std::size_t first = 0; first < instance.splats.count; first += block) {
      const SplatRange range{first, std::min(block, instance.splats.count - first)};
      const BaseArrays base = readBase(document, instance, range);
      if (document.errors != nullptr && !document.errors->empty()) continue;  // its arrays may be empty
      if (model.size() == 0) {  // numbers are there: they get as much as they ask for
        const auto reserve = [&](const Field& field, auto& values) {
          values.reserve(instance.splats.count * field.values(model.shCount()));
        };
        forEachField(reserve, model);
      }
      append(instance, base, layer ? &*layer : nullptr, model, repairs);
    }
    warnRepairs(document, instance, repairs);
    if (instance.linear) encodeLinearColors(model, before);
  }
  if (document.errors != nullptr && !document.errors->empty()) {
    document.errors->insert(document.errors->end(), document.mended.begin(), document.mended.end());
    throw Error(ErrorKind::badData, document.errors->front());
  }
  if (!textured) model.atlas = {};
  if (model.size() == 0) throw Error(ErrorKind::badData, document.path, "no splat is left: none had finite values");
  for (const PlacedNode& placed : nodes) {
    if (document.model.nodes[placed.node].camera < 0) continue;
    if (std::optional<Camera> camera = readCamera(document, placed)) loaded.cameras.push_back(std::move(*camera));
  }
  loaded.warnings = std::move(document.warnings);
  if (document.errors != nullptr) *document.errors = std::move(document.mended);
  return loaded;
}

// glTF: elements of attributes start at multiples of 4 bytes.
void checkAlignment(const json& root, std::size_t index, std::vector<std::string>& errors) {
  const json& accessor = root["accessors"][index];
  if (!accessor.contains("bufferView")) return;
  const json& view = root["bufferViews"][accessor["bufferView"].get<std::size_t>()];
  const std::string type = accessor["type"].get<std::string>();
  if (type.rfind("MAT", 0) == 0) return;  // no splat attribute
  const std::uint64_t element = std::uint64_t(componentBytes(accessor["componentType"].get<std::uint64_t>())) *
                                static_cast<std::uint64_t>(componentCount(type));
  const std::uint64_t stride = view.value("byteStride", element);
  const std::uint64_t offset =
      accessor.value("byteOffset", std::uint64_t{0}) + view.value("byteOffset", std::uint64_t{0});
  if (offset % 4 == 0 && stride % 4 == 0) return;
  errors.push_back("/accessors/" + std::to_string(index) +
                   ": elements of an attribute do not start at multiples of 4 bytes (found offset " +
                   std::to_string(offset) + ", stride " + std::to_string(stride) + ")");
}

}  // namespace

Bundle readGltf(const std::filesystem::path& path, const ReadOptions& options, const glm::dmat4& world_from_scene) {
  GltfDocument document = openGltf(path);
  document.errors = options.errors;
  return assemble(document, options, world_from_scene);
}

Bundle parseGltf(std::span<const std::uint8_t> bytes, const std::string& path, const ReadOptions& options) {
  GltfDocument document = loadGltf(bytes, path);
  document.errors = options.errors;
  return assemble(document, options);
}

std::size_t checkGltf(const std::filesystem::path& path, std::vector<std::string>& errors,
                      std::vector<std::string>& warnings) {
  GltfJson parsed;
  GltfDocument document = openGltf(path, parsed);
  std::size_t gaussians = 0;
  for (const bool base_only : {true, false}) {
    std::vector<std::string> found;
    document.errors = &found;
    try {
      const Bundle loaded = assemble(document, {.base_only = base_only});
      checkModel(loaded.model, document.path);
      gaussians = loaded.model.size();
      warnings.insert(warnings.end(), loaded.warnings.begin(), loaded.warnings.end());
    } catch (const Error& error) {
      if (error.kind != ErrorKind::badData) throw;
      if (found.empty()) found.push_back(error.what());
    }
    errors.insert(errors.end(), found.begin(), found.end());
  }
  document.errors = nullptr;
  const json& root = parsed.root;
  for (const json& mesh : list(root, "meshes")) {
    for (const json& primitive : mesh["primitives"]) {
      if (!member(primitive, "extensions").contains(kSplatExtension)) continue;
      for (const auto& [semantic, accessor] : primitive["attributes"].items()) {
        checkAlignment(root, accessor.get<std::size_t>(), errors);
      }
    }
  }
  checkExtensionLists(parsed.stored ? *parsed.stored : root, errors, warnings);
  checkCoreRules(root, document, errors, warnings);
  return gaussians;
}

}  // namespace tg
