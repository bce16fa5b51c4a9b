// SPDX-License-Identifier: Apache-2.0
// Reads the nested extension TG_gaussian_splatting_texture of one primitive.
#include "converter/gltf/texture_layer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>

#include "core/image/image.h"
#include "core/image/webp.h"
#include "core/model/verbs.h"
#include "shared/limits.h"

namespace tg {
namespace {

constexpr const char* kRect = "TG_gaussian_splatting_texture:RECT";
constexpr const char* kAtlas = "TG_gaussian_splatting_texture:ATLAS";
constexpr const char* kScale = "TG_gaussian_splatting_texture:SCALE";
constexpr const char* kOpacity = "TG_gaussian_splatting_texture:OPACITY";
constexpr const char* kDc = "TG_gaussian_splatting_texture:SH_DEGREE_0_COEF_0";
constexpr std::uint64_t kMaxPageTexels = std::uint64_t{1} << 26;  // 8192 x 8192

// One object of the extension with its place in the file.
struct Place {
  const GltfDocument& document;
  const tinygltf::Value& value;
  std::string pointer;

  [[noreturn]] void fail(const std::string& what) const { throw document.bad(pointer, what); }
  bool has(const std::string& key) const { return value.Has(key); }
  const tinygltf::Value& get(const std::string& key) const { return value.Get(key); }
};

std::string quoted(const tinygltf::Value& value) {
  return value.IsString() ? "\"" + value.Get<std::string>() + "\"" : std::string("no string");
}

std::string readChoice(const Place& place, const std::string& key, const std::string& otherwise) {
  if (!place.has(key)) return otherwise;
  if (!place.get(key).IsString()) place.fail("\"" + key + "\" is no string");
  return place.get(key).Get<std::string>();
}

std::array<double, 4> readVec4(const Place& place, const std::string& key, double otherwise) {
  std::array<double, 4> numbers;
  numbers.fill(otherwise);
  if (!place.has(key)) return numbers;
  const tinygltf::Value& list = place.get(key);
  bool ok = list.IsArray() && list.ArrayLen() == 4;
  for (std::size_t k = 0; ok && k < 4; ++k) {
    const tinygltf::Value& number = list.Get(static_cast<int>(k));
    ok = number.IsNumber() && std::isfinite(static_cast<float>(number.GetNumberAsDouble()));
    if (ok) numbers[k] = number.GetNumberAsDouble();
  }
  if (!ok) place.fail("\"" + key + "\" is wrong (expected 4 finite numbers)");
  return numbers;
}

// Width and height of a PNG, from its first chunk: decoders allocate by these numbers.
std::pair<std::uint32_t, std::uint32_t> pngSize(const Place& place, const std::vector<unsigned char>& bytes) {
  constexpr std::array<unsigned char, 8> magic = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  if (bytes.size() < 33 || !std::equal(magic.begin(), magic.end(), bytes.begin())) place.fail("the image is no PNG");
  const auto u32 = [&](std::size_t at) {
    return std::uint32_t{bytes[at]} << 24 | std::uint32_t{bytes[at + 1]} << 16 | std::uint32_t{bytes[at + 2]} << 8 |
           bytes[at + 3];
  };
  return {u32(16), u32(20)};
}

void checkPageSize(const Place& place, std::uint64_t width, std::uint64_t height, std::uint64_t& texels) {
  const std::uint64_t area = width * height;
  texels += area;
  if (area == 0 || area > kMaxPageTexels || texels > kMaxAtlasTexels) {
    place.fail("the atlas is too large (expected at most " + std::to_string(kMaxPageTexels) + " texels, " +
               std::to_string(kMaxAtlasTexels) + " in all, found " + std::to_string(width) + " x " +
               std::to_string(height) + ", " + std::to_string(texels) + " so far)");
  }
}

// Stored integers in [0, 1], and the largest of them.
struct Page {
  Image image;
  double largest = 255.0;
};

Page readPng(const Place& place, const std::vector<unsigned char>& bytes, std::uint64_t& texels) {
  const auto [width, height] = pngSize(place, bytes);
  checkPageSize(place, width, height, texels);
  constexpr std::size_t bit_depth_at = 24;
  return {decodeImage(bytes, place.document.path + ": " + place.pointer), bytes[bit_depth_at] == 16 ? 65535.0 : 255.0};
}

Page readWebp(const Place& place, const std::vector<unsigned char>& bytes, std::uint64_t& texels) {
  const std::string path = place.document.path + ": " + place.pointer;
  const WebpHeader header = readWebpHeader(bytes, path);
  if (!header.lossless) place.fail("a lossy WebP, which mixes texels (expected a lossless one)");
  checkPageSize(place, static_cast<std::uint64_t>(header.width), static_cast<std::uint64_t>(header.height), texels);
  const BytePixels pixels = decodeWebp(bytes, path);
  Page page;
  page.image = Image(pixels.width, pixels.height, 3);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c)
      page.image.data[3 * i + c] = static_cast<float>(pixels.data[4 * i + c]) / 255.0f;
  }
  return page;
}

// An image of the file by way of a texture index.
Page readPage(const Place& place, const std::string& key, std::uint64_t& texels) {
  const tinygltf::Model& model = place.document.model;
  const tinygltf::Value& index = place.get(key);
  const int texture = index.IsInt() ? index.Get<int>() : -1;
  if (texture < 0 || static_cast<std::size_t>(texture) >= model.textures.size()) {
    place.fail("\"" + key + "\" names no texture (expected an index below " + std::to_string(model.textures.size()) +
               ", found " + (index.IsInt() ? std::to_string(texture) : "no integer") + ")");
  }
  const auto& extensions = model.textures[texture].extensions;
  const auto webp = extensions.find(std::string(kWebpExtension));
  const bool is_webp = webp != extensions.end();
  const int source = is_webp ? webp->second.Get("source").GetNumberAsInt() : model.textures[texture].source;
  if (source < 0) place.fail("texture " + std::to_string(texture) + " has no source image");
  const Place image_place{place.document, place.value, "/images/" + std::to_string(source)};
  const tinygltf::Image& image = model.images[source];
  const std::string expected = is_webp ? "image/webp" : "image/png";
  if (!image.mimeType.empty() && image.mimeType != expected) {
    image_place.fail("an atlas of another type (expected " + expected + ", found " + image.mimeType + ")");
  }
  return is_webp ? readWebp(image_place, image.image, texels) : readPng(image_place, image.image, texels);
}

// A stored value in [0, 1] to the texel's. It is taken back to an integer: 128 then is exactly 0 where the offset says
// so.
float texelValue(float stored, double largest, double scale, double offset) {
  return static_cast<float>(std::round(static_cast<double>(stored) * largest) * scale / largest + offset);
}

// The values themselves, of an atlas whose other images have been checked.
Image readValues(const Place& place, TextureMode mode, int width, int height, std::uint64_t& texels) {
  const tinygltf::Model& model = place.document.model;
  const tinygltf::Value& index = place.get("exr");
  const int source = index.IsInt() ? index.Get<int>() : -1;
  if (source < 0 || static_cast<std::size_t>(source) >= model.images.size()) {
    place.fail("\"exr\" names no image (expected an index below " + std::to_string(model.images.size()) + ", found " +
               (index.IsInt() ? std::to_string(source) : "no integer") + ")");
  }
  const Place image_place{place.document, place.value, "/images/" + std::to_string(source)};
  const tinygltf::Image& image = model.images[static_cast<std::size_t>(source)];
  if (image.mimeType != "image/x-exr") {
    image_place.fail("values of another type (expected image/x-exr, found " + image.mimeType + ")");
  }
  std::vector<std::string> channels;
  if (hasColor(mode)) channels = {"R", "G", "B"};
  if (hasAlpha(mode)) channels.push_back("alpha");
  checkPageSize(image_place, static_cast<std::uint64_t>(width), static_cast<std::uint64_t>(height), texels);
  const Image values = decodeExr(image.image, channels, place.document.path + ": " + image_place.pointer);
  if (values.width != width || values.height != height) {
    image_place.fail("the values differ in size from the atlas (expected " + std::to_string(width) + " x " +
                     std::to_string(height) + ", found " + std::to_string(values.width) + " x " +
                     std::to_string(values.height) + ")");
  }
  Image page = neutralPage(width, height);
  const std::span page_texels = pageTexels(page);
  const std::size_t n = channels.size();
  for (std::size_t i = 0; i < page_texels.size(); ++i) {
    glm::vec4& texel = page_texels[i];
    for (int c = 0; c < 3 && hasColor(mode); ++c) texel[c] = values.data[i * n + static_cast<std::size_t>(c)];
    if (hasAlpha(mode)) texel.a = std::clamp(values.data[i * n + n - 1], 0.0f, 1.0f);
    for (int c = 0; c < 4; ++c) {
      if (!std::isfinite(texel[c])) image_place.fail("texel " + std::to_string(i) + " is not finite");
    }
  }
  return page;
}

Image readAtlas(const Place& place, TextureMode mode, std::uint64_t& texels) {
  const std::array<double, 4> scale = readVec4(place, "scale", 1.0);
  const std::array<double, 4> offset = readVec4(place, "offset", 0.0);
  if (hasColor(mode) && !place.has("color")) place.fail("\"color\" is missing (the mode needs it)");
  if (hasAlpha(mode) && !place.has("alpha")) place.fail("\"alpha\" is missing (the mode needs it)");
  const Page color = hasColor(mode) ? readPage(place, "color", texels) : Page();
  const Page alpha = hasAlpha(mode) ? readPage(place, "alpha", texels) : Page();
  if (hasColor(mode) && hasAlpha(mode) &&
      (color.image.width != alpha.image.width || color.image.height != alpha.image.height)) {
    place.fail("the images differ in size (expected " + std::to_string(color.image.width) + " x " +
               std::to_string(color.image.height) + " as color, found " + std::to_string(alpha.image.width) + " x " +
               std::to_string(alpha.image.height) + " for alpha)");
  }
  const int width = std::max(color.image.width, alpha.image.width);
  const int height = std::max(color.image.height, alpha.image.height);
  if (place.has("exr")) return readValues(place, mode, width, height, texels);
  Image page = neutralPage(width, height);
  const std::span page_texels = pageTexels(page);
  const std::size_t color_channels = static_cast<std::size_t>(color.image.channels);
  const std::size_t alpha_channels = static_cast<std::size_t>(alpha.image.channels);
  for (std::size_t i = 0; i < page_texels.size(); ++i) {
    for (int c = 0; c < 3 && hasColor(mode); ++c) {
      const std::size_t k = static_cast<std::size_t>(c);
      const float stored = color.image.data[i * color_channels + (color_channels >= 3 ? k : 0)];
      page_texels[i][c] = texelValue(stored, color.largest, scale[k], offset[k]);
    }
    if (hasAlpha(mode)) {
      const float stored = alpha.image.data[i * alpha_channels];
      page_texels[i].a = std::clamp(texelValue(stored, alpha.largest, scale[3], offset[3]), 0.0f, 1.0f);
    }
  }
  return page;
}

// Whether all could be. Work has a bound: primitives that take turns with two sets decode them again and again.
bool decodeAtlases(const Place& place, TextureMode mode, DecodedAtlases& decoded) {
  const tinygltf::Value& atlases = place.get("atlases");
  decoded.named = nullptr;
  decoded.pages.clear();
  std::uint64_t texels = 0;
  bool all = true;
  for (std::size_t i = 0; i < atlases.ArrayLen(); ++i) {
    const Place atlas{place.document, atlases.Get(static_cast<int>(i)),
                      place.pointer + "/atlases/" + std::to_string(i)};
    all = place.document.attempt([&] {
      if (!atlas.value.IsObject()) atlas.fail("is no object");
      decoded.pages.push_back(readAtlas(atlas, mode, texels));
    }) && all;
  }
  decoded.texels += texels;
  place.document.attempt([&] {
    if (decoded.texels <= kMaxModelTexels) return;
    all = false;
    place.fail("the atlases of all primitives are too large (expected at most " + std::to_string(kMaxModelTexels) +
               " texels, found " + std::to_string(decoded.texels) + " so far)");
  });
  if (!all) return false;
  decoded.mode = mode;
  decoded.named = &atlases;
  return true;
}

std::vector<AtlasPlacement> readPlacements(const GltfDocument& document, const SplatPrimitive& splats) {
  const std::vector<float> rects = readAttribute(document, splats, {kRect, 4, kUnsignedShort});
  std::vector<float> atlases;
  if (splats.has(kAtlas)) atlases = readAttribute(document, splats, {kAtlas, 1, kUnsignedByte});
  std::vector<AtlasPlacement> placements(splats.count);
  for (std::size_t i = 0; i < splats.count; ++i) {
    AtlasPlacement p;
    p.x = static_cast<std::uint16_t>(rects[i * 4]);
    p.y = static_cast<std::uint16_t>(rects[i * 4 + 1]);
    p.w = static_cast<std::uint16_t>(rects[i * 4 + 2]);
    p.h = static_cast<std::uint16_t>(rects[i * 4 + 3]);
    p.page = atlases.empty() ? 0 : static_cast<std::uint8_t>(atlases[i]);
    if (p.w != 0 && p.h != 0) placements[i] = p;
  }
  return placements;
}

void checkPlacements(const GltfDocument& document, const SplatPrimitive& splats, const std::vector<Image>& pages,
                     const std::vector<AtlasPlacement>& placements) {
  for (std::size_t i = 0; i < splats.count; ++i) {
    const AtlasPlacement& p = placements[i];
    if (p.w == 0) continue;
    const std::string splat = "splat " + std::to_string(i);
    if (p.page >= pages.size()) {
      throw document.bad(splats.pointer + "/attributes/" + kAtlas, splat + " names no atlas (expected below " +
                                                                       std::to_string(pages.size()) + ", found " +
                                                                       std::to_string(p.page) + ")");
    }
    const Image& page = pages[p.page];
    if (p.x + p.w > page.width || p.y + p.h > page.height) {
      throw document.bad(splats.pointer + "/attributes/" + kRect,
                         splat + ": the rectangle leaves its atlas (expected within " + std::to_string(page.width) +
                             " x " + std::to_string(page.height) + ", found " + std::to_string(p.x) + " + " +
                             std::to_string(p.w) + ", " + std::to_string(p.y) + " + " + std::to_string(p.h) + ")");
    }
  }
}

TextureAtlas copyRectangles(const GltfDocument& document, const SplatPrimitive& splats, const std::vector<Image>& pages,
                            const std::vector<AtlasPlacement>& placements) {
  std::uint64_t page_texels = 0;
  for (const Image& page : pages) page_texels += pageTexels(page).size();
  std::uint64_t wanted = 0;
  for (const AtlasPlacement& p : placements) wanted += std::uint64_t{p.w} * p.h;
  if (const std::uint64_t limit = std::max(page_texels, kFreeSharedTexels); wanted > limit) {
    throw document.bad(splats.pointer + "/attributes/" + kRect, "the rectangles overlap too much (expected at most " +
                                                                    std::to_string(limit) + " texels in all, found " +
                                                                    std::to_string(wanted) + ")");
  }
  TextureAtlas atlas;
  atlas.texels.reserve(wanted);
  for (const AtlasPlacement& p : placements) {
    atlas.rects.push_back({static_cast<std::uint32_t>(atlas.texels.size()), p.w, p.h});
    const Image& page = pages[p.page];
    for (int row = 0; row < p.h; ++row) {
      const auto first = pageTexels(page).begin() + static_cast<std::ptrdiff_t>(p.y + row) * page.width + p.x;
      atlas.texels.insert(atlas.texels.end(), first, first + p.w);
    }
  }
  return atlas;
}

}  // namespace

const tinygltf::Value* findTextureExtension(const tinygltf::Primitive& primitive) {
  const auto splatting = primitive.extensions.find(std::string(kSplatExtension));
  if (splatting == primitive.extensions.end() || !splatting->second.Has("extensions")) return nullptr;
  const tinygltf::Value& nested = splatting->second.Get("extensions");
  return nested.Has(std::string(kTextureExtension)) ? &nested.Get(std::string(kTextureExtension)) : nullptr;
}

TextureLayer readTextureLayer(const GltfDocument& document, const SplatPrimitive& splats,
                              const tinygltf::Value& extension, DecodedAtlases& decoded) {
  const Place place{
      document, extension,
      splats.pointer + "/extensions/" + std::string(kSplatExtension) + "/extensions/" + std::string(kTextureExtension)};
  if (!extension.IsObject()) place.fail("is no object");
  TextureLayer layer;
  const auto attempt = [&](auto step) { return document.attempt(step); };
  const bool has_mode = attempt([&] {
    const std::optional<TextureMode> mode = parse<TextureMode>(readChoice(place, "mode", ""));
    if (!mode || *mode == TextureMode::none) {
      place.fail("unknown \"mode\" (expected \"alpha\", \"rgb\" or \"rgba\", found " + quoted(place.get("mode")) + ")");
    }
    layer.mode = *mode;
  });
  attempt([&] {
    const std::optional<IntersectionModel> intersection =
        parse<IntersectionModel>(readChoice(place, "intersection", "plane"));
    if (!intersection) {
      place.fail("unknown \"intersection\" (expected \"plane\" or \"maxResponse\", found " +
                 quoted(place.get("intersection")) + ")");
    }
    layer.intersection = *intersection;
  });
  attempt([&] {
    if (!place.has("extent")) return;
    const tinygltf::Value& extent = place.get("extent");
    if (!extent.IsNumber() || extent.GetNumberAsDouble() != kTextureExtent) {
      place.fail("\"extent\" is not supported (expected 3, found " +
                 (extent.IsNumber() ? std::to_string(extent.GetNumberAsDouble()) : std::string("no number")) + ")");
    }
  });
  attempt([&] {
    if (readChoice(place, "filter", "bilinear") != "bilinear") {
      place.fail("\"filter\" is not supported (expected \"bilinear\", found " + quoted(place.get("filter")) + ")");
    }
  });
  const tinygltf::Value& atlases = place.get("atlases");
  const bool has_atlases = attempt([&] {
    if (!atlases.IsArray() || atlases.ArrayLen() == 0 || atlases.ArrayLen() > kMaxAtlasPages) {
      place.fail("\"atlases\" is wrong (expected an array of 1 to 255, found " +
                 (atlases.IsArray() ? std::to_string(atlases.ArrayLen()) : std::string("none")) + ")");
    }
  });
  // The attributes first: an image can cost much more to decode.
  std::vector<AtlasPlacement> placements;
  const bool has_placements = attempt([&] { placements = readPlacements(document, splats); });
  attempt([&] {
    if (splats.has(kScale)) layer.scale = readAttribute(document, splats, {kScale, 3, kFloat});
  });
  attempt([&] {
    if (!splats.has(kOpacity)) return;
    layer.opacity =
        readAttribute(document, splats, {kOpacity, 1, kFloat | kUnsignedByteNormalized | kUnsignedShortNormalized});
  });
  attempt([&] {
    if (splats.has(kDc)) layer.dc = readAttribute(document, splats, {kDc, 3, kFloat});
  });
  if (!has_mode || !has_atlases) return layer;
  if (decoded.named == nullptr || decoded.mode != layer.mode || !(*decoded.named == atlases)) {
    if (!decodeAtlases(place, layer.mode, decoded)) return layer;
  }
  if (!has_placements) return layer;
  attempt([&] {
    checkPlacements(document, splats, decoded.pages, placements);
    layer.atlas = copyRectangles(document, splats, decoded.pages, placements);
  });
  return layer;
}

}  // namespace tg
