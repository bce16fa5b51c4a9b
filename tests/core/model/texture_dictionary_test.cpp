// SPDX-License-Identifier: Apache-2.0
// Textures that Gaussians share.
#include "core/model/texture_dictionary.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>

#include "core/system/parallel.h"
#include "core/system/random.h"
#include "support/catch.h"

using namespace tg;

namespace {

GaussianModel texturedModel(std::size_t count, int side, std::uint64_t seed) {
  Random random(seed);
  GaussianModel model;
  model.texture_mode = TextureMode::rgba;
  for (std::size_t i = 0; i < count; ++i) {
    model.mean.push_back(glm::vec3(random.normal(), random.normal(), random.normal()));
    model.rotation.push_back(glm::vec4(random.normal(), random.normal(), random.normal(), random.normal()));
    model.log_scale.push_back(glm::vec3(random.normal(), random.normal(), random.normal()));
    model.opacity_logit.push_back(0.5f);
    model.sh.push_back(glm::vec3(0.1f));
  }
  model.atlas = makeUniformAtlas(count, side, side);
  for (glm::vec4& texel : model.atlas.texels) {
    texel = glm::vec4(random.normal(), random.normal(), random.normal(), random.uniform());
  }
  return model;
}

// The texture's value at a point of the plane, and the density there: what a ray meets, whatever the axes are called.
glm::vec4 texelAt(const GaussianModel& model, std::size_t i, const glm::dvec3& offset, double& distance) {
  const glm::vec4 q = model.rotation[i];
  const glm::dmat3 axes = glm::mat3_cast(glm::normalize(glm::dquat(q.x, q.y, q.z, q.w)));
  const glm::dvec3 p = glm::transpose(axes) * offset / glm::exp(glm::dvec3(model.log_scale[i]));
  distance = glm::length(p);
  const glm::vec3 s = model.log_scale[i];
  const int c = s.x <= s.y && s.x <= s.z ? 0 : s.y <= s.z ? 1 : 2, a = c == 0 ? 1 : 0, b = 3 - a - c;
  const TextureRect rect = model.atlas.rects[i];
  const auto nearest = [&](double u) {
    return static_cast<std::uint32_t>(std::clamp(std::lround((u + 3) / 6 * (rect.width - 1)), 0l, rect.width - 1l));
  };
  return model.atlas.texels[rect.offset + nearest(p[b]) * rect.width + nearest(p[a])];
}

}  // namespace

TEST_CASE("textures of one group are equal in every texel and in size", "[textures]") {
  TextureAtlas atlas;
  const auto add = [&](int width, int height, std::vector<glm::vec4> texels) {
    atlas.rects.push_back({static_cast<std::uint32_t>(atlas.texels.size()), static_cast<std::uint16_t>(width),
                           static_cast<std::uint16_t>(height)});
    atlas.texels.insert(atlas.texels.end(), texels.begin(), texels.end());
  };
  const glm::vec4 a(0.1f), b(0.2f);
  add(2, 1, {a, b});
  add(1, 2, {a, b});
  add(2, 1, {b, a});
  add(0, 0, {});
  add(2, 1, {a, b});
  add(0, 0, {});
  CHECK(textureGroups(atlas) == std::vector<std::uint32_t>{0, 1, 2, 3, 0, 3});
  CHECK(textureGroups({}).empty());
}

TEST_CASE("textures are shared where two Gaussians that have one have the same in the mean", "[textures]") {
  const auto shared = [](const std::vector<float>& textures) {  // of a texel; below 0: none
    TextureAtlas atlas;
    for (const float texture : textures) {
      const std::uint16_t side = texture >= 0 ? 1 : 0;
      atlas.rects.push_back({static_cast<std::uint32_t>(atlas.texels.size()), side, side});
      if (side == 1) atlas.texels.emplace_back(texture);
    }
    return areShared(atlas, textureGroups(atlas));
  };
  CHECK_FALSE(shared({}));
  CHECK_FALSE(shared({0.1f, 0.2f, 0.2f}));
  CHECK(shared({0.1f, 0.2f, 0.2f, 0.1f}));
  CHECK_FALSE(shared({-1, -1, -1, -1, 0.1f, 0.2f}));
  CHECK(shared({-1, -1, -1, -1, 0.1f, 0.1f}));
  CHECK_FALSE(shared({-1, -1}));
}

TEST_CASE("what is shared is held once, where every rectangle that has it lies", "[textures]") {
  TextureAtlas atlas = texturedModel(5, 3, 4).atlas;
  CHECK_FALSE(heldOnce(atlas));
  CHECK_FALSE(heldOnce({}));
  const auto copy = [&](std::size_t from, std::size_t to) {
    std::copy_n(atlas.texels.begin() + atlas.rects[from].offset, 9, atlas.texels.begin() + atlas.rects[to].offset);
  };
  copy(1, 0);
  copy(3, 2);
  copy(3, 4);
  const std::optional<TextureAtlas> once = heldOnce(atlas);
  REQUIRE(once);
  CHECK(once->texels.size() == 18);
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(once->rects[i].offset == (i < 2 ? 0u : 9u));
    CHECK(once->rects[i].width == 3);
    CHECK(once->rects[i].height == 3);
    for (std::uint32_t t = 0; t < 9; ++t) {
      CHECK(once->texels[once->rects[i].offset + t] == atlas.texels[atlas.rects[i].offset + t]);
    }
  }
}

TEST_CASE("textures that are one another turned become one, and every Gaussian shows what it showed", "[textures]") {
  const int side = 4;
  GaussianModel model = texturedModel(40, side, 3);
  // Of some two axes are the shortest; of those the first is the normal.
  for (std::size_t i = 8; i < 24; ++i) model.log_scale[i] = i < 16 ? glm::vec3(-1, -2, -2) : glm::vec3(-2, -1, -2);
  // All have the first one's texture, in one of the eight ways.
  const std::vector<glm::vec4> first(model.atlas.texels.begin(), model.atlas.texels.begin() + side * side);
  for (std::size_t i = 0; i < model.size(); ++i) {
    for (int v = 0; v < side; ++v) {
      for (int u = 0; u < side; ++u) {
        int a = i & 1 ? side - 1 - u : u, b = i & 2 ? side - 1 - v : v;
        if (i & 4) std::swap(a, b);
        model.atlas.texels[model.atlas.rects[i].offset + v * side + u] = first[b * side + a];
      }
    }
  }
  GaussianModel shared = model;
  shareTextures(shared, 2, std::vector<double>(model.size(), 1.0), 0.0, 1);
  const std::vector<std::uint32_t> groups = textureGroups(shared.atlas);
  CHECK(std::ranges::all_of(groups, [&](std::uint32_t group) { return group == groups[0]; }));
  Random random(9);
  for (std::size_t i = 0; i < model.size(); ++i) {
    for (int n = 0; n < 50; ++n) {
      const glm::dvec3 offset =
          glm::dvec3(random.normal(), random.normal(), random.normal()) * glm::exp(glm::dvec3(model.log_scale[i]));
      double before = 0, after = 0;
      const glm::vec4 was = texelAt(model, i, offset, before), is = texelAt(shared, i, offset, after);
      INFO(i << ": " << n);
      CHECK(after == Approx(before).epsilon(1e-5));
      CHECK(glm::length(was - is) < 1e-5f);
    }
  }
}

TEST_CASE("no more textures are left than were asked for, those that weigh most nearest", "[textures]") {
  GaussianModel model = texturedModel(300, 3, 5);
  std::vector<double> weights(model.size(), 1e-3);
  for (std::size_t i = 0; i < 4; ++i) weights[i] = 1e3;
  const GaussianModel before = model;
  shareTextures(model, 16, weights, 0.0, 7);
  const std::vector<std::uint32_t> groups = textureGroups(model.atlas);
  CHECK(*std::ranges::max_element(groups) < 16);
  CHECK(areShared(model.atlas, groups));
  double heavy = 0, light = 0;  // what is lost, without regard to turns: a turned texture has the same sum
  const auto sumOf = [](const GaussianModel& of, std::size_t i) {
    glm::dvec4 sum(0.0);
    for (std::uint32_t t = 0; t < 9; ++t) sum += glm::dvec4(of.atlas.texels[of.atlas.rects[i].offset + t]);
    return sum;
  };
  for (std::size_t i = 0; i < model.size(); ++i) {
    (i < 4 ? heavy : light) += glm::length(sumOf(model, i) - sumOf(before, i)) / (i < 4 ? 4 : 296);
  }
  CHECK(heavy < 0.05 * light);
  checkModel(model, "model");

  SECTION("the same seed gives the same textures, with any number of threads") {
    GaussianModel again = before;
    setThreadCount(1);
    shareTextures(again, 16, weights, 0.0, 7);
    setThreadCount(0);
    CHECK(again.atlas == model.atlas);
    CHECK(again.rotation == model.rotation);
    GaussianModel other = before;
    shareTextures(other, 16, weights, 0.0, 8);
    CHECK_FALSE(other.atlas == model.atlas);
  }
}

TEST_CASE("a price on bits leaves choices that are told in fewer, and what weighs most its texture", "[textures]") {
  const GaussianModel model = texturedModel(400, 2, 8);
  std::vector<double> weights(model.size(), 1e-2);
  for (std::size_t i = 0; i < 12; ++i) weights[i] = 1.0;
  const auto shared = [&](double bit_cost) {
    GaussianModel copy = model;
    shareTextures(copy, 16, weights, bit_cost, 3);
    return copy;
  };
  const auto bits = [](const GaussianModel& of) {  // of a choice, in the mean
    const std::vector<std::uint32_t> groups = textureGroups(of.atlas);
    std::vector<double> users(firstOfGroups(groups).size());
    for (const std::uint32_t group : groups) users[group] += 1.0;
    double sum = 0;
    for (const double n : users) sum += n * std::log2(static_cast<double>(groups.size()) / n);
    return sum / static_cast<double>(groups.size());
  };
  const GaussianModel free = shared(0), priced = shared(0.03), dear = shared(100);
  CHECK(bits(priced) < 0.5 * bits(free));
  CHECK(bits(dear) == 0);
  for (std::size_t i = 0; i < 12; ++i) {
    const auto texel = [&](const GaussianModel& of) { return of.atlas.texels[of.atlas.rects[i].offset]; };
    CHECK(glm::length(texel(priced) - texel(free)) < 0.2f);
  }
}

TEST_CASE("only squares of one size can be shared", "[textures]") {
  GaussianModel model = texturedModel(3, 2, 6);
  const std::vector<double> weights(model.size(), 1.0);
  model.atlas.rects[1] = {model.atlas.rects[1].offset, 2, 1};
  CHECK_THROWS_WITH(shareTextures(model, 2, weights, 0.0, 1), Contains("(found 2 x 2 and 2 x 1 texels)"));
  std::swap(model.atlas.rects[0], model.atlas.rects[1]);
  CHECK_THROWS_WITH(requireShareable(model.atlas), Contains("squares of one size (found 2 x 1 texels)"));
  std::swap(model.atlas.rects[0], model.atlas.rects[1]);
  model.atlas.rects[1] = {};
  CHECK_THROWS_WITH(shareTextures(model, 2, weights, 0.0, 1), Contains("(found some without)"));
  model.atlas = {};
  shareTextures(model, 2, weights, 0.0, 1);
  CHECK(model.atlas.rects.empty());
}

TEST_CASE("more textures than there are different ones change nothing, seen or not", "[textures]") {
  const GaussianModel before = texturedModel(20, 2, 6);
  for (const double weight : {1.0, 0.0}) {
    GaussianModel model = before;
    shareTextures(model, 1000, std::vector<double>(model.size(), weight), 0.0, 7);
    for (std::size_t t = 0; t < model.atlas.texels.size(); ++t) {
      CHECK(glm::length(model.atlas.texels[t] - before.atlas.texels[t]) < 1e-5f);
    }
  }
}
