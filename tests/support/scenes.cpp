// SPDX-License-Identifier: Apache-2.0
// The test scenes.
#include "support/scenes.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/quaternion.hpp>

#include "core/model/atlas.h"

namespace tg::test {
namespace {

constexpr std::array<std::string_view, 9> kNames = {"ordinary",     "needles", "flat",          "edge-on", "near plane",
                                                    "odd textures", "mixed",   "around camera", "stacked"};

Camera offCentreCamera(int width, int height) {
  Camera camera = lookAt({0.4, -0.3, -4.0}, {0.1, 0.05, 0.0}, {0.1, -1.0, 0.05}, 0.9, width, height);
  camera.focal.x *= 1.07;
  camera.center.x += 0.06 * width;
  camera.center.y -= 0.04 * height;
  return camera;
}

// World position of a point given by pixel and depth.
glm::dvec3 unproject(const Camera& camera, double x, double y, double z) {
  return glm::transpose(camera.rotation) * (z * ray(camera, {x, y}) - camera.translation);
}
glm::dvec3 randomPoint(Random& random, const Camera& camera, double near, double far) {
  const double x = random.uniform(-0.1, 1.1) * camera.size.x;
  const double y = random.uniform(-0.1, 1.1) * camera.size.y;
  return unproject(camera, x, y, random.uniform(near, far));
}

// A rotation that takes the z axis to `normal`, turned around it by a random angle; w, x, y, z.
glm::dvec4 quaternionFacing(Random& random, glm::dvec3 normal) {
  const glm::dvec3 helper = std::abs(normal.x) < 0.5 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 x = glm::normalize(glm::cross(helper, normal));
  const glm::dquat facing = glm::quat_cast(glm::dmat3(x, glm::cross(normal, x), normal));
  const double half = random.uniform(0.0, glm::pi<double>());
  const glm::dquat q = facing * glm::dquat(std::cos(half), 0.0, 0.0, std::sin(half));
  return {q.w, q.x, q.y, q.z};
}

void addTexture(GaussianModel& model, Random& random, int width, int height) {
  const auto offset = static_cast<std::uint32_t>(model.atlas.texels.size());
  const bool textured = width > 0 && height > 0;
  model.atlas.rects.push_back(
      {textured ? offset : 0u, static_cast<std::uint16_t>(width), static_cast<std::uint16_t>(height)});
  for (int i = 0; i < width * height; ++i) {
    const glm::vec3 rgb(random.uniformVec3(-0.4, 0.4));
    model.atlas.texels.push_back(glm::vec4(rgb, random.uniform()));
  }
}

// Appends a Gaussian with random colours; the texture follows by addTexture.
void addGaussian(GaussianModel& model, Random& random, glm::dvec3 mean, glm::dvec4 rotation, glm::dvec3 scale,
                 double opacity) {
  model.mean.push_back(glm::vec3(mean));
  model.rotation.push_back(glm::vec4(rotation * random.uniform(0.5, 2.0)));
  model.log_scale.push_back(glm::vec3(glm::log(scale)));
  model.opacity_logit.push_back(static_cast<float>(std::log(opacity / (1.0 - opacity))));
  for (std::size_t k = 0; k < model.shCount(); ++k) {
    const double size = k == 0 ? 1.5 : 0.25;
    model.sh.push_back(glm::vec3(random.uniformVec3(-size, size)));
  }
}

GaussianModel emptyModel() {
  GaussianModel model;
  model.sh_degree = 3;
  model.texture_mode = TextureMode::rgba;
  return model;
}

glm::dvec3 permuted(Random& random, glm::dvec3 scale) {
  const int first = std::min(2, static_cast<int>(random.uniform(0.0, 3.0)));
  return {scale[first], scale[(first + 1) % 3], scale[(first + 2) % 3]};
}

void addOfKind(GaussianModel& model, Random& random, const Camera& camera, SceneKind kind) {
  glm::dvec3 mean = randomPoint(random, camera, 2.0, 8.0);
  glm::dvec4 rotation = random.quaternion();
  glm::dvec3 scale = glm::exp(random.uniformVec3(std::log(0.03), std::log(0.4)));
  double opacity = random.uniform(0.02, 0.98);
  const double size = std::exp(random.uniform(std::log(0.05), std::log(0.6)));
  const double roundness = random.uniform(0.3, 1.0);       // of flat ones: second axis by first
  const double thinness = 1.0 / random.uniform(50, 1000);  // third axis by first
  int width = 4, height = 4;
  switch (kind) {
    case SceneKind::ordinary:
      break;
    case SceneKind::needles:
      scale = permuted(random, 4.0 * size * glm::dvec3(1.0, roundness / 20, 1.0 / random.uniform(20, 200)));
      break;
    case SceneKind::flat:
      scale = permuted(random, size * glm::dvec3(1.0, roundness, thinness));
      break;
    case SceneKind::edgeOn: {
      const glm::dvec3 to_camera = glm::normalize(camera.position() - mean);
      const glm::dvec3 side = glm::normalize(glm::cross(to_camera, random.direction()));
      const double tilt = glm::radians(random.uniform(-3.0, 3.0));
      rotation = quaternionFacing(random, std::cos(tilt) * side + std::sin(tilt) * to_camera);
      scale = 3.0 * size * glm::dvec3(1.0, roundness, thinness);
      break;
    }
    case SceneKind::nearPlane:
      mean = randomPoint(random, camera, 0.1, 0.7);
      scale *= 0.5;
      opacity *= 0.5;
      break;
    case SceneKind::oddTextures: {
      constexpr int kSizes[4][2] = {{1, 1}, {37, 5}, {1, 9}, {2, 2}};
      const auto& pick = kSizes[model.size() % 4];
      width = pick[0];
      height = pick[1];
      break;
    }
    case SceneKind::mixed:
      width = 1 + static_cast<int>(random.uniform(0.0, 8.0));
      height = 1 + static_cast<int>(random.uniform(0.0, 8.0));
      if (model.size() % 3 == 0) width = height = 0;
      break;
    case SceneKind::aroundCamera:
      if (model.size() % 8 == 0) {
        mean = randomPoint(random, camera, 0.3, 3.0);
        scale = random.uniformVec3(2.0, 12.0);
        opacity *= 0.3;
      }
      break;
    case SceneKind::stacked:
      opacity = 0.999;
      scale *= 3.0;
      break;
  }
  if (model.size() % 50 == 11) opacity = 0.003;  // below 1/255: never seen
  if (model.size() % 50 == 12) {
    mean = unproject(camera, 0.5 * camera.size.x, 0.5 * camera.size.y, -random.uniform(0, 2));
  }
  addGaussian(model, random, mean, rotation, scale, opacity);
  addTexture(model, random, width, height);
}

}  // namespace

double Random::uniform(double low, double high) {
  // splitmix64
  state_ += 0x9E3779B97F4A7C15ull;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
  z ^= z >> 31;
  return low + (high - low) * (static_cast<double>(z >> 11) * 0x1p-53);
}
double Random::normal() {
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
  return radius * std::cos(uniform(0.0, glm::two_pi<double>()));
}
glm::dvec3 Random::uniformVec3(double low, double high) {
  const double x = uniform(low, high);
  const double y = uniform(low, high);
  return {x, y, uniform(low, high)};
}
glm::dvec3 Random::direction() {
  const double z = uniform(-1.0, 1.0);
  const double angle = uniform(0.0, glm::two_pi<double>());
  const double r = std::sqrt(1.0 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}
glm::dvec4 Random::quaternion() {
  const double a = normal();
  const double b = normal();
  const double c = normal();
  return glm::normalize(glm::dvec4(a, b, c, normal()));
}

std::string_view name(SceneKind kind) { return kNames.at(static_cast<std::size_t>(kind)); }

TestScene makeScene(SceneKind kind, unsigned seed, int gaussians, int width, int height) {
  TestScene scene{emptyModel(), offCentreCamera(width, height)};
  Random random(seed * 16 + static_cast<unsigned>(kind));
  for (int i = 0; i < gaussians; ++i) addOfKind(scene.model, random, scene.camera, kind);
  return scene;
}

Tolerance tolerance(SceneKind kind, IntersectionModel intersection) {
  Tolerance result;
  const bool thin = kind == SceneKind::needles || kind == SceneKind::flat || kind == SceneKind::edgeOn;
  if (intersection == IntersectionModel::plane) result.outlier_share = 4e-3;
  if (thin) {
    result.outlier_share = 1e-2;
    result.loose = 1e-3;
    result.depth_factor = 10.0;
  }
  return result;
}

GaussianModel trainedLikeModel(unsigned seed, int gaussians) {
  GaussianModel model = emptyModel();
  Random random(seed);
  const double spacing = std::sqrt(27.0 / std::max(gaussians, 1));  // about 27 square units of surface
  for (int i = 0; i < gaussians; ++i) {
    glm::dvec3 mean, normal, color;
    if (i % 2 == 0) {  // floor, y = 1 (y points down)
      mean = {random.uniform(-2, 2), 1.0, random.uniform(-2, 2)};
      normal = {0, -1, 0};
      const bool dark = (static_cast<int>(std::floor(mean.x * 2)) + static_cast<int>(std::floor(mean.z * 2))) % 2 != 0;
      color = dark ? glm::dvec3(0.25, 0.2, 0.15) : glm::dvec3(0.8, 0.75, 0.6);
    } else if (i % 4 == 1) {  // box of side 1
      const int axis = std::min(2, static_cast<int>(random.uniform(0.0, 3.0)));
      const double sign = random.uniform() < 0.5 ? -1.0 : 1.0;
      mean = random.uniformVec3(-0.5, 0.5);
      mean[axis] = 0.5 * sign;
      mean += glm::dvec3(-0.8, 0.5, 0.2);
      normal = glm::dvec3(0.0);
      normal[axis] = sign;
      color = 0.5 + 0.3 * normal;
    } else {  // ball of radius 0.6
      normal = random.direction();
      mean = glm::dvec3(0.8, 0.4, -0.2) + 0.6 * normal;
      color = {0.2, 0.4 - 0.2 * normal.y, 0.8};
    }
    const glm::dvec3 jitter = 0.003 * random.direction();
    const glm::dvec4 rotation = quaternionFacing(random, normal);
    const double sigma = spacing * random.uniform(0.7, 1.3);
    const glm::dvec3 scale = sigma * glm::dvec3(1.0, random.uniform(0.4, 1.0), 0.02);
    addGaussian(model, random, mean + jitter, rotation, scale, random.uniform(0.6, 0.995));
    model.sh[model.sh.size() - model.shCount()] = glm::vec3((color - 0.5) / 0.28209479177387814);
    for (std::size_t k = 1; k < model.shCount(); ++k) model.sh[model.sh.size() - k] *= 0.2f;
    addTexture(model, random, 4, 4);
    for (std::size_t k = model.atlas.texels.size() - 16; k < model.atlas.texels.size(); ++k) {
      model.atlas.texels[k] *= glm::vec4(0.6f, 0.6f, 0.6f, 0.5f);
      model.atlas.texels[k].a += 0.5f;
    }
  }
  return model;
}

Camera trainedLikeCamera(int width, int height) {
  return lookAt({1.6, -1.4, -4.2}, {0.0, 0.4, 0.0}, {0.0, -1.0, 0.0}, 0.75, width, height);
}

TestScene grazingScene(double degrees, int width, int height) {
  TestScene scene{emptyModel(), {}};
  scene.camera.size = {width, height};
  scene.camera.focal.x = scene.camera.focal.y = 1.1 * height;
  scene.camera.center = {width / 2 + 0.5, height / 2 + 0.5};
  GaussianModel& model = scene.model;
  model.sh_degree = 0;
  const double half = glm::radians(degrees) / 2.0;
  model.mean = {glm::vec3(0.0f, 0.0f, 4.0f)};
  model.rotation = {glm::vec4(std::cos(half), 0.0, std::sin(half), 0.0)};
  model.log_scale = {glm::log(glm::vec3(0.6f, 0.45f, 0.03f))};
  model.opacity_logit = {3.0f};
  model.sh = {glm::vec3(0.4f, 0.2f, -0.4f)};
  model.atlas.rects = {{0, 4, 4}};
  for (int v = 0; v < 4; ++v) {
    for (int u = 0; u < 4; ++u) {
      const bool odd = (u + v) % 2 != 0;
      model.atlas.texels.push_back(odd ? glm::vec4(0.3f, -0.2f, 0.1f, 1.0f) : glm::vec4(-0.3f, 0.2f, 0.3f, 0.7f));
    }
  }
  return scene;
}

Image noise(int width, int height, unsigned seed, int channels) {
  Random random(seed);
  Image image(width, height, channels);
  for (float& value : image.data) value = static_cast<float>(random.uniform());
  return image;
}

namespace {

TestScene smallScene(float focal, float center) {
  TestScene scene{emptyModel(), {}};
  scene.model.sh_degree = 0;
  scene.camera.size = {32, 32};
  scene.camera.focal = glm::dvec2(focal);
  scene.camera.center = glm::dvec2(center);
  return scene;
}

void addUnturned(GaussianModel& model, glm::vec3 mean, glm::vec3 scale) {
  model.mean.push_back(mean);
  model.rotation.emplace_back(1, 0, 0, 0);
  model.log_scale.push_back(glm::log(scale));
  model.opacity_logit.push_back(1.0f);
  model.sh.emplace_back(0.3f, 0.2f, 0.1f);
}

}  // namespace

TestScene raysInPlaneScene(int side) {
  TestScene scene = smallScene(128.0f, 16.5f);
  GaussianModel& model = scene.model;
  model.intersection = IntersectionModel::plane;
  addUnturned(model, {0, 0, 2}, {0.3f, 0.3f, 0.01f});
  addUnturned(model, {0.03125f, 0, 4}, {0.0009765625f, 0.5f, 1.0f});  // x of pixel 17's centre
  addUnturned(model, {0, 0, 5}, {1.0f, 1.0f, 0.01f});
  if (side == 0) {
    model.texture_mode = TextureMode::none;
    return scene;
  }
  model.atlas = makeUniformAtlas(3, static_cast<std::uint16_t>(side), static_cast<std::uint16_t>(side));
  for (std::size_t i = 0; i < model.atlas.texels.size(); ++i) {
    model.atlas.texels[i] = {0.125f * static_cast<float>(i % 3), 0.0625f, -0.125f,
                             1.0f - static_cast<float>(i % 5) / 8};
  }
  return scene;
}

Tolerance raysInPlaneTolerance() {
  Tolerance result = tolerance(SceneKind::edgeOn, IntersectionModel::plane);
  result.outlier_share = 3.0 / 32;
  result.loose = 5e-3;
  return result;
}

TestScene thinDiscScene(float thinness, bool turned) {
  TestScene scene = smallScene(1000.0f, 16.0f);
  GaussianModel& model = scene.model;
  addUnturned(model, {0, 0, 100}, {0.5f, 0.4f, 0.5f * thinness});
  if (turned) model.rotation[0] = {0.9f, 0.2f, -0.3f, 0.1f};
  model.texture_mode = TextureMode::none;
  return scene;
}

TestScene opaqueDiscsScene() {
  TestScene scene = smallScene(50.0f, 16.0f);
  GaussianModel& model = scene.model;
  addUnturned(model, {0, 0, 3}, {1.0f, 1.0f, 0.1f});
  addUnturned(model, {0, 0, 4}, {1.0f, 1.0f, 0.1f});
  model.opacity_logit = {9.0f, 9.0f};
  model.sh = {{1.7f, -1.7f, -1.7f}, {-1.7f, 1.7f, -1.7f}};
  model.texture_mode = TextureMode::none;
  return scene;
}

TestScene vastScene() {
  TestScene scene;
  scene.model.mean = {{0.001f, 0.0005f, 0.01f}};
  scene.model.rotation = {{1.0f, 5e-14f, 0.0f, 0.0f}};
  scene.model.log_scale = {glm::vec3(std::log(1e18f), std::log(2.1e9f), 0.0f)};
  scene.model.opacity_logit = {3.0f};
  scene.model.sh = {{1.0f, 0.0f, -1.0f}};
  scene.camera.size = {16, 16};
  scene.camera.focal = {16, 16};
  scene.camera.center = {8, 8};
  return scene;
}

TestScene scaledScene(TestScene scene, float unit) {
  for (glm::vec3& mean : scene.model.mean) mean *= unit;
  for (glm::vec3& log_scale : scene.model.log_scale) log_scale += std::log(unit);
  scene.camera.translation *= unit;
  return scene;
}

}  // namespace tg::test
