// SPDX-License-Identifier: Apache-2.0
// Copies, selections and measures of models.
#include "core/model/verbs.h"

#include <cmath>
#include <string>

#include "core/system/error.h"
#include "core/tiny_model.h"
#include "support/catch.h"

TEST_CASE("every parameter of a Gaussian is visited with its name and its number of floats") {
  std::string names;
  tg::GaussianModel model = tg::tinyModel(3, 2);
  std::size_t floats = 0;
  tg::forEachField(
      [&](const tg::Field& field, const auto& values) {
        names += std::string(field.name) + " ";
        CHECK(sizeof(values[0]) == field.floats * sizeof(float));
        CHECK(values.size() == 3 * field.values(model.shCount()));
        floats += field.row(model.shCount());
      },
      model);
  CHECK(names == "mean rotation log_scale opacity_logit sh ");
  CHECK(floats == tg::gaussianFloats(9));
  CHECK(floats == 11 + 27);
}

TEST_CASE("some Gaussians of a model, in any order, keep their textures") {
  const tg::GaussianModel model = tg::tinyTexturedModel(9);
  const std::vector<std::uint32_t> source = {7, 0, 2, 7};
  const tg::GaussianModel part = tg::select(model, source);
  CHECK_NOTHROW(tg::checkModel(part, "part"));
  CHECK(part.texture_mode == model.texture_mode);
  CHECK(part.intersection == model.intersection);
  REQUIRE(part.size() == source.size());
  std::uint32_t offset = 0;
  for (std::size_t j = 0; j < source.size(); ++j) {
    const std::uint32_t i = source[j];
    CHECK(part.mean[j] == model.mean[i]);
    CHECK(part.sh[4 * j + 3] == model.sh[4 * i + 3]);
    const tg::TextureRect rect = tg::rectOf(part, j);
    CHECK(rect == tg::TextureRect{offset, model.atlas.rects[i].width, model.atlas.rects[i].height});
    for (std::uint32_t t = 0; t < rect.texelCount(); ++t) {
      CHECK(part.atlas.texels[offset + t] == model.atlas.texels[model.atlas.rects[i].offset + t]);
    }
    offset += rect.texelCount();
  }
  CHECK(part.atlas.texels.size() == offset);
}

TEST_CASE("two halves behind each other are the model, whichever of them has textures") {
  const tg::GaussianModel model = tg::tinyTexturedModel(6);
  const std::vector<std::uint32_t> first = {0, 1, 2}, last = {3, 4, 5};
  tg::GaussianModel whole = tg::select(model, first);
  tg::append(whole, tg::select(model, last));
  tg::GaussianModel expected = model;  // where there is no texture the offset says nothing
  for (std::size_t i = 0; i < 6; ++i) {
    if (tg::rectOf(model, i).texelCount() == 0) expected.atlas.rects[i] = whole.atlas.rects[i];
  }
  CHECK(whole == expected);

  tg::GaussianModel plain = tg::withoutTextures(tg::select(model, first));
  CHECK(plain.atlas.rects.empty());
  CHECK_FALSE(tg::isTextured(plain));
  tg::append(plain, tg::select(model, last));
  CHECK_NOTHROW(tg::checkModel(plain, "plain"));
  CHECK(tg::rectOf(plain, 0).texelCount() == 0);
  tg::GaussianModel textured = tg::select(model, first);
  tg::append(textured, tg::withoutTextures(tg::select(model, last)));
  CHECK_NOTHROW(tg::checkModel(textured, "textured"));
  CHECK(textured.atlas.texels == tg::select(model, first).atlas.texels);
}

TEST_CASE("an SH degree goes up with zeros and down with a cut") {
  const tg::GaussianModel model = tg::tinyModel(4, 1);
  tg::GaussianModel other = model;
  tg::setShDegree(other, 3);
  CHECK(other.shCount() == 16);
  REQUIRE(other.sh.size() == 4 * 16);
  CHECK(other.sh[16 + 3] == model.sh[4 + 3]);
  CHECK(other.sh[16 + 4] == glm::vec3(0.0f));
  tg::setShDegree(other, 1);
  CHECK(other == model);
  REQUIRE_THROWS_WITH(tg::setShDegree(other, 4), Contains("wrong SH degree (expected 0 to 3, found 4)"));
}

TEST_CASE("a thinned model has so many Gaussians at most, each as wide as those it stands for") {
  const tg::GaussianModel model = tg::tinyTexturedModel(100);
  const tg::GaussianModel part = tg::thinned(model, 50, 20);
  REQUIRE(part.size() == 16);
  CHECK(part.mean[5] == model.mean[15]);
  CHECK(part.log_scale[5].y == model.log_scale[15].y + 0.5f * std::log(100.0f / 16.0f));
  CHECK(part.intersection == model.intersection);
  CHECK(part.atlas.rects.empty());
  CHECK(tg::thinned(model, 0, 20).size() == 0);
}

TEST_CASE("a model's numbers are counted") {
  tg::GaussianModel model = tg::tinyTexturedModel(10);
  const std::size_t texels = model.atlas.texels.size();
  CHECK(tg::bytesOf(model) == 4 * (10 * 23 + 4 * texels));
  CHECK(tg::parameterCount(model) == 10 * 23 + 4 * texels);
  CHECK(tg::opacityOf(model, 3) == 1.0 / (1.0 + std::exp(-double{model.opacity_logit[3]})));
  CHECK(tg::sigmoid(-1.5, 255.0) == 255.0 / (1.0 + std::exp(1.5)));
  CHECK(tg::sigmaOf(model, 3).y == std::exp(double{model.log_scale[3].y}));
  model.texture_mode = tg::TextureMode::alpha;  // what training fits: one number a texel
  CHECK(tg::parameterCount(model) == 10 * 23 + texels);
  tg::setShDegree(model, 3);
  CHECK(tg::parameterCount(model) == 10 * 59 + texels);
  // Ten Gaussians that share one texture have its numbers once.
  model.atlas = tg::makeUniformAtlas(10, 3, 2);
  CHECK(tg::parameterCount(model) == 10 * 59 + 6);
}
