// SPDX-License-Identifier: Apache-2.0
// The paper's two pipelines: colour (section 4.1) and features (4.2), joined by equation 14. All filters are sums of
// products of one-dimensional ones; beyond the border the nearest pixel repeats.
#include "core/image/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/glm.hpp>
#include <numbers>
#include <numeric>
#include <string>
#include <vector>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kMaxPixelsPerDegree = 1e4;  // filters grow with it

// Exponents and knees of equations 8 to 14.
constexpr double kColorExponent = 0.7;    // q_c
constexpr double kColorKnee = 0.4;        // p_c, share of the largest colour difference
constexpr double kColorKneeError = 0.95;  // p_t, what that share is mapped to
constexpr double kFeatureExponent = 0.5;  // q_f
constexpr double kFeatureWidth = 0.082;   // w [degrees]: peak to trough of an edge that is seen best

// Contrast sensitivity in the spatial domain: a sum of a * sqrt(pi / b) * exp(-pi^2 x^2 / b), table 1.
struct Sensitivity {
  double a1, b1, a2, b2;
};
constexpr Sensitivity kAchromatic = {1.0, 0.0047, 0.0, 1e-5};
constexpr Sensitivity kRedGreen = {1.0, 0.0053, 0.0, 1e-5};
constexpr Sensitivity kBlueYellow = {34.1, 0.04, 13.5, 0.025};
constexpr double kWidestSensitivity = 0.04;

using Plane = std::vector<float>;
using Kernel = std::vector<double>;  // odd length, centre in the middle; of few pixels a degree no float holds

struct Size {
  int width, height;
  std::size_t pixels() const { return static_cast<std::size_t>(width) * height; }
};

// CIE XYZ of the sRGB primaries (IEC 61966-2-1, white point D65), as the exact fractions that x, y = 0.64, 0.33 / 0.3,
// 0.6 / 0.15, 0.06 and 0.3127, 0.329 give.
constexpr glm::dmat3 kXyzFromRgb = {{10135552.0 / 24577794, 2613072.0 / 12288897, 1425312.0 / 73733382},
                                    {8788810.0 / 24577794, 8788810.0 / 12288897, 8788810.0 / 73733382},
                                    {4435075.0 / 24577794, 887015.0 / 12288897, 70074185.0 / 73733382}};
const glm::dmat3 kRgbFromXyz = glm::inverse(kXyzFromRgb);
const glm::dvec3 kWhite = kXyzFromRgb * glm::dvec3(1.0);

double linearFromSrgb(double value) { return value > 0.04045 ? std::pow((value + 0.055) / 1.055, 2.4) : value / 12.92; }

// Y, Cx, Cz: linear in XYZ, opponent like CIELAB.
glm::dvec3 opponentFromXyz(const glm::dvec3& xyz) {
  const glm::dvec3 n = xyz / kWhite;
  return {116 * n.y - 16, 500 * (n.x - n.y), 200 * (n.y - n.z)};
}

glm::dvec3 xyzFromOpponent(const glm::dvec3& c) {
  const double y = (c.x + 16) / 116;
  return glm::dvec3(y + c.y / 500, y, y - c.z / 200) * kWhite;
}

double labCurve(double t) {
  constexpr double kDelta = 6.0 / 29.0;
  return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3 * kDelta * kDelta) + 4.0 / 29.0;
}

// CIELAB with chroma that fades in the dark (Hunt), equation 6.
glm::dvec3 huntLab(const glm::dvec3& rgb) {
  const glm::dvec3 n = kXyzFromRgb * rgb / kWhite;
  const double x = labCurve(n.x), y = labCurve(n.y), z = labCurve(n.z);
  const double lightness = 116 * y - 16;
  return {lightness, 0.01 * lightness * 500 * (x - y), 0.01 * lightness * 200 * (y - z)};
}

// HyAB distance, equation 7.
double colorDistance(const glm::dvec3& a, const glm::dvec3& b) {
  return std::abs(a.x - b.x) + std::hypot(a.y - b.y, a.z - b.z);
}

Kernel gaussian(double variance, int radius) {
  Kernel kernel(static_cast<std::size_t>(2 * radius + 1));
  for (int i = -radius; i <= radius; ++i) {
    kernel[static_cast<std::size_t>(i + radius)] = std::exp(-i * i / (2 * variance));
  }
  return kernel;
}

double totalOf(const Kernel& kernel) { return std::accumulate(kernel.begin(), kernel.end(), 0.0); }

Kernel normalized(Kernel kernel) {
  const double total = totalOf(kernel);
  for (double& value : kernel) value /= total;
  return kernel;
}

// Positive weights sum to 1, negative ones to -1.
Kernel balanced(Kernel kernel) {
  double positive = 0, negative = 0;
  for (double value : kernel) (value > 0 ? positive : negative) += std::abs(value);
  for (double& value : kernel) value /= value > 0 ? positive : negative;
  return kernel;
}

// out[y][x] = sum over the two kernels. `rows` is scratch space.
void convolve(const Plane& in, Size size, const Kernel& along_x, const Kernel& along_y, Plane& rows, Plane& out) {
  TG_ASSERT(in.size() == size.pixels(), "a plane has the picture's size");
  TG_ASSERT(along_x.size() % 2 == 1 && along_y.size() % 2 == 1, "a kernel has a middle");
  const int rx = static_cast<int>(along_x.size() / 2);
  const int ry = static_cast<int>(along_y.size() / 2);
  const std::size_t width = static_cast<std::size_t>(size.width);
  rows.resize(size.pixels());
  out.resize(size.pixels());
  parallelFor(size.height, 8, [&](std::int64_t y) {
    std::vector<float> padded(width + 2 * static_cast<std::size_t>(rx));
    const float* source = in.data() + static_cast<std::size_t>(y) * width;
    std::fill(padded.begin(), padded.begin() + rx, source[0]);
    std::copy(source, source + width, padded.begin() + rx);
    std::fill(padded.end() - rx, padded.end(), source[width - 1]);
    float* target = rows.data() + static_cast<std::size_t>(y) * width;
    std::fill(target, target + width, 0.0f);
    for (std::size_t k = 0; k < along_x.size(); ++k) {
      const float weight = static_cast<float>(along_x[along_x.size() - 1 - k]);
      for (std::size_t x = 0; x < width; ++x) target[x] += weight * padded[x + k];
    }
  });
  parallelFor(size.height, 8, [&](std::int64_t y) {
    float* target = out.data() + static_cast<std::size_t>(y) * width;
    std::fill(target, target + width, 0.0f);
    for (int k = -ry; k <= ry; ++k) {
      const int v = std::clamp(static_cast<int>(y) - k, 0, size.height - 1);
      const float weight = static_cast<float>(along_y[static_cast<std::size_t>(k + ry)]);
      const float* source = rows.data() + static_cast<std::size_t>(v) * width;
      for (std::size_t x = 0; x < width; ++x) target[x] += weight * source[x];
    }
  });
}

// One picture on its way through both pipelines.
struct Picture {
  std::array<Plane, 3> opponent;  // Y Cx Cz
  std::vector<glm::dvec3> lab;    // as the eye resolves it
  Plane edges, points;            // magnitudes of the features
};

void blurBySensitivity(Plane& plane, Size size, const Sensitivity& s, double pixels_per_degree, int radius, Plane& rows,
                       Plane& scratch) {
  const auto part = [&](double a, double b, Kernel& kernel) {
    kernel = gaussian(b * pixels_per_degree * pixels_per_degree / (2 * kPi * kPi), radius);
    const double mass = a * std::sqrt(kPi / b) * totalOf(kernel) * totalOf(kernel);
    kernel = normalized(kernel);
    return mass;
  };
  Kernel kernel1, kernel2;
  const double mass1 = part(s.a1, s.b1, kernel1);
  const double mass2 = part(s.a2, s.b2, kernel2);
  if (mass2 == 0) {
    convolve(plane, size, kernel1, kernel1, rows, scratch);
    plane.swap(scratch);
    return;
  }
  Plane second;
  convolve(plane, size, kernel2, kernel2, rows, second);
  convolve(plane, size, kernel1, kernel1, rows, scratch);
  const float w1 = static_cast<float>(mass1 / (mass1 + mass2));
  const float w2 = static_cast<float>(mass2 / (mass1 + mass2));
  for (std::size_t i = 0; i < plane.size(); ++i) plane[i] = w1 * scratch[i] + w2 * second[i];
}

void findFeatures(const Plane& lightness, Size size, double pixels_per_degree, Picture& picture) {
  const double sigma = 0.5 * kFeatureWidth * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  const Kernel smooth = normalized(gaussian(sigma * sigma, radius));
  Kernel first = smooth, second = smooth;
  for (int i = -radius; i <= radius; ++i) {
    first[static_cast<std::size_t>(i + radius)] *= -i;
    second[static_cast<std::size_t>(i + radius)] *= i * i / (sigma * sigma) - 1;
  }
  Plane rows, along_x, along_y;
  const auto magnitude = [&](const Kernel& derivative, Plane& out) {
    convolve(lightness, size, derivative, smooth, rows, along_x);
    convolve(lightness, size, smooth, derivative, rows, along_y);
    out.resize(size.pixels());
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = std::hypot(along_x[i], along_y[i]);
  };
  magnitude(balanced(first), picture.edges);
  magnitude(balanced(second), picture.points);
}

Picture process(const Image& image, double pixels_per_degree) {
  const Size size{image.width, image.height};
  Picture picture;
  for (Plane& plane : picture.opponent) plane.resize(size.pixels());
  Plane lightness(size.pixels());  // in [0, 1]
  parallelFor(size.height, 8, [&](std::int64_t y) {
    for (std::size_t i = static_cast<std::size_t>(y) * size.width, x = 0; x < static_cast<std::size_t>(size.width);
         ++x, ++i) {
      glm::dvec3 rgb;
      for (int c = 0; c < 3; ++c) rgb[c] = linearFromSrgb(std::clamp(image.data[i * 3 + c], 0.0f, 1.0f));
      const glm::dvec3 opponent = opponentFromXyz(kXyzFromRgb * rgb);
      for (int c = 0; c < 3; ++c) picture.opponent[c][i] = static_cast<float>(opponent[c]);
      lightness[i] = static_cast<float>((opponent.x + 16) / 116);
    }
  });
  findFeatures(lightness, size, pixels_per_degree, picture);

  const int radius =
      static_cast<int>(std::ceil(3 * std::sqrt(kWidestSensitivity / (2 * kPi * kPi)) * pixels_per_degree));
  Plane rows, scratch;
  const Sensitivity* sensitivities[3] = {&kAchromatic, &kRedGreen, &kBlueYellow};
  for (int c = 0; c < 3; ++c) {
    blurBySensitivity(picture.opponent[c], size, *sensitivities[c], pixels_per_degree, radius, rows, scratch);
  }
  picture.lab.resize(size.pixels());
  parallelFor(size.height, 8, [&](std::int64_t y) {
    for (std::size_t i = static_cast<std::size_t>(y) * size.width, x = 0; x < static_cast<std::size_t>(size.width);
         ++x, ++i) {
      const glm::dvec3 opponent(picture.opponent[0][i], picture.opponent[1][i], picture.opponent[2][i]);
      picture.lab[i] = huntLab(glm::clamp(kRgbFromXyz * xyzFromOpponent(opponent), 0.0, 1.0));
    }
  });
  return picture;
}

// Equations 8 and 9: small differences spread over most of [0, 1], large ones pressed into the rest.
double colorError(const glm::dvec3& a, const glm::dvec3& b, double largest) {
  const double difference = std::pow(colorDistance(a, b), kColorExponent);
  const double knee = kColorKnee * largest;
  if (difference < knee) return difference * kColorKneeError / knee;
  return kColorKneeError + (difference - knee) / (largest - knee) * (1 - kColorKneeError);
}

}  // namespace

Image flipMap(const Image& reference, const Image& test, double pixels_per_degree) {
  TG_ASSERT(hasImageShape(reference) && hasImageShape(test), "the images' data has their size");
  if (reference.width != test.width || reference.height != test.height || reference.channels != 3 ||
      test.channels != 3 || reference.data.empty()) {
    throw Error(ErrorKind::badData, "FLIP compares two pictures of one size with 3 channels");
  }
  if (!(pixels_per_degree >= 1 && pixels_per_degree <= kMaxPixelsPerDegree)) {
    throw Error(ErrorKind::usage, "pixels per degree out of range (expected 1 to 10000, found " +
                                      std::to_string(pixels_per_degree) + ")");
  }
  const Picture a = process(reference, pixels_per_degree);
  const Picture b = process(test, pixels_per_degree);
  const double largest =
      std::pow(colorDistance(huntLab({0, 1, 0}), huntLab({0, 0, 1})), kColorExponent);  // green against blue
  Image map(reference.width, reference.height, 1);
  parallelFor(map.height, 8, [&](std::int64_t y) {
    for (std::size_t i = static_cast<std::size_t>(y) * map.width, x = 0; x < static_cast<std::size_t>(map.width);
         ++x, ++i) {
      const double feature = std::max(std::abs(a.edges[i] - b.edges[i]), std::abs(a.points[i] - b.points[i]));
      const double feature_error = std::pow(feature / std::numbers::sqrt2, kFeatureExponent);
      const double error = std::pow(colorError(a.lab[i], b.lab[i], largest), 1 - feature_error);
      map.data[i] = static_cast<float>(std::clamp(error, 0.0, 1.0));
    }
  });
  return map;
}

double flip(const Image& map, Mask mask) {
  TG_ASSERT(map.channels == 1 && hasImageShape(map), "a map has 1 channel");
  TG_ASSERT(mask.empty() || mask.size() == map.data.size(), "a mask has the picture's size");
  double total = 0;
  std::size_t counted = 0;
  for (std::size_t i = 0; i < map.data.size(); ++i) {
    if (!mask.empty() && mask[i] == 0) continue;
    total += map.data[i];
    ++counted;
  }
  return total / static_cast<double>(std::max<std::size_t>(counted, 1));
}

}  // namespace tg
