// SPDX-License-Identifier: Apache-2.0
// A small ray caster. Surfaces carry patterns with detail finer than a Gaussian: that is what textures are for.
#include "training/data/sample.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "core/file/file.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "training/data/write_dataset.h"

namespace tg {
namespace fs = std::filesystem;

namespace {

using glm::dvec2;
using glm::dvec3;

constexpr double kPi = std::numbers::pi;
constexpr double kFieldOfView = 0.62;  // [rad]
constexpr double kOrbitRadius = 4.5;
const dvec3 kTarget(0.0, 0.05, -0.12);
const dvec3 kLight = glm::normalize(dvec3(-0.45, -0.7, 1.0));
constexpr double kLightRadius = 0.08;  // of the light's disc at distance 1: soft shadow edges
constexpr double kAmbient = 0.6;

// Colour at (u, v), lengths from the surface's corner.
using Pattern = dvec3 (*)(double u, double v);

// 5 x 7 capitals, one row a byte, the leftmost dot in bit 4.
constexpr std::array<std::array<std::uint8_t, 7>, 26> kFont = {{
    {0x0e, 0x11, 0x11, 0x1f, 0x11, 0x11, 0x11}, {0x1e, 0x11, 0x11, 0x1e, 0x11, 0x11, 0x1e},
    {0x0e, 0x11, 0x10, 0x10, 0x10, 0x11, 0x0e}, {0x1e, 0x11, 0x11, 0x11, 0x11, 0x11, 0x1e},
    {0x1f, 0x10, 0x10, 0x1e, 0x10, 0x10, 0x1f}, {0x1f, 0x10, 0x10, 0x1e, 0x10, 0x10, 0x10},
    {0x0e, 0x11, 0x10, 0x17, 0x11, 0x11, 0x0f}, {0x11, 0x11, 0x11, 0x1f, 0x11, 0x11, 0x11},
    {0x0e, 0x04, 0x04, 0x04, 0x04, 0x04, 0x0e}, {0x07, 0x02, 0x02, 0x02, 0x02, 0x12, 0x0c},
    {0x11, 0x12, 0x14, 0x18, 0x14, 0x12, 0x11}, {0x10, 0x10, 0x10, 0x10, 0x10, 0x10, 0x1f},
    {0x11, 0x1b, 0x15, 0x15, 0x11, 0x11, 0x11}, {0x11, 0x11, 0x19, 0x15, 0x13, 0x11, 0x11},
    {0x0e, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0e}, {0x1e, 0x11, 0x11, 0x1e, 0x10, 0x10, 0x10},
    {0x0e, 0x11, 0x11, 0x11, 0x15, 0x12, 0x0d}, {0x1e, 0x11, 0x11, 0x1e, 0x14, 0x12, 0x11},
    {0x0f, 0x10, 0x10, 0x0e, 0x01, 0x01, 0x1e}, {0x1f, 0x04, 0x04, 0x04, 0x04, 0x04, 0x04},
    {0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0e}, {0x11, 0x11, 0x11, 0x11, 0x11, 0x0a, 0x04},
    {0x11, 0x11, 0x11, 0x15, 0x15, 0x1b, 0x11}, {0x11, 0x11, 0x0a, 0x04, 0x0a, 0x11, 0x11},
    {0x11, 0x11, 0x0a, 0x04, 0x04, 0x04, 0x04}, {0x1f, 0x01, 0x02, 0x04, 0x08, 0x10, 0x1f},
}};

// Whether `text`, set in cells of 6 x 8 dots from (0, 0) to the right, has ink at (x, y) [dots], y down.
bool inked(std::string_view text, double x, double y) {
  if (x < 0 || y < 0 || y >= 7) return false;
  const auto column = static_cast<std::size_t>(x);
  if (column / 6 >= text.size() || column % 6 == 5) return false;
  const char letter = text[column / 6];
  if (letter < 'A' || letter > 'Z') return false;
  return (kFont[letter - 'A'][static_cast<std::size_t>(y)] >> (4 - column % 6)) & 1;
}

bool odd(double x) { return static_cast<long>(std::floor(x)) & 1; }
double fraction(double x) { return x - std::floor(x); }

const dvec3 kPaper(0.95, 0.93, 0.87);
const dvec3 kInk(0.09, 0.10, 0.14);
const dvec3 kRed(0.80, 0.16, 0.13);
const dvec3 kBlue(0.10, 0.27, 0.58);
const dvec3 kTeal(0.06, 0.47, 0.46);
const dvec3 kGold(0.95, 0.69, 0.16);
const dvec3 kSage(0.62, 0.70, 0.55);

constexpr double kBoardSide = 2.2;
dvec3 boardPattern(double u, double v) {
  const double border = std::min({u, v, kBoardSide - u, kBoardSide - v});
  if (border < 0.05) return kTeal * 0.6;
  if (border < 0.07) return kPaper;
  const double cell = (kBoardSide - 0.14) / 16;
  const double x = (u - 0.07) / cell;
  const double y = (v - 0.07) / cell;
  if (odd(x) == odd(y)) return kPaper;
  // Every dark cell carries a small diamond.
  const double diamond = std::abs(fraction(x) - 0.5) + std::abs(fraction(y) - 0.5);
  return diamond < 0.22 ? kGold : kTeal;
}

constexpr double kPosterWidth = 1.9;
constexpr double kPosterHeight = 1.15;
dvec3 posterPattern(double u, double v) {
  const double y = kPosterHeight - v;  // down from the top edge
  if (std::min({u, v, kPosterWidth - u, y}) < 0.03) return kBlue;
  if (y < 0.33) {
    const double dot = (kPosterWidth - 0.2) / (8 * 6 - 1);
    if (inked("TEXTURED", (u - 0.1) / dot, (y - 0.07) / dot)) return kRed;
    return kPaper;
  }
  if (y < 0.58) {
    const double dot = (kPosterWidth - 0.2) / (9 * 6 - 1);
    if (inked("GAUSSIANS", (u - 0.1) / dot, (y - 0.33) / dot)) return kInk;
    return kPaper;
  }
  if (u < 0.62) {  // stripes whose period shrinks to the right
    const double x = (u - 0.03) / 0.59;
    return odd(4 * x + 9 * x * x) ? kInk : kPaper;
  }
  if (u < 1.24) {  // small print
    constexpr std::array<std::string_view, 5> kLines = {"EVERY SPLAT", "CARRIES ITS", "OWN PICTURE", "OF ALPHA AND",
                                                        "COLOUR"};
    const double dot = 0.0083;
    const double line = (y - 0.62) / (dot * 11);
    if (line < 0 || line >= static_cast<double>(kLines.size())) return kPaper;
    return inked(kLines[static_cast<std::size_t>(line)], (u - 0.65) / dot, fraction(line) * 11) ? kInk : kPaper;
  }
  // Colour patches, each ruled with thin lines.
  const double x = (u - 1.24) / 0.63 * 5;
  const double row = (y - 0.58) / 0.54 * 4;
  if (fraction(x) < 0.1 || fraction(row) < 0.12) return kPaper;
  const std::array<dvec3, 6> colors = {kRed, kBlue, kGold, kTeal, kSage, kInk};
  const auto patch = static_cast<std::size_t>(std::floor(x) + 5 * std::floor(row));
  const dvec3 color = colors[(patch * 5 + patch / 7) % colors.size()];
  return odd(fraction(x) * 6) ? color : glm::mix(color, kPaper, 0.35);
}

dvec3 posterBackPattern(double u, double v) {
  if (std::min({u, v, kPosterWidth - u, kPosterHeight - v}) < 0.03) return kBlue;
  if (odd((u + v) / 0.07)) return kSage;
  return odd((u - v) / 0.035) ? kPaper : glm::mix(kSage, kPaper, 0.6);
}

constexpr double kSignWidth = 0.85;
constexpr double kSignHeight = 0.7;
dvec3 signPattern(double u, double v) {
  const dvec2 p(u - kSignWidth / 2, v - kSignHeight / 2);
  if (std::min({u, v, kSignWidth - u, kSignHeight - v}) < 0.025) return kInk;
  const double radius = glm::length(p);
  if (radius < 0.3) return odd(radius / 0.033) ? kPaper : kRed;
  const double angle = std::atan2(p.y, p.x) / (2 * kPi) * 48;
  return odd(angle) ? kGold : kPaper;
}

constexpr double kBoxSide = 0.52;
// Each face in its own print; (u, v) in [0, kBoxSide]^2.
dvec3 letterFace(double u, double v) {
  const double dot = kBoxSide / 29;
  const double x = u / dot - 3;
  const double y = (kBoxSide - v) / dot - 4;
  if (std::min({u, v, kBoxSide - u, kBoxSide - v}) < 0.02) return kGold;
  if (y < 0 || y >= 24) return kBlue;
  constexpr std::array<std::string_view, 3> kLines = {"PLAY", "WITH", "RAYS"};
  const auto line = static_cast<std::size_t>(y / 8);
  return inked(kLines[line], x, y - 8.0 * static_cast<double>(line)) ? kPaper : kBlue;
}
dvec3 barcodeFace(double u, double v) {
  if (std::min({u, v, kBoxSide - u, kBoxSide - v}) < 0.05) return kPaper;
  if (v < 0.13) return odd(u / 0.02) && odd(v / 0.02) ? kInk : kPaper;
  const auto bar = static_cast<unsigned>(u / 0.0095);
  return ((bar * 2654435761u) >> 29) & 1 ? kInk : kPaper;
}
dvec3 tileFace(double u, double v) {
  const dvec2 p(fraction(u / 0.13) - 0.5, fraction(v / 0.13) - 0.5);
  if (std::max(std::abs(p.x), std::abs(p.y)) > 0.45) return kPaper;
  const double radius = glm::length(p);
  if (radius < 0.16) return kGold;
  return radius < 0.36 ? kTeal : kRed;
}
dvec3 crossFace(double u, double v) {
  const double x = std::abs(fraction(u / 0.0867) - 0.5);
  const double y = std::abs(fraction(v / 0.0867) - 0.5);
  return std::abs(x - y) < 0.13 ? kPaper : (odd(u / 0.0867) == odd(v / 0.0867) ? kRed : kRed * 0.65);
}
dvec3 lidFace(double u, double v) {
  const dvec2 p(u - kBoxSide / 2, v - kBoxSide / 2);
  const double radius = glm::length(p);
  if (radius > 0.24) return odd(u / 0.04) == odd(v / 0.04) ? kInk : kPaper;
  return odd(std::atan2(p.y, p.x) / (2 * kPi) * 20 + radius / 0.06) ? kGold : kBlue;
}

// (u, v): longitude and latitude in [0, 1].
dvec3 spherePattern(double u, double v) {
  const double longitude = u * 24;
  const double latitude = v * 12;
  if (std::abs(v - 0.5) < 0.055) {
    const double dot = 1.0 / 120;
    return inked("ROUND AND ROUND AND ", u / dot, 7 - (v - 0.455) / (0.09 / 7)) ? kPaper : kRed;
  }
  if (fraction(latitude) < 0.09) return kInk;
  const double stretch = std::sin(v * kPi);  // meridians close in at the poles
  if (stretch > 0.3 && fraction(longitude) < 0.07 / stretch) return kInk;
  const bool flip = odd(longitude) == odd(latitude);
  const dvec2 p((fraction(longitude) - 0.53) * stretch, fraction(latitude) - 0.54);
  if (glm::length(p) < 0.2) return flip ? kBlue : kGold;
  return flip ? kPaper : kSage;
}

// A rectangle from `corner` along the unit vectors u and v; its front faces cross(u, v).
struct Panel {
  dvec3 corner, u, v;
  double width, height;
  Pattern front, back;
};
struct Ball {
  dvec3 center;
  double radius;
  Pattern pattern;
};
struct Scene {
  std::vector<Panel> panels;
  Ball ball;
};
struct SurfaceHit {
  double t;
  dvec3 position, normal, color;
};

Scene makeScene() {
  Scene scene;
  const double floor = -0.6;
  scene.panels.push_back({{-kBoardSide / 2, -kBoardSide / 2, floor},
                          {1, 0, 0},
                          {0, 1, 0},
                          kBoardSide,
                          kBoardSide,
                          boardPattern,
                          boardPattern});
  scene.panels.push_back({{-kPosterWidth / 2 + 0.1, 0.85, floor},
                          {1, 0, 0},
                          {0, 0, 1},
                          kPosterWidth,
                          kPosterHeight,
                          posterPattern,
                          posterBackPattern});
  const dvec3 along = glm::normalize(dvec3(-0.35, 1.0, 0.0));
  scene.panels.push_back(
      {dvec3(-0.72, -0.25, floor) - 0.1 * along, along, {0, 0, 1}, kSignWidth, kSignHeight, signPattern, signPattern});
  const double turn = 0.45;
  const dvec3 x(std::cos(turn), std::sin(turn), 0);
  const dvec3 y(-std::sin(turn), std::cos(turn), 0);
  const dvec3 z(0, 0, 1);
  const dvec3 c = dvec3(0.52, 0.0, floor) - 0.5 * kBoxSide * (x + y);  // lower corner of the box
  const double s = kBoxSide;
  scene.panels.push_back({c, x, z, s, s, letterFace, letterFace});
  scene.panels.push_back({c + s * x, y, z, s, s, barcodeFace, barcodeFace});
  scene.panels.push_back({c + s * (x + y), -x, z, s, s, tileFace, tileFace});
  scene.panels.push_back({c + s * y, -y, z, s, s, crossFace, crossFace});
  scene.panels.push_back({c + s * z, x, y, s, s, lidFace, lidFace});
  scene.ball = {{-0.22, -0.42, floor + 0.36}, 0.36, spherePattern};
  return scene;
}

// A grid of scenes on one ground: each by quarter turns about the vertical, its colour channels in a turned order.
constexpr double kCellSide = 2.6;
constexpr double kCellReach = 1.8;  // from a cell's middle, everything in it
struct SampleCell {
  dvec3 middle;
  int turns;

  // Into the cell's own frame.
  dvec3 turned(dvec3 v) const {
    for (int i = 0; i < turns; ++i) v = {v.y, -v.x, v.z};
    return v;
  }
  dvec3 turnedBack(dvec3 v) const {
    for (int i = 0; i < turns; ++i) v = {-v.y, v.x, v.z};
    return v;
  }
  dvec3 color(const dvec3& c) const {
    return turns % 3 == 0 ? c : turns == 1 ? dvec3(c.g, c.b, c.r) : dvec3(c.b, c.r, c.g);
  }
};
SampleCell cellOf(const SampleOptions& options, int index) {
  const int column = index % options.grid, row = index / options.grid % options.grid;
  const double half = (options.grid - 1) / 2.0;
  return {kCellSide * dvec3(column - half, row - half, 0.0), (column + 3 * row) % 4};
}
struct World {
  Scene scene;
  std::vector<SampleCell> cells;
};
World makeWorld(const SampleOptions& options) {
  World world{makeScene(), {}};
  for (int i = 0; i < options.grid * options.grid; ++i) world.cells.push_back(cellOf(options, i));
  return world;
}

dvec3 ballColor(const Ball& ball, dvec3 normal) {
  const double u = std::atan2(normal.y, normal.x) / (2 * kPi) + 0.5;
  return ball.pattern(u, std::acos(std::clamp(-normal.z, -1.0, 1.0)) / kPi);
}

std::optional<SurfaceHit> intersect(const Scene& scene, dvec3 origin, dvec3 direction) {
  std::optional<SurfaceHit> nearest;
  constexpr double kMinT = 1e-6;
  for (const Panel& panel : scene.panels) {
    const dvec3 normal = glm::cross(panel.u, panel.v);
    const double facing = glm::dot(normal, direction);
    if (facing == 0) continue;
    const double t = glm::dot(panel.corner - origin, normal) / facing;
    if (t < kMinT || (nearest && t >= nearest->t)) continue;
    const dvec3 position = origin + t * direction;
    const double u = glm::dot(position - panel.corner, panel.u);
    const double v = glm::dot(position - panel.corner, panel.v);
    if (u < 0 || v < 0 || u > panel.width || v > panel.height) continue;
    const bool front = facing < 0;
    nearest = SurfaceHit{t, position, front ? normal : -normal, (front ? panel.front : panel.back)(u, v)};
  }
  const dvec3 offset = origin - scene.ball.center;
  const double a = glm::dot(direction, direction);
  const double b = glm::dot(offset, direction);
  const double discriminant = b * b - a * (glm::dot(offset, offset) - scene.ball.radius * scene.ball.radius);
  if (discriminant > 0) {
    const double t = (-b - std::sqrt(discriminant)) / a;  // from outside only
    if (t > kMinT && (!nearest || t < nearest->t)) {
      const dvec3 position = origin + t * direction;
      const dvec3 normal = (position - scene.ball.center) / scene.ball.radius;
      nearest = SurfaceHit{t, position, normal, ballColor(scene.ball, normal)};
    }
  }
  return nearest;
}

std::optional<SurfaceHit> intersect(const World& world, dvec3 origin, dvec3 direction) {
  std::optional<SurfaceHit> nearest;
  for (const SampleCell& cell : world.cells) {
    const dvec3 to_middle = cell.middle - origin;
    const double along = glm::dot(to_middle, direction), square = glm::dot(direction, direction);
    const double beside = glm::dot(to_middle, to_middle) - along * along / square;
    if (beside > kCellReach * kCellReach) continue;
    std::optional<SurfaceHit> hit = intersect(world.scene, cell.turned(-to_middle), cell.turned(direction));
    if (!hit || (nearest && hit->t >= nearest->t)) continue;
    hit->position = cell.middle + cell.turnedBack(hit->position);
    hit->normal = cell.turnedBack(hit->normal);
    hit->color = cell.color(hit->color);
    nearest = hit;
  }
  return nearest;
}

// Diffuse, lit by a disc of which (x, y) in [-1, 1]^2 is one point.
dvec3 shade(const World& world, const SurfaceHit& hit, double x, double y) {
  const dvec3 side = glm::normalize(glm::cross(kLight, dvec3(0, 0, 1)));
  const dvec3 light = glm::normalize(kLight + kLightRadius * (x * side + y * glm::cross(side, kLight)));
  const double cosine = glm::dot(hit.normal, light);
  const bool lit = cosine > 0 && !intersect(world, hit.position + 1e-5 * hit.normal, light);
  return hit.color * (kAmbient + (lit ? (1 - kAmbient) * cosine / kLight.z : 0.0));
}

void checkOptions(const SampleOptions& options) {
  const auto check = [](const char* what, int value, int low, int high) {
    if (value < low || value > high) {
      throw Error(ErrorKind::usage, std::string(what) + " out of range (expected " + std::to_string(low) + " to " +
                                        std::to_string(high) + ", found " + std::to_string(value) + ")");
    }
  };
  check("image size", options.size, 8, 4096);
  check("number of training views", options.train_views, 1, 10000);
  check("number of test views", options.test_views, 0, 10000);
  check("number of points", options.points, 1, 10'000'000);
  check("supersampling", options.supersampling, 1, 16);
  check("grid", options.grid, 1, 32);
}

}  // namespace

Camera sampleCamera(const SampleOptions& options, bool test, int index) {
  // Training views spiral by the golden angle so that any prefix covers the orbit; test views lie on one ring between.
  const double golden = kPi * (3 - std::sqrt(5.0));
  // The cells of a grid take turns.
  const int cells = options.grid * options.grid, place = index / cells;
  const int count = ((test ? options.test_views : options.train_views) + cells - 1) / cells;
  const double azimuth = test ? 2 * kPi * (place + 0.5) / count - kPi / 2 : golden * place - kPi / 2;
  const double height =
      test ? 0.42 : 0.12 + 0.66 * fraction(place * 0.7548776662466927 + 0.3);  // sine of the elevation
  const double ring = std::sqrt(1 - height * height);
  const dvec3 target = kTarget + cellOf(options, index % cells).middle;
  const dvec3 eye = target + kOrbitRadius * dvec3(ring * std::cos(azimuth), ring * std::sin(azimuth), height);
  Camera camera = lookAt(eye, target, dvec3(0, 0, 1), kFieldOfView, options.size, options.size);
  camera.name = "r_" + std::to_string(index) + ".png";
  camera.test = test;
  return camera;
}

Image renderSample(const SampleOptions& options, const Camera& camera) {
  checkOptions(options);
  const World world = makeWorld(options);
  const int grid = options.supersampling;
  const glm::dmat3 world_from_camera = glm::transpose(camera.rotation);
  const dvec3 origin = camera.position();
  Image image(camera.size.x, camera.size.y, 4);
  parallelFor(camera.size.y, 1, [&](int y) {
    for (int x = 0; x < camera.size.x; ++x) {
      dvec3 sum(0.0);
      int hits = 0;
      for (int s = 0; s < grid * grid; ++s) {
        const glm::dvec2 pixel(x + (s % grid + 0.5) / grid, y + (s / grid + 0.5) / grid);
        const dvec3 direction = world_from_camera * ray(camera, pixel);
        const std::optional<SurfaceHit> hit = intersect(world, origin, direction);
        if (!hit) continue;
        // The light's disc is sampled along its own grid, turned against the pixel's so that they do not correlate.
        const int l = (s * 7 + x * 3 + y * 5) % (grid * grid);
        sum += shade(world, *hit, (l % grid + 0.5) / grid * 2 - 1, (l / grid + 0.5) / grid * 2 - 1);
        ++hits;
      }
      for (int c = 0; c < 3; ++c) image.at(x, y, c) = hits ? static_cast<float>(sum[c] / hits) : 0.0f;
      image.at(x, y, 3) = static_cast<float>(hits) / static_cast<float>(grid * grid);
    }
  });
  return image;
}

PointCloud samplePoints(const SampleOptions& options) {
  checkOptions(options);
  const World world = makeWorld(options);
  const Scene& scene = world.scene;
  const double ball_area = 4 * kPi * scene.ball.radius * scene.ball.radius;
  double area = ball_area;
  for (const Panel& panel : scene.panels) area += panel.width * panel.height;

  PointCloud points;
  const double each = static_cast<double>(options.points) / static_cast<double>(world.cells.size());
  const SampleCell* cell = nullptr;
  const auto add = [&](const dvec3& position, const dvec3& normal, const dvec3& color) {
    constexpr int kLightGrid = 4;
    const SurfaceHit hit{0, cell->middle + cell->turnedBack(position), cell->turnedBack(normal), cell->color(color)};
    dvec3 sum(0.0);
    for (int i = 0; i < kLightGrid * kLightGrid; ++i) {
      sum +=
          shade(world, hit, (i % kLightGrid + 0.5) / kLightGrid * 2 - 1, (i / kLightGrid + 0.5) / kLightGrid * 2 - 1);
    }
    points.position.emplace_back(hit.position);
    points.color.emplace_back(sum / static_cast<double>(kLightGrid * kLightGrid));
  };
  // Roberts' R2 sequence: even cover at any count.
  const auto sequence = [](int i) {
    return dvec2(fraction(0.5 + 0.7548776662466927 * i), fraction(0.5 + 0.5698402909980532 * i));
  };
  for (const SampleCell& at : world.cells) {
    cell = &at;
    for (const Panel& panel : scene.panels) {
      const int count = static_cast<int>(std::lround(each * panel.width * panel.height / area));
      const dvec3 normal = glm::cross(panel.u, panel.v);
      for (int i = 0; i < count; ++i) {
        const dvec2 p = sequence(i) * dvec2(panel.width, panel.height);
        add(panel.corner + p.x * panel.u + p.y * panel.v, normal, panel.front(p.x, p.y));
      }
    }
    const int least = points.position.empty() ? 1 : 0;  // where so few are asked for that every part rounds to none
    const int count = std::max(static_cast<int>(std::lround(each * ball_area / area)), least);
    for (int i = 0; i < count; ++i) {
      const dvec2 p = sequence(i);
      const double z = 2 * p.y - 1;
      const double ring = std::sqrt(1 - z * z);
      const dvec3 normal(ring * std::cos(2 * kPi * p.x), ring * std::sin(2 * kPi * p.x), z);
      add(scene.ball.center + scene.ball.radius * normal, normal, ballColor(scene.ball, normal));
    }
  }
  return points;
}

namespace {

void writeSampleFiles(const fs::path& folder, const SampleOptions& options) {
  std::error_code ignored;
  fs::remove(folder / "transforms_train.json", ignored);  // it comes last, and makes the folder a data set
  std::string written[2];
  for (const bool test : {false, true}) {
    const std::string split = test ? "test" : "train";
    const int count = test ? options.test_views : options.train_views;
    std::error_code code;
    fs::create_directories(folder / split, code);
    if (code) {
      throw Error(ErrorKind::cannotWrite, (folder / split).string(), "cannot make this folder: " + code.message());
    }
    nlohmann::json frames = nlohmann::json::array();
    for (int i = 0; i < count; ++i) {
      const Camera camera = sampleCamera(options, test, i);
      writeImage(folder / split / camera.name, renderSample(options, camera));
      frames.push_back(transformsFrame(camera, "./" + split + "/r_" + std::to_string(i)));
    }
    written[test ? 1 : 0] = nlohmann::json{{"camera_angle_x", kFieldOfView}, {"frames", frames}}.dump(1) + "\n";
  }
  writePoints(folder / "points3d.ply", samplePoints(options));
  writeTextAtomically(folder / "transforms_test.json", written[1]);
  writeTextAtomically(folder / "transforms_train.json", written[0]);
}

}  // namespace

void writeSample(const fs::path& folder, const SampleOptions& options, bool overwrite) {
  checkOptions(options);
  std::error_code ignored;
  for (const char* file : {"sparse", "transforms.json"}) {
    if (!fs::exists(folder / file, ignored)) continue;
    throw Error(ErrorKind::cannotWrite, folder.string(),
                std::string("holds ") + file + ", which this would not replace (expected another folder)");
  }
  constexpr const char* kOwn[] = {"transforms_train.json", "transforms_test.json", "train", "test", "points3d.ply"};
  for (const char* file : kOwn) {
    if (overwrite || !fs::exists(folder / file, ignored)) continue;
    throw Error(ErrorKind::cannotWrite, folder.string(),
                std::string("holds ") + file + " already (add --overwrite to replace it)");
  }
  if (overwrite) {
    writeSampleFiles(folder, options);
  } else {
    std::vector<std::string> files = {"transforms_train.json", "transforms_test.json", "points3d.ply"};
    for (int i = 0; i < options.train_views; ++i) files.push_back("train/" + sampleCamera(options, false, i).name);
    for (int i = 0; i < options.test_views; ++i) files.push_back("test/" + sampleCamera(options, true, i).name);
    writeAllOrNone(folder, std::move(files), [&] { writeSampleFiles(folder, options); });
  }
}

}  // namespace tg
