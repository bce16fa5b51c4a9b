// SPDX-License-Identifier: Apache-2.0
// The rules of blending, one by one, on scenes of a few face-on Gaussians. Every renderer obeys them; the reference is
// where they can be read off.
#include <cmath>

#include "render/reference/reference.h"
#include "support/catch.h"

using namespace tg;

namespace {

double logit(double opacity) { return std::log(opacity / (1.0 - opacity)); }

// One pixel whose ray is the camera's axis.
Camera onePixel() {
  Camera camera;
  camera.size.x = camera.size.y = 1;
  camera.focal.x = camera.focal.y = 10;
  camera.center.x = camera.center.y = 0.5;
  return camera;
}

ReferenceModel emptyModel() {
  ReferenceModel model;
  model.texture_mode = TextureMode::rgba;
  return model;
}

// A large disc across the axis at depth z, of constant colour; its 1 x 1 texture adds `texel`.
void addDisc(ReferenceModel& model, double z, double opacity, glm::dvec3 color, glm::dvec4 texel = {0, 0, 0, 1}) {
  model.mean.push_back({0, 0, z});
  model.rotation.push_back({1, 0, 0, 0});
  model.log_scale.push_back(glm::log(glm::dvec3(1, 1, 0.01)));
  model.opacity_logit.push_back(logit(opacity));
  model.sh.push_back((color - 0.5) / 0.28209479177387814);
  model.rects.push_back({static_cast<std::uint32_t>(model.texels.size()), 1, 1});
  model.texels.push_back(texel);
}

std::vector<std::uint32_t> order(const ReferenceModel& model) {
  std::vector<std::uint32_t> result;
  for (const ReferenceHit& hit : traceReference(model, onePixel(), {}, 0.5, 0.5)) result.push_back(hit.gaussian);
  return result;
}

FrameT<double> render(const ReferenceModel& model, TextureMode textures = TextureMode::rgba,
                      glm::vec3 background = glm::vec3(0.0f)) {
  RenderSettings settings;
  settings.textures = textures;
  settings.background = background;
  return renderReference(model, onePixel(), settings);
}

bool near(glm::dvec3 a, glm::dvec3 b) { return glm::length(a - b) < 1e-12; }

}  // namespace

TEST_CASE("splats blend by the depth of their means, the lower index first on ties") {
  ReferenceModel model = emptyModel();
  for (double z : {5.0, 3.0, 5.0, 4.0, 3.0}) addDisc(model, z, 0.1, glm::dvec3(0.5));
  CHECK(order(model) == std::vector<std::uint32_t>{1, 4, 3, 0, 2});
}

TEST_CASE("depths that are equal as float are ties") {
  ReferenceModel model = emptyModel();
  addDisc(model, 5.0 + 1e-9, 0.1, glm::dvec3(0.5));
  addDisc(model, 5.0, 0.1, glm::dvec3(0.5));
  CHECK(order(model) == std::vector<std::uint32_t>{0, 1});
}

TEST_CASE("a mean at or before the near plane is not drawn") {
  ReferenceModel model = emptyModel();
  for (double z : {-1.0, 0.1, 0.2, 0.21}) addDisc(model, z, 0.5, glm::dvec3(0.5));
  CHECK(order(model) == std::vector<std::uint32_t>{3});
}

TEST_CASE("a hit before the near plane is skipped though its mean is behind it") {
  ReferenceModel model = emptyModel();
  model.intersection = IntersectionModel::plane;
  addDisc(model, 0.3, 0.5, glm::dvec3(0.5));
  model.mean[0].x = 0.5;
  // Tilted by 45 degrees, the plane cuts the axis at 0.3 - 0.5 or at 0.3 + 0.5, by the sign of the turn.
  const double half = std::acos(-1.0) / 8;
  model.rotation[0] = {std::cos(half), 0, std::sin(half), 0};
  const std::size_t one_way = order(model).size();
  model.rotation[0] = {std::cos(half), 0, -std::sin(half), 0};
  CHECK(one_way + order(model).size() == 1);
}

TEST_CASE("alpha is cut after the texture's factor") {
  ReferenceModel model = emptyModel();
  addDisc(model, 3.0, 0.5, glm::dvec3(0.5), {0, 0, 0, 2.0 / 255 + 1e-6});
  CHECK(order(model).size() == 1);
  model.texels[0].a = 2.0 / 255 - 1e-6;
  CHECK(order(model).empty());
  CHECK(render(model, TextureMode::rgb).count[0] == 1.0);
}

TEST_CASE("a Gaussian of opacity 1/255 or less is never drawn") {
  ReferenceModel model = emptyModel();
  addDisc(model, 3.0, 1.0 / 255 - 1e-9, glm::dvec3(0.5));
  addDisc(model, 4.0, 1.0 / 255 + 1e-9, glm::dvec3(0.5));
  CHECK(order(model) == std::vector<std::uint32_t>{1});
}

TEST_CASE("a ray ends before the splat that would take its transmittance below 1e-4") {
  ReferenceModel model = emptyModel();
  addDisc(model, 2.0, 0.98, glm::dvec3(1, 0, 0));
  addDisc(model, 3.0, 0.99, glm::dvec3(0, 1, 0));  // leaves 2e-4
  addDisc(model, 4.0, 0.6, glm::dvec3(0, 0, 1));   // would leave 0.8e-4
  addDisc(model, 5.0, 0.01, glm::dvec3(1, 1, 1));  // behind the end, though it would leave enough
  CHECK(order(model) == std::vector<std::uint32_t>{0, 1});
  CHECK(render(model).alpha[0] == Approx(1.0 - 2e-4).epsilon(1e-12));
}

TEST_CASE("a ray ends before the second of two opaque splats") {
  ReferenceModel model = emptyModel();
  addDisc(model, 2.0, 0.9999, glm::dvec3(1, 0, 0));
  addDisc(model, 3.0, 0.9999, glm::dvec3(0, 1, 0));
  addDisc(model, 4.0, 0.01, glm::dvec3(0, 0, 1));
  CHECK(order(model) == std::vector<std::uint32_t>{0});
  CHECK(render(model).count[0] == 1.0);
  CHECK(render(model).alpha[0] == Approx(0.99));
}

TEST_CASE("base and texture add up, and a mode without a term leaves it out") {
  ReferenceModel model = emptyModel();
  const glm::dvec3 color(0.2, 0.4, 0.6), texel(0.3, -0.1, 0.2);
  addDisc(model, 3.0, 0.5, color, glm::dvec4(texel, 0.5));
  const glm::vec3 white(1.0f);
  const auto rgba = render(model, TextureMode::rgba, white);
  CHECK(near(rgba.base[0], 0.25 * color + 0.75));
  CHECK(near(rgba.texture[0], 0.25 * texel));
  CHECK(rgba.color(0) == rgba.base[0] + rgba.texture[0]);
  CHECK(rgba.alpha[0] == Approx(0.25));
  CHECK(rgba.depth[0] == Approx(3.0));
  CHECK(near(rgba.normal[0], {0, 0, -0.25}));
  const auto rgb = render(model, TextureMode::rgb, white);
  CHECK(near(rgb.base[0], 0.5 * color + 0.5));
  CHECK(near(rgb.texture[0], 0.5 * texel));
  const auto alpha = render(model, TextureMode::alpha, white);
  CHECK(near(alpha.base[0], rgba.base[0]));
  CHECK(alpha.texture[0] == glm::dvec3(0.0));
  const auto none = render(model, TextureMode::none, white);
  CHECK(near(none.color(0), 0.5 * color + 0.5));
  // The model's own mode limits what settings can switch on.
  model.texture_mode = TextureMode::alpha;
  CHECK(render(model, TextureMode::rgba, white).texture[0] == glm::dvec3(0.0));
}

TEST_CASE("a Gaussian without a texture shows its base colour in every mode") {
  ReferenceModel model = emptyModel();
  addDisc(model, 3.0, 0.5, glm::dvec3(0.2, 0.4, 0.6));
  model.rects[0] = {};
  model.texels.clear();
  CHECK(near(render(model).color(0), {0.1, 0.2, 0.3}));
  model.rects.clear();
  CHECK(near(render(model).color(0), {0.1, 0.2, 0.3}));
}

TEST_CASE("a base colour below zero is cut to zero, and its spherical harmonics get no gradient") {
  ReferenceModel model = emptyModel();
  addDisc(model, 3.0, 0.5, glm::dvec3(-0.2, 0.4, 0.6));
  CHECK(near(render(model).color(0), {0.0, 0.2, 0.3}));
  const glm::dvec3 v_color(1.0);
  const auto gradient = backwardReference(model, onePixel(), {}, {&v_color, 1});
  CHECK(gradient.sh[0].r == 0.0);
  CHECK(gradient.sh[0].g > 0.0);
}

TEST_CASE("an empty model shows the background") {
  const auto frame = render(ReferenceModel(), TextureMode::rgba, {0.1f, 0.2f, 0.3f});
  CHECK(near(frame.color(0), glm::dvec3(glm::vec3(0.1f, 0.2f, 0.3f))));
  CHECK(frame.alpha[0] == 0.0);
  CHECK(frame.depth[0] == 0.0);
  CHECK(frame.count[0] == 0.0);
}

TEST_CASE("a frame does not depend on where the world's origin is") {
  ReferenceModel model = emptyModel();
  addDisc(model, 3.0, 0.5, glm::dvec3(0.2, 0.4, 0.6), {0.1, 0.2, 0.3, 0.7});
  addDisc(model, 4.0, 0.7, glm::dvec3(0.9, 0.1, 0.5));
  Camera camera = onePixel();
  const auto before = renderReference(model, camera, {});
  // World points x become turn x + shift; the camera moves along.
  const glm::dmat3 turn(glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1), glm::dvec3(1, 0, 0));
  const glm::dvec3 shift(10, -20, 30);
  for (glm::dvec3& mean : model.mean) mean = turn * mean + shift;
  for (glm::dvec4& rotation : model.rotation) rotation = {0.5, 0.5, 0.5, 0.5};  // turn as a quaternion
  camera.rotation = glm::transpose(turn);
  camera.translation = -(glm::transpose(turn) * shift);
  const auto after = renderReference(model, camera, {});
  CHECK(near(before.color(0), after.color(0)));
  CHECK(near(before.normal[0], after.normal[0]));
  CHECK(after.depth[0] == Approx(before.depth[0]).epsilon(1e-12));
}
