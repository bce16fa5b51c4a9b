// SPDX-License-Identifier: Apache-2.0
// Writes a model as GLB or glTF.
#include "converter/gltf/write_gltf.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "converter/formats/gaussian_blocks.h"
#include "converter/formats/repair.h"
#include "converter/formats/space_curve.h"
#include "converter/gltf/attribute_filters.h"
#include "converter/gltf/axes.h"
#include "converter/gltf/builder.h"
#include "converter/gltf/cameras.h"
#include "converter/gltf/document.h"
#include "converter/gltf/numbers.h"
#include "converter/gltf/quantize.h"
#include "converter/gltf/texture_layer.h"
#include "core/file/atomic_files.h"
#include "core/image/image.h"
#include "core/image/webp.h"
#include "core/model/equivalent_axes.h"
#include "core/model/fallback.h"
#include "core/model/texture_dictionary.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "shared/limits.h"

namespace tg {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kMaxAtlasSide = 4096;  // [texels] what every WebGL 2 device can load
constexpr const char* kGenerator = "Textured Gaussians tgconvert";
constexpr std::uint64_t kSourceBytes = 32;                             // of a Gaussian: rotation, scale, opacity
constexpr std::uint64_t kMaxBinaryBytes = 0xFFFFFFFFull - (1u << 24);  // of a GLB, less room for the JSON

constexpr ElementType kFloat1{"SCALAR", 5126, false, 4};
constexpr ElementType kFloat3{"VEC3", 5126, false, 12};
constexpr ElementType kFloat4{"VEC4", 5126, false, 16};
constexpr ElementType kShort4{"VEC4", 5122, true, 8};
constexpr ElementType kUnsignedShort1{"SCALAR", 5123, true, 2};
constexpr ElementType kUnsignedShort4{"VEC4", 5123, true, 8};
constexpr ElementType kUnsignedByte4{"VEC4", 5121, true, 4};
constexpr ElementType kRectangle{"VEC4", 5123, false, 8};
constexpr ElementType kIndex{"SCALAR", 5121, false, 1};

std::string attributeName(std::string_view extension, const std::string& name) {
  return std::string(extension) + ":" + name;
}

// IEC 61966-2-1; colours of COLOR_0 are linear by glTF's rule. Between 4096 nodes a chord is off by less than 3e-8.
class LinearFromSrgb {
 public:
  LinearFromSrgb() {
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      const double c = static_cast<double>(k) / kCells;
      nodes_[k] = c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
    }
  }
  // c in [0, 1].
  double operator()(double c) const {
    const double x = c * kCells;
    const auto cell = static_cast<std::size_t>(std::min(x, kCells - 1.0));
    return nodes_[cell] + (x - static_cast<double>(cell)) * (nodes_[cell + 1] - nodes_[cell]);
  }

 private:
  static constexpr double kCells = 4096.0;
  std::array<double, 4097> nodes_;
};

// Where an attribute's numbers come from: a model that is there as a whole, or the blocks that are written.
using Baked = const GaussianModel*;  // null: the blocks

// groups: textureGroups(). What Gaussians share stands in the atlas once.
PackedAtlas packOnce(const TextureAtlas& atlas, std::span<const std::uint32_t> groups) {
  std::uint64_t texels = 0;
  for (const TextureRect& rect : atlas.rects) texels += rect.texelCount();
  PackedAtlas packed;
  if (areShared(atlas, groups) && texels <= kFreeSharedTexels) {
    TextureAtlas once{{}, atlas.texels};
    for (const std::uint32_t first : firstOfGroups(groups)) once.rects.push_back(atlas.rects[first]);
    packed = packAtlas(once, once.rects.size(), kMaxAtlasSide);
    std::vector<AtlasPlacement> placements;
    for (const std::uint32_t group : groups) placements.push_back(packed.placements[group]);
    packed.placements = std::move(placements);
  } else {
    packed = packAtlas(atlas, atlas.rects.size(), kMaxAtlasSide);
  }
  std::uint64_t stored = 0;
  for (const Image& page : packed.pages) stored += pageTexels(page).size();
  if (stored > kMaxAtlasTexels) {
    throw Error(ErrorKind::badData, "too many texels for glTF" + atMost(kMaxAtlasTexels, stored));
  }
  return packed;
}

// Gaussians without a texture get the rectangle before theirs with no height: the codec packs differences.
void repeatRectangles(std::vector<AtlasPlacement>& placements) {
  const auto is_textured = [](const AtlasPlacement& p) { return p.w != 0; };
  AtlasPlacement before = *std::ranges::find_if(placements, is_textured);
  for (AtlasPlacement& p : placements) {
    if (is_textured(p)) {
      before = p;
    } else {
      p = before;
      p.h = 0;
    }
  }
}

// Collects the parts of one file. Names of attributes are in the order of the file.
class Writer {
 public:
  // `limited`: the file ends at 4 GiB.
  Writer(const GltfContent& content, const GaussianBlocks& gaussians, bool limited)
      : builder(gaussians, content.options.meshopt, content.options.parts),
        content_(content),
        model_(content.model),
        gaussians_(gaussians),
        limited_(limited),
        filters_(content.options.steps ? filtersInSteps(content.model, static_cast<double>(*content.options.steps))
                                       : wholeFilters(content.options.quantize)) {}

  // fill(model, i): the element of the model's Gaussian i.
  template <typename T, typename Fill>
  void add(const std::string& semantic, const ElementType& element, Fill fill, MeshoptFilter filter = {},
           Baked baked = nullptr, bool bounded = false) {
    const std::size_t stride = element.stride();
    const auto write = [fill, stride, baked](const GaussianBlocks::Block& block, std::uint8_t* to) {
      const GaussianModel& model = baked ? *baked : block.model;
      const std::size_t begin = baked ? block.first : block.begin;
      for (std::size_t i = begin; i < begin + block.count; ++i, to += stride) {
        const T value = fill(model, i);
        std::memcpy(to, &value, sizeof(value));
      }
    };
    attributes[semantic] = builder.addAttribute(element, write, filter, bounded);
  }

  void addPositions();
  void addShape(bool textured, Baked baked);
  void addOpacity(Baked baked, std::string_view extension);
  void addColors(Baked baked);
  void addDc(const GaussianModel& stored);
  TextureAtlas roundedTextures(const GaussianModel& base, const TexelSteps& steps) const;
  // `stored`: the model, with `steps` what withRoundedTextures made of it; outlives the writing.
  Json addTextures(const GaussianModel& stored, const std::optional<TexelSteps>& steps, GltfReport& report);
  void addSource(Baked textured, GltfReport& report);
  void addScene(Json nested);

  GltfBuilder builder;
  Json attributes;                                // accessors of the first primitive
  std::atomic<std::uint64_t> clipped_scales = 0;  // GltfReport::clipped_scales, when all is written

 private:
  Json addAtlas(Image& page, const std::string& name, const std::optional<TexelSteps>& steps, GltfReport& report);
  // Index of a texture that shows the image.
  std::size_t addTexture(const Image& page, const std::string& name);
  const GltfContent& content_;
  const GaussianModel& model_;
  const GaussianBlocks& gaussians_;
  const bool limited_;
  const AttributeFilters filters_;
};

void Writer::addPositions() {
  add<glm::vec3>(
      "POSITION", kFloat3, [](const GaussianModel& model, std::size_t i) { return turnAxes(model.mean[i]); },
      filters_.position, nullptr, true);
}

// Rotation and scale; local axes in the order of the texture extension when it is there. Where `baked` has other
// scales, those to use with the texture stand beside them.
void Writer::addShape(bool textured, Baked baked) {
  const auto xyzw = [textured](const GaussianModel& model, std::size_t i) {
    glm::vec3 log_scale = model.log_scale[i];
    glm::vec4 rotation = model.rotation[i];
    if (textured) orderAxesForGltf(log_scale, rotation);
    const glm::vec4 q = gltfRotation(rotation);
    return glm::vec4(q.y, q.z, q.w, q.x);
  };
  const std::string rotation_name = attributeName(kSplatExtension, "ROTATION");
  if (content_.options.quantize && !content_.options.meshopt) {
    add<std::array<std::int16_t, 4>>(rotation_name, kShort4, [xyzw](const GaussianModel& model, std::size_t i) {
      const glm::vec4 q = xyzw(model, i);
      std::array<std::int16_t, 4> out;
      for (int k = 0; k < 4; ++k) {
        out[static_cast<std::size_t>(k)] = static_cast<std::int16_t>(std::lround(q[k] * 32767.0f));
      }
      return out;
    });
  } else {
    add<glm::vec4>(rotation_name, kFloat4, xyzw, filters_.rotation);
  }
  // Once a Gaussian, in whatever thread.
  const auto own_scale = [textured, clipped = &clipped_scales](const GaussianModel& model, std::size_t i) {
    glm::vec3 log_scale = model.log_scale[i];
    if (clipsScale(log_scale)) ++*clipped;
    glm::vec4 rotation = model.rotation[i];
    if (textured) orderAxesForGltf(log_scale, rotation);
    return gltfScale(log_scale);
  };
  const std::string scale_name = attributeName(kSplatExtension, "SCALE");
  if (!baked || baked->log_scale == model_.log_scale) {
    add<glm::vec3>(scale_name, kFloat3, own_scale, filters_.scale);
    return;
  }
  const auto other_scale = [whole = &model_](const GaussianModel& base, std::size_t i) {
    const glm::ivec3 order = gltfAxisOrder(whole->log_scale[i]);
    const glm::vec3 log_scale = base.log_scale[i];
    return gltfScale(glm::vec3(log_scale[order.x], log_scale[order.y], log_scale[order.z]));
  };
  add<glm::vec3>(scale_name, kFloat3, other_scale, filters_.scale, baked);
  add<glm::vec3>(attributeName(kTextureExtension, "SCALE"), kFloat3, own_scale, filters_.scale);
}

void Writer::addOpacity(Baked baked, std::string_view extension) {
  const bool stand_in = baked && extension == kSplatExtension && hasAlpha(model_.texture_mode);
  const MeshoptFilter& filter = stand_in ? filters_.base_opacity : filters_.opacity;
  const std::string semantic = attributeName(extension, "OPACITY");
  const auto opacity = [](const GaussianModel& model, std::size_t i) { return gltfOpacity(model.opacity_logit[i]); };
  if (content_.options.quantize && !content_.options.steps) {
    const auto rounded = [opacity](const GaussianModel& model, std::size_t i) {
      return static_cast<std::uint16_t>(std::lround(opacity(model, i) * 65535.0f));
    };
    add<std::uint16_t>(semantic, kUnsignedShort1, rounded, {}, baked);
  } else {
    add<float>(semantic, kFloat1, opacity, filter, baked);
  }
}

void Writer::addColors(Baked baked) {
  const int degree = gaussians_.shDegree();
  const std::size_t count = shCountOf(degree);
  const bool stand_in = baked && hasColor(model_.texture_mode);
  std::size_t k = 0;
  for (int l = 0; l <= degree; ++l) {
    for (int m = 0; m <= 2 * l; ++m, ++k) {
      // Signs of the half turn: functions of even index are even in (x, y).
      const float sign = k % 2 == 0 ? 1.0f : -1.0f;
      const std::string name = "SH_DEGREE_" + std::to_string(l) + "_COEF_" + std::to_string(m);
      add<glm::vec3>(
          attributeName(kSplatExtension, name), kFloat3,
          [sign, count, k](const GaussianModel& model, std::size_t i) { return sign * model.sh[i * count + k]; },
          k > 0      ? filters_.sh[k]
          : stand_in ? filters_.base_dc
                     : filters_.dc,
          baked);
    }
  }
  if (content_.options.steps) return;  // COLOR_0 says once more what viewers of plain points alone need
  static const LinearFromSrgb linear;
  const auto color = [count](const GaussianModel& model, std::size_t i, int c) {
    return c == 3 ? static_cast<double>(gltfOpacity(model.opacity_logit[i]))
                  : linear(std::clamp(0.5 + double{kShC0} * model.sh[i * count][c], 0.0, 1.0));
  };
  const auto rounded = [color]<typename T>(T, const GaussianModel& model, std::size_t i) {
    std::array<T, 4> out;
    for (int c = 0; c < 4; ++c) {
      out[static_cast<std::size_t>(c)] = static_cast<T>(color(model, i, c) * std::numeric_limits<T>::max() + 0.5);
    }
    return out;
  };
  if (content_.options.quantize) {
    add<std::array<std::uint8_t, 4>>(
        "COLOR_0", kUnsignedByte4,
        [rounded](const GaussianModel& model, std::size_t i) { return rounded(std::uint8_t{}, model, i); }, {}, baked);
  } else {
    add<std::array<std::uint16_t, 4>>(
        "COLOR_0", kUnsignedShort4,
        [rounded](const GaussianModel& model, std::size_t i) { return rounded(std::uint16_t{}, model, i); }, {}, baked);
  }
}

void Writer::addDc(const GaussianModel& stored) {
  add<glm::vec3>(
      attributeName(kTextureExtension, "SH_DEGREE_0_COEF_0"), kFloat3,
      [count = stored.shCount()](const GaussianModel& model, std::size_t i) { return model.sh[i * count]; },
      filters_.dc, &stored);
}

int bitsOf(AtlasFormat format) { return format == AtlasFormat::png16 ? 16 : 8; }
auto encodePage(const Image& image, int bits) { return bits == 16 ? encodePng16(image) : encodePng(image); }

// Of options that have one [colour].
double textureStep(const WriteOptions& options) {
  return static_cast<double>(*options.texture_step) * static_cast<double>(options.steps.value_or(1.0f));
}

// One channel becomes grey; opaque.
BytePixels greyOrColorBytes(const Image& image) {
  BytePixels pixels(image.width, image.height);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = image.data[i * static_cast<std::size_t>(image.channels) + (image.channels == 1 ? 0 : c)];
      pixels.data[4 * i + c] = static_cast<std::uint8_t>(std::lround(value * 255.0f));
    }
    pixels.data[4 * i + 3] = 255;
  }
  return pixels;
}

// What of a Gaussian a reader of the glTF numbers gets back with other last bits.
struct Changed {
  bool rotation = false, log_scale = false, opacity = false;
};

// Looks no further once all three are known to be.
Changed changedByGltf(const GaussianBlocks& gaussians, const GaussianModel& whole, bool textured) {
  std::atomic<bool> rotation{false}, log_scale{false}, opacity{false};
  std::vector<GaussianBlocks::Scratch> scratch(static_cast<std::size_t>(threadCount()));
  const std::size_t size = gaussians.size();
  const auto compare = [&](std::int64_t item, int worker) {
    if (rotation && log_scale && opacity) return;
    const std::size_t first = static_cast<std::size_t>(item) * kSplatBlockRows;
    const GaussianBlocks::Block block =
        gaussians.block(first, std::min(kSplatBlockRows, size - first), scratch[static_cast<std::size_t>(worker)]);
    const GaussianModel& model = block.model;
    Changed changed;
    for (std::size_t i = block.begin; i < block.begin + block.count; ++i) {
      glm::vec3 s = model.log_scale[i];
      glm::vec4 q = model.rotation[i];
      if (textured) orderAxesForGltf(s, q);
      s = logFromScale(gltfScale(s));
      q = modelFromGltfRotation(gltfRotation(q));
      if (textured && whole.atlas.rects[i].texelCount() != 0) orderAxesForModel(s, q);
      const float logit = logitFromOpacity(gltfOpacity(model.opacity_logit[i]));
      changed.rotation = changed.rotation || std::memcmp(&q, &model.rotation[i], sizeof(q)) != 0;
      changed.log_scale = changed.log_scale || std::memcmp(&s, &model.log_scale[i], sizeof(s)) != 0;
      changed.opacity = changed.opacity || std::memcmp(&logit, &model.opacity_logit[i], sizeof(logit)) != 0;
      if (changed.rotation && changed.log_scale && changed.opacity) break;
    }
    if (changed.rotation) rotation = true;
    if (changed.log_scale) log_scale = true;
    if (changed.opacity) opacity = true;
  };
  parallelForWorkers(static_cast<std::int64_t>((size + kSplatBlockRows - 1) / kSplatBlockRows), 1, std::ssize(scratch),
                     compare);
  return {rotation, log_scale, opacity};
}

static_assert(kFieldCount == 5, "the new parameter has no attribute: here, kSourceBytes and append() of read_gltf.cpp");

// The numbers the model came with, beside those glTF has words for. An attribute is left out where nothing would
// change.
void Writer::addSource(Baked textured, GltfReport& report) {
  if (content_.options.lean || content_.options.quantize) return;
  const Changed changed = changedByGltf(gaussians_, model_, textured != nullptr);
  if (limited_ && builder.binaryBytes() + kSourceBytes * gaussians_.size() > kMaxBinaryBytes) {
    report.dropped_source = changed.rotation || changed.log_scale || changed.opacity;
    return;
  }
  if (changed.rotation) {
    add<glm::vec4>(kSourceRotation, kFloat4,
                   [](const GaussianModel& model, std::size_t i) { return model.rotation[i]; });
  }
  if (changed.log_scale) {
    add<glm::vec3>(kSourceLogScale, kFloat3,
                   [](const GaussianModel& model, std::size_t i) { return model.log_scale[i]; });
  }
  if (changed.opacity) {
    add<float>(
        kSourceLogit, kFloat1, [](const GaussianModel& model, std::size_t i) { return model.opacity_logit[i]; }, {},
        textured);
  }
}

std::size_t Writer::addTexture(const Image& page, const std::string& name) {
  Json texture;
  if (content_.options.atlas == AtlasFormat::webp) {
    texture["sampler"] = 0;
    texture["extensions"][std::string(kWebpExtension)] = {
        {"source", builder.addImage(encodeWebp(greyOrColorBytes(page)), "image/webp", name)}};
  } else {
    texture["source"] = builder.addImage(encodePage(page, bitsOf(content_.options.atlas)), "image/png", name);
    texture["sampler"] = 0;
  }
  builder.document["textures"].push_back(std::move(texture));
  return builder.document["textures"].size() - 1;
}

// One atlas object. The page's texels are gone afterwards.
Json Writer::addAtlas(Image& page, const std::string& name, const std::optional<TexelSteps>& steps,
                      GltfReport& report) {
  const TextureMode mode = model_.texture_mode;
  neutralize(pageTexels(page), mode);
  const int bits = bitsOf(content_.options.atlas);
  const QuantizedPage quantized = steps ? quantizePage(page, *steps) : quantizePage(page, bits);
  report.clipped_texels += quantized.clipped_texels;
  Json atlas;
  if (hasColor(mode)) atlas["color"] = addTexture(quantized.color, name + "_color");
  if (hasAlpha(mode)) atlas["alpha"] = addTexture(quantized.alpha, name + "_alpha");
  if (content_.options.atlas == AtlasFormat::exr) {
    const std::array<std::string, 4> channels = {"R", "G", "B", "alpha"};
    atlas["exr"] = builder.addImage(encodeExr(page, channels), "image/x-exr", name + "_values");
  }
  page = {};
  atlas["scale"] = quantized.scale;
  atlas["offset"] = quantized.offset;
  return atlas;
}

TextureAtlas Writer::roundedTextures(const GaussianModel& base, const TexelSteps& steps) const {
  if (!areShared(model_.atlas, textureGroups(model_.atlas))) return texelsInSteps(model_, base, steps);
  GaussianModel opaque = base;  // what Gaussians share is rounded alike, as for the most opaque one
  std::ranges::fill(opaque.opacity_logit, static_cast<float>(kLogitLimit));
  return texelsInSteps(model_, opaque, steps);
}

// Atlases and rectangles. Returns the extension object; images are the last thing in the buffer.
Json Writer::addTextures(const GaussianModel& stored, const std::optional<TexelSteps>& steps, GltfReport& report) {
  PackedAtlas packed = packOnce(stored.atlas, textureGroups(model_.atlas));
  if (content_.options.meshopt) repeatRectangles(packed.placements);
  // Fills outlive this function.
  const auto placements = std::make_shared<const std::vector<AtlasPlacement>>(std::move(packed.placements));
  add<std::array<std::uint16_t, 4>>(attributeName(kTextureExtension, "RECT"), kRectangle,
                                    [placements](const GaussianModel&, std::size_t i) {
                                      const AtlasPlacement& p = (*placements)[i];
                                      return std::array<std::uint16_t, 4>{p.x, p.y, p.w, p.h};
                                    });
  if (packed.pages.size() > 1) {
    add<std::uint8_t>(attributeName(kTextureExtension, "ATLAS"), kIndex,
                      [placements](const GaussianModel&, std::size_t i) { return (*placements)[i].page; });
  }
  for (const AtlasPlacement& p : *placements) report.texels += std::uint64_t{p.w} * p.h;
  addSource(&stored, report);

  constexpr int linear = 9729, clamp = 33071;
  builder.document["samplers"] =
      Json::array({{{"magFilter", linear}, {"minFilter", linear}, {"wrapS", clamp}, {"wrapT", clamp}}});
  Json atlases = Json::array();
  for (std::size_t p = 0; p < packed.pages.size(); ++p) {
    report.atlas_width = packed.pages[p].width;
    report.atlas_height = packed.pages[p].height;
    atlases.push_back(addAtlas(packed.pages[p], "atlas_" + std::to_string(p), steps, report));
  }
  report.atlases = static_cast<int>(packed.pages.size());
  return {{"mode", name(model_.texture_mode)},
          {"intersection", name(model_.intersection)},
          {"extent", double{kTextureExtent}},
          {"filter", "bilinear"},
          {"atlases", std::move(atlases)}};
}

// The root, nodes and the primitives around the attributes.
void Writer::addScene(Json nested) {
  Json splatting = {{"kernel", "ellipse"}, {"colorSpace", "srgb_rec709_display"}};
  Json used = Json::array({std::string(kSplatExtension)});
  if (!nested.is_null()) {
    used.push_back(std::string(kTextureExtension));
    // Not required: only the extension above leads to these textures, and its fallback is the base.
    if (content_.options.atlas == AtlasFormat::webp) used.push_back(std::string(kWebpExtension));
    splatting["extensions"][std::string(kTextureExtension)] = std::move(nested);
  }
  Json& root = builder.document;
  if (content_.options.meshopt) {
    used.push_back("EXT_meshopt_compression");
    root["extensionsRequired"] = {"EXT_meshopt_compression"};
  }
  root["extensionsUsed"] = std::move(used);
  Json primitives = Json::array();
  for (std::size_t p = 0; p < builder.primitives(); ++p) {
    Json primitive = {{"mode", 0}, {"attributes", attributes}};
    for (Json& accessor : primitive["attributes"]) accessor = accessor.get<std::size_t>() + p;
    primitive["extensions"][std::string(kSplatExtension)] = splatting;
    primitives.push_back(std::move(primitive));
  }
  root["meshes"] = Json::array({{{"primitives", std::move(primitives)}}});
  root["nodes"] = Json::array({{{"name", "gaussians"}, {"mesh", 0}}});
  root["scenes"] = Json::array({{{"nodes", {0}}}});
  root["scene"] = 0;
  addCameras(root, content_.cameras);
  root["asset"] = {{"version", "2.0"}, {"generator", kGenerator}};
  Json& extras = root["asset"]["extras"][kExtrasKey];
  extras = {{"intersection", name(model_.intersection)}};
  const glm::vec3& background = content_.background;
  if (content_.knows_background) extras["background"] = {background.x, background.y, background.z};
  if (model_.outside != TextureOutside::base) extras["outside"] = name(model_.outside);
  if (!content_.views.empty()) extras["views"] = listViews(content_.views);
}

// The model with these texels and the colours and opacities to use with them: what rounding takes from the mean of a
// texture stays in its Gaussian.
GaussianModel withRoundedTextures(const GaussianModel& model, TextureAtlas rounded, const TexelSteps& steps) {
  GaussianModel own = bakeFallback(model, FallbackScale::kept);
  own.texture_mode = model.texture_mode;
  own.atlas = withinReach(rounded, steps);
  removeFallback(own, FallbackScale::kept);
  own.atlas = std::move(rounded);
  return own;
}

GltfReport write(const std::filesystem::path& path, const GltfContent& content, bool binary) {
  const GaussianModel& model = content.model;
  const ModelBlocks own(model);
  const GaussianBlocks& gaussians = content.options.gaussians ? *content.options.gaussians : own;
  if (gaussians.size() == 0) throw Error(ErrorKind::badData, path.string(), "the model has no Gaussians");
  const bool textured = !content.options.gaussians && model.texture_mode != TextureMode::none &&
                        std::any_of(model.atlas.rects.begin(), model.atlas.rects.end(),
                                    [](const TextureRect& r) { return r.texelCount() != 0; });
  GltfReport report;
  Writer writer(content, gaussians, binary);
  writer.addPositions();
  const GaussianModel* given = content.options.base;
  TG_ASSERT(!given || given->size() == model.size(), "the base is of the model's Gaussians");
  const GaussianModel base = !textured ? GaussianModel()
                             : given   ? *given
                                       : bakeFallback(model, FallbackScale::kept);  // outlives the writing
  const Baked baked = textured ? &base : nullptr;
  writer.addShape(textured, baked);
  writer.addOpacity(baked, kSplatExtension);
  writer.addColors(baked);
  Json nested;
  GaussianModel in_steps;  // outlives the writing
  if (textured) {
    std::optional<TexelSteps> steps;
    if (content.options.texture_step) {
      steps = texelStepsOf(model.atlas, textureStep(content.options));
      in_steps = withRoundedTextures(model, writer.roundedTextures(base, *steps), *steps);
    }
    const GaussianModel& stored = steps ? in_steps : model;
    if (hasAlpha(model.texture_mode) || given) writer.addOpacity(&stored, kTextureExtension);
    if (hasColor(model.texture_mode) || given) writer.addDc(stored);
    nested = writer.addTextures(stored, steps, report);
  } else {
    writer.addSource(nullptr, report);
  }
  writer.addScene(std::move(nested));
  report.output_bytes =
      binary ? writer.builder.writeGlb(path) : writer.builder.writeGltf(path, content.options.replace);
  report.clipped_scales = writer.clipped_scales;
  return report;
}

// With the options that others imply.
GltfReport writeAs(const std::filesystem::path& path, const GltfContent& content, bool binary) {
  WriteOptions options = content.options;
  if ((options.steps || options.texture_step) && options.atlas != AtlasFormat::png8 &&
      options.atlas != AtlasFormat::webp) {
    throw Error(ErrorKind::usage, "texels in steps have 8 bits (expected --atlas png8 or webp, found " +
                                      std::string(name(options.atlas)) + ")");
  }
  if (!options.steps || content.model.size() == 0) {
    return write(path,
                 {content.model, content.cameras, content.background, options, content.views, content.knows_background},
                 binary);
  }
  TG_ASSERT(*options.steps >= kLeastSteps && *options.steps <= kMostSteps && !options.gaussians,
            "steps that the formats have, of a model in memory");
  options.quantize = options.meshopt = true;
  if (!options.texture_step) options.texture_step = kTextureStep;
  std::vector<std::uint32_t> order = hilbertOrder(content.model.mean);
  std::ranges::stable_sort(order, {}, [&](std::uint32_t i) {
    return std::ranges::upper_bound(options.parts, std::size_t{i}) - options.parts.begin();
  });
  GaussianModel ordered = select(content.model, order);
  renameAxesForCoding(ordered);
  GaussianModel ordered_base;
  if (options.base) {
    // One rotation is written for both, so its axes have one name: those of a Gaussian with a texture stay in both.
    ordered_base = select(*options.base, order);
    std::vector<TextureRect> rects = std::exchange(ordered_base.atlas.rects, ordered.atlas.rects);
    renameAxesForCoding(ordered_base);
    ordered_base.atlas.rects = std::move(rects);
    options.base = &ordered_base;
  }
  GltfReport report = write(
      path, {ordered, content.cameras, content.background, options, content.views, content.knows_background}, binary);
  report.order = std::move(order);
  return report;
}

}  // namespace

GltfReport writeGlb(const std::filesystem::path& path, const GltfContent& content) {
  return writeAs(path, content, true);
}

bool isBesideGltf(const std::filesystem::path& gltf, const std::filesystem::path& other) {
  const std::string name = other.filename().string(), stem = gltf.stem().string(), atlas = stem + "_atlas_";
  const bool numbered = name.size() > atlas.size() && name[atlas.size()] >= '0' && name[atlas.size()] <= '9';
  return name == stem + ".bin" || (name.starts_with(atlas) && numbered);
}

GltfReport writeGltf(const std::filesystem::path& path, const GltfContent& content) {
  return writeAs(path, content, false);
}

GltfReport writeAtlas(const std::filesystem::path& path, const GltfContent& content) {
  const GaussianModel& model = content.model;
  if (content.options.atlas == AtlasFormat::exr || content.options.atlas == AtlasFormat::webp) {
    throw Error(ErrorKind::usage, std::string("a .png holds no ") +
                                      (content.options.atlas == AtlasFormat::exr ? "EXR" : "WebP") +
                                      " (expected png8 or png16)");
  }
  const TextureMode mode = model.texture_mode;
  PackedAtlas packed = packOnce(model.atlas, textureGroups(model.atlas));
  if (mode == TextureMode::none || packed.pages.empty()) {
    throw Error(ErrorKind::badData, path.string(), "the model has no textures");
  }
  const int bits = bitsOf(content.options.atlas);
  const std::string stem = path.stem().string();
  GltfReport report;
  AtomicFiles files(content.options.replace);
  Json atlases = Json::array();
  const auto put = [&](const Image& image, const std::string& name) {
    const std::vector<std::uint8_t> png = encodePage(image, bits);
    files.add(path.parent_path() / name, png);
    report.output_bytes += png.size();
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
  Json root = {{"format", "tgconvert-atlas"},
               {"version", 1},
               {"mode", name(model.texture_mode)},
               {"intersection", name(model.intersection)},
               {"extent", double{kTextureExtent}},
               {"filter", "bilinear"},
               {"atlases", std::move(atlases)},
               {"rectangles", {{"columns", {"x", "y", "width", "height", "atlas"}}, {"rows", std::move(rectangles)}}}};
  if (model.outside != TextureOutside::base) root["outside"] = name(model.outside);
  const std::string text = root.dump() + "\n";
  files.add(path.parent_path() / (stem + ".json"),
            std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  files.commit();
  report.output_bytes += text.size();
  return report;
}

}  // namespace tg
