// SPDX-License-Identifier: Apache-2.0
// Shelf packing of texture rectangles into pages, and back.
#include "core/model/atlas.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "core/model/unpack_atlas.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

constexpr glm::vec4 kNeutralTexel{0.0f, 0.0f, 0.0f, 1.0f};

std::string sizeText(std::uint64_t w, std::uint64_t h) { return std::to_string(w) + " x " + std::to_string(h); }

// A page wide enough to come out about square when everything fits on one.
int pageWidth(std::uint64_t texels, int widest, int max_page_size) {
  std::uint64_t width = 16;
  while (width * width < texels) width *= 2;
  return static_cast<int>(std::min<std::uint64_t>(std::max<std::uint64_t>(width, static_cast<std::uint64_t>(widest)),
                                                  static_cast<std::uint64_t>(max_page_size)));
}

}  // namespace

TextureAtlas makeUniformAtlas(std::size_t gaussian_count, int width, int height) {
  if (width < 0 || height < 0 || width > 65535 || height > 65535 || (width == 0) != (height == 0)) {
    throw Error(ErrorKind::badData, "texture size out of range (expected 1 to 65535 a side, or 0 x 0, found " +
                                        std::to_string(width) + " x " + std::to_string(height) + ")");
  }
  const std::uint64_t each = static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height);
  if (each > 0 && gaussian_count > kMaxOffset / each) {
    throw Error(ErrorKind::badData, "too many texels (expected at most " + std::to_string(kMaxOffset) + ", found " +
                                        std::to_string(gaussian_count) + " textures of " + std::to_string(each) + ")");
  }
  TextureAtlas atlas;
  const TextureRect rect{0, static_cast<std::uint16_t>(width), static_cast<std::uint16_t>(height)};
  atlas.rects.assign(gaussian_count, rect);
  for (std::size_t i = 0; i < gaussian_count; ++i) atlas.rects[i].offset = static_cast<std::uint32_t>(i * each);
  atlas.texels.assign(gaussian_count * each, kNeutralTexel);
  return atlas;
}

std::vector<double> texelShares(int size) {
  TG_ASSERT(size >= 1, "a texture has a texel at least");
  std::vector<double> shares(static_cast<std::size_t>(size), 0.0);
  if (size == 1) return {1.0};
  constexpr double kExtent = 3.0;
  const double step = 2.0 * kExtent / (size - 1);
  const auto density = [](double u) { return std::exp(-0.5 * u * u) / std::sqrt(2.0 * std::numbers::pi); };
  const auto integral = [](double u) { return 0.5 * std::erf(u / std::numbers::sqrt2); };
  const double whole = integral(kExtent) - integral(-kExtent);
  for (int cell = 0; cell + 1 < size; ++cell) {
    const double low = -kExtent + cell * step;
    const double high = low + step;
    const double mass = integral(high) - integral(low);
    const double moment = density(low) - density(high);  // of u
    const double upper = (moment - low * mass) / step;   // of the hat that rises over the cell
    shares[static_cast<std::size_t>(cell)] += (mass - upper) / whole;
    shares[static_cast<std::size_t>(cell) + 1] += upper / whole;
  }
  return shares;
}

std::vector<glm::vec4> textureMeans(const TextureAtlas& atlas, std::size_t gaussian_count) {
  TG_ASSERT(atlas.rects.empty() || atlas.rects.size() == gaussian_count, "a rectangle a Gaussian, or none");
  std::map<int, std::vector<double>> shares;
  for (const TextureRect& rect : atlas.rects) {
    for (int size : {int{rect.width}, int{rect.height}}) {
      if (size > 0 && !shares.contains(size)) shares.emplace(size, texelShares(size));
    }
  }
  std::vector<glm::vec4> means(gaussian_count, kNeutralTexel);
  parallelFor(static_cast<std::int64_t>(std::min(gaussian_count, atlas.rects.size())), 1024, [&](std::int64_t i) {
    const TextureRect& rect = atlas.rects[i];
    if (rect.texelCount() == 0) return;
    const std::vector<double>& across = shares.at(rect.width);
    const std::vector<double>& down = shares.at(rect.height);
    glm::dvec4 mean(0.0);
    const glm::vec4* texel = &atlas.texels[rect.offset];
    for (const double row : down) {
      for (const double column : across) mean += row * column * glm::dvec4(*texel++);
    }
    means[i] = mean;
  });
  return means;
}

Image neutralPage(int width, int height) {
  TG_ASSERT(width >= 0 && height >= 0, "a page has sides from 0 on");
  Image page(width, height, 4);
  std::ranges::fill(pageTexels(page), kNeutralTexel);
  return page;
}

PackedAtlas packAtlas(const TextureAtlas& atlas, std::size_t gaussian_count, int max_page_size) {
  PackedAtlas packed;
  packed.placements.resize(gaussian_count);
  if (atlas.rects.empty()) return packed;
  if (atlas.rects.size() != gaussian_count) {
    throw Error(ErrorKind::badData,
                "wrong number of texture rectangles" + expectedFound(gaussian_count, atlas.rects.size()));
  }
  max_page_size = std::clamp(max_page_size, 1, 65535);

  std::uint64_t texels = 0;
  int widest = 0;
  std::vector<std::uint32_t> order;
  for (std::size_t i = 0; i < gaussian_count; ++i) {
    const TextureRect& rect = atlas.rects[i];
    if (rect.texelCount() == 0) continue;
    if (rect.width > max_page_size || rect.height > max_page_size) {
      throw Error(ErrorKind::badData,
                  "Gaussian " + std::to_string(i) + ": texture does not fit a page (expected at most " +
                      std::to_string(max_page_size) + " a side, found " + sizeText(rect.width, rect.height) + ")");
    }
    if (std::uint64_t{rect.offset} + rect.texelCount() > atlas.texels.size()) {
      throw Error(ErrorKind::badData, "Gaussian " + std::to_string(i) + ": texture rectangle leaves the atlas");
    }
    texels += rect.texelCount();
    widest = std::max<int>(widest, rect.width);
    order.push_back(static_cast<std::uint32_t>(i));
  }
  if (order.empty()) return packed;
  // Tall shelves first: what is left at the end of a page is as thin as possible.
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const std::uint16_t height_a = atlas.rects[a].height, height_b = atlas.rects[b].height;
    return height_a != height_b ? height_a > height_b : a < b;
  });

  const int page_width = pageWidth(texels, widest, max_page_size);
  int page_height = 0;  // the tallest of the pages
  int page = 0;
  int x = 0;
  int y = 0;
  int shelf = atlas.rects[order[0]].height;
  for (std::uint32_t i : order) {
    const TextureRect& rect = atlas.rects[i];
    if (x + rect.width > page_width || rect.height != shelf) {
      x = 0;
      y += shelf;
      shelf = rect.height;
    }
    if (y + shelf > max_page_size) {
      x = y = 0;
      if (++page == kMaxAtlasPages) {
        throw Error(ErrorKind::badData,
                    "textures need more than " + std::to_string(kMaxAtlasPages) + " pages of " +
                        sizeText(static_cast<std::uint64_t>(max_page_size), static_cast<std::uint64_t>(max_page_size)) +
                        " texels");
      }
    }
    packed.placements[i] = {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y), rect.width, rect.height,
                            static_cast<std::uint8_t>(page)};
    x += rect.width;
    page_height = std::max(page_height, y + shelf);
  }

  packed.pages.resize(static_cast<std::size_t>(page) + 1);
  for (Image& image : packed.pages) image = neutralPage(page_width, page_height);
  for (std::uint32_t i : order) {
    const AtlasPlacement& at = packed.placements[i];
    const glm::vec4* from = atlas.texels.data() + atlas.rects[i].offset;
    glm::vec4* to = &pageTexels(packed.pages[at.page])[std::size_t{at.y} * static_cast<std::size_t>(page_width) + at.x];
    for (int row = 0; row < at.h; ++row, from += at.w, to += page_width) std::copy_n(from, at.w, to);
  }
  return packed;
}

TextureAtlas unpackAtlas(std::span<const AtlasPlacement> placements, int pages, glm::ivec2 size,
                         const std::function<Image(int page)>& decode, const std::string& path) {
  const std::uint64_t available =
      static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(size.x) * static_cast<std::uint64_t>(size.y);
  TextureAtlas atlas;
  atlas.rects.resize(placements.size());
  std::vector<std::vector<std::size_t>> lying(static_cast<std::size_t>(pages));  // Gaussians on each page
  std::uint64_t used = 0;
  for (std::size_t i = 0; i < placements.size(); ++i) {
    const AtlasPlacement& at = placements[i];
    const auto fail = [&](const std::string& what) {
      return Error(ErrorKind::badData, path, "Gaussian " + std::to_string(i) + ": " + what);
    };
    if ((at.w == 0) != (at.h == 0)) {
      throw fail("texture rectangle has one empty side (found " + sizeText(at.w, at.h) + ")");
    }
    if (at.w == 0) continue;
    if (at.page >= lying.size()) {
      throw fail("texture rectangle lies on a missing page (expected less than " + std::to_string(lying.size()) +
                 ", found " + std::to_string(at.page) + ")");
    }
    if (at.x + at.w > size.x || at.y + at.h > size.y) {
      throw fail("texture rectangle leaves its page (expected within " +
                 sizeText(static_cast<std::uint64_t>(size.x), static_cast<std::uint64_t>(size.y)) + ", found " +
                 sizeText(at.w, at.h) + " at " + std::to_string(at.x) + ", " + std::to_string(at.y) + ")");
    }
    lying[at.page].push_back(i);
    atlas.rects[i] = {static_cast<std::uint32_t>(used), at.w, at.h};
    used += atlas.rects[i].texelCount();
    // Also the bound on what is allocated below.
    if (used > available || used > kMaxOffset) {
      throw fail("texture rectangles overlap (they hold more texels than the pages' " + std::to_string(available) +
                 ")");
    }
  }
  atlas.texels.resize(used);
  parallelFor(pages, 1, [&](std::int64_t number) {
    const std::vector<std::size_t>& gaussians = lying[static_cast<std::size_t>(number)];
    if (gaussians.empty()) return;
    const Image page = decode(static_cast<int>(number));
    if (glm::ivec2(page.width, page.height) != size || page.channels != 4 || !hasImageShape(page)) {
      throw Error(ErrorKind::badData, path, "atlas page " + std::to_string(number) + " has no consistent size");
    }
    for (const std::size_t i : gaussians) {
      const AtlasPlacement& at = placements[i];
      const glm::vec4* from = &pageTexels(page)[std::size_t{at.y} * static_cast<std::size_t>(size.x) + at.x];
      glm::vec4* to = atlas.texels.data() + atlas.rects[i].offset;
      for (int row = 0; row < at.h; ++row, from += size.x, to += at.w) std::copy_n(from, at.w, to);
    }
  });
  return atlas;
}

TextureAtlas unpackAtlas(const PackedAtlas& packed, const std::string& path) {
  const glm::ivec2 size =
      packed.pages.empty() ? glm::ivec2(0) : glm::ivec2(packed.pages[0].width, packed.pages[0].height);
  return unpackAtlas(
      packed.placements, static_cast<int>(packed.pages.size()), size,
      [&](int page) { return packed.pages[static_cast<std::size_t>(page)]; }, path);
}

}  // namespace tg
