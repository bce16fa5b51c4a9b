// SPDX-License-Identifier: Apache-2.0
// Packing rectangles into pages and back, and the promises of a model.
#include <atomic>
#include <limits>

#include "core/model/atlas.h"
#include "core/model/model.h"
#include "core/model/unpack_atlas.h"
#include "core/system/error.h"
#include "core/tiny_model.h"
#include "support/catch.h"

TEST_CASE("packing and unpacking give every Gaussian its texels back, with consecutive offsets") {
  for (int max_page : {8, 16, 64, 4096}) {
    const tg::GaussianModel model = tg::tinyTexturedModel(200);
    const tg::PackedAtlas packed = tg::packAtlas(model.atlas, model.size(), max_page);
    for (const tg::Image& page : packed.pages) {
      REQUIRE(page.width <= max_page);
      REQUIRE(page.height <= max_page);
      REQUIRE(page.width == packed.pages[0].width);
      REQUIRE(page.height == packed.pages[0].height);
    }
    const tg::TextureAtlas back = tg::unpackAtlas(packed, "a");
    REQUIRE(back.rects == model.atlas.rects);
    REQUIRE(back.texels == model.atlas.texels);
  }
}

TEST_CASE("pages are decoded once each, and those without a rectangle never") {
  const tg::GaussianModel model = tg::tinyTexturedModel(300);
  const tg::PackedAtlas packed = tg::packAtlas(model.atlas, model.size(), 32);
  const int pages = static_cast<int>(packed.pages.size());
  REQUIRE(pages > 1);
  std::vector<std::atomic<int>> decoded(packed.pages.size() + 1);
  const tg::TextureAtlas back = tg::unpackAtlas(
      packed.placements, pages + 1, {packed.pages[0].width, packed.pages[0].height},
      [&](int page) {
        ++decoded[static_cast<std::size_t>(page)];
        return packed.pages[static_cast<std::size_t>(page)];
      },
      "a");
  REQUIRE(back.texels == model.atlas.texels);
  for (int page = 0; page <= pages; ++page) CHECK(decoded[static_cast<std::size_t>(page)] == (page < pages ? 1 : 0));
  CHECK_THROWS_AS(tg::unpackAtlas(
                      packed.placements, pages, {packed.pages[0].width, packed.pages[0].height},
                      [](int) { return tg::Image(1, 1, 4); }, "a"),
                  tg::Error);
}

TEST_CASE("packed rectangles never overlap and free texels are neutral") {
  tg::GaussianModel model = tg::tinyTexturedModel(300);
  for (glm::vec4& texel : model.atlas.texels) texel = glm::vec4(5);
  const tg::PackedAtlas packed = tg::packAtlas(model.atlas, model.size(), 32);
  REQUIRE(packed.pages.size() > 1);
  std::vector<std::vector<int>> hits;
  for (const tg::Image& page : packed.pages) hits.emplace_back(tg::pageTexels(page).size(), 0);
  for (const tg::AtlasPlacement& at : packed.placements) {
    for (int y = at.y; y < at.y + at.h; ++y) {
      for (int x = at.x; x < at.x + at.w; ++x) {
        ++hits[at.page][static_cast<std::size_t>(y * packed.pages[at.page].width + x)];
      }
    }
  }
  for (std::size_t page = 0; page < hits.size(); ++page) {
    for (std::size_t i = 0; i < hits[page].size(); ++i) {
      REQUIRE(hits[page][i] <= 1);
      REQUIRE(tg::pageTexels(packed.pages[page])[i] == (hits[page][i] ? glm::vec4(5) : glm::vec4(0, 0, 0, 1)));
    }
  }
}

TEST_CASE("uniform textures waste little") {
  const tg::TextureAtlas atlas = tg::makeUniformAtlas(10000, 4, 4);
  REQUIRE(atlas.texels.size() == 160000);
  REQUIRE(atlas.texels[77] == glm::vec4(0, 0, 0, 1));
  REQUIRE(atlas.rects[3] == tg::TextureRect{48, 4, 4});
  const tg::PackedAtlas packed = tg::packAtlas(atlas, 10000);
  REQUIRE(packed.pages.size() == 1);
  REQUIRE(tg::pageTexels(packed.pages[0]).size() < 164000);
}

TEST_CASE("an atlas without rectangles packs to no pages") {
  const tg::PackedAtlas packed = tg::packAtlas({}, 3);
  REQUIRE(packed.pages.empty());
  REQUIRE(packed.placements.size() == 3);
  REQUIRE(tg::unpackAtlas(packed, "a").texels.empty());
}

TEST_CASE("what does not fit is refused by Gaussian") {
  const tg::TextureAtlas wide = tg::makeUniformAtlas(2, 17, 1);
  REQUIRE_THROWS_WITH(tg::packAtlas(wide, 2, 16), Contains("Gaussian 0: texture does not fit a page"));
  REQUIRE_THROWS_WITH(tg::packAtlas(tg::makeUniformAtlas(256, 2, 2), 256, 2), Contains("more than 255 pages"));
  REQUIRE(tg::packAtlas(tg::makeUniformAtlas(255, 2, 2), 255, 2).pages.size() == 255);
  REQUIRE_THROWS_AS(tg::packAtlas(wide, 3), tg::Error);
  REQUIRE_THROWS_AS(tg::makeUniformAtlas(1 << 20, 65535, 65535), tg::Error);
  REQUIRE_THROWS_AS(tg::makeUniformAtlas(1, 0, 3), tg::Error);
  REQUIRE_THROWS_AS(tg::makeUniformAtlas(1, -1, -1), tg::Error);
}

TEST_CASE("a valid model passes, and each broken promise is named with its first Gaussian") {
  const tg::GaussianModel good = tg::tinyTexturedModel(9000);
  REQUIRE_NOTHROW(tg::checkModel(good, "m"));
  const auto broken = [&](auto change) {
    tg::GaussianModel model = good;
    change(model);
    tg::checkModel(model, "m");
  };
  constexpr float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.mean[8000].y = nan, m.mean[5].z = inf; }),
                      Contains("m: Gaussian 5: mean"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.rotation[4096].w = nan; }), Contains("Gaussian 4096: rotation is not"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.rotation[7] = glm::vec4(0); }), Contains("Gaussian 7: rotation has no"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.rotation[7] = glm::vec4(1e30f); }),
                      Contains("Gaussian 7: rotation has no"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.log_scale[1].x = -inf; }), Contains("Gaussian 1: log_scale"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.opacity_logit[2] = nan; }), Contains("Gaussian 2: opacity_logit"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.sh[4 * 3 + 2].x = nan; }), Contains("Gaussian 3: sh coefficient 2"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.atlas.texels[0].g = nan; }),
                      Contains("Gaussian 0: texel 0 is not finite"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.atlas.texels[0].a = -0.5f; }),
                      Contains("Gaussian 0: texel 0 has an alpha"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.atlas.rects[3].offset = 0xffffffffu; }),
                      Contains("Gaussian 3: texture rectangle leaves"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.atlas.rects[3].width = 0; }),
                      Contains("Gaussian 3: texture rectangle has one empty"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.atlas.rects.pop_back(); }), Contains("wrong length of atlas.rects"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.sh.pop_back(); }), Contains("wrong length of sh"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.opacity_logit.clear(); }), Contains("wrong length of opacity_logit"));
  REQUIRE_THROWS_WITH(broken([&](auto& m) { m.sh_degree = 4; }), Contains("wrong SH degree"));
}

TEST_CASE("mode names are read back") {
  for (unsigned i = 0; i < 4; ++i) {
    const auto mode = static_cast<tg::TextureMode>(i);
    REQUIRE(tg::parse<tg::TextureMode>(tg::name(mode)) == mode);
  }
  for (unsigned i = 0; i < 2; ++i) {
    const auto model = static_cast<tg::IntersectionModel>(i);
    REQUIRE(tg::parse<tg::IntersectionModel>(tg::name(model)) == model);
  }
  REQUIRE_FALSE(tg::parse<tg::TextureMode>("RGBA"));
  REQUIRE_FALSE(tg::parse<tg::IntersectionModel>(""));
}
