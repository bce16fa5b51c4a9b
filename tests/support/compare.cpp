// SPDX-License-Identifier: Apache-2.0
// The band rule.
#include "support/compare.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "core/image/flip.h"

namespace tg::test {
namespace {

constexpr auto kDepth = static_cast<std::size_t>(Output::depth);

double differ(double a, double b) {
  const double d = std::abs(a - b) / std::max(1.0, std::abs(b));
  return std::isfinite(d) ? d : std::numeric_limits<double>::infinity();
}
template <typename T>
double differ(glm::vec<3, float> a, glm::vec<3, T> b) {
  return std::max({differ(a.x, b.x), differ(a.y, b.y), differ(a.z, b.z)});
}

// As a screen shows it, over black.
template <typename T>
Image pictureOf(const FrameT<T>& frame) {
  Image picture(frame.width, frame.height, 3);
  for (std::size_t i = 0; i < frame.base.size(); ++i) {
    const glm::vec3 color(frame.color(i));
    for (int c = 0; c < 3; ++c) picture.data[3 * i + static_cast<std::size_t>(c)] = std::clamp(color[c], 0.0f, 1.0f);
  }
  return picture;
}

void look(FrameDifference& difference, const Image& picture, const Image& reference) {
  if (reference.data.empty()) return;
  Image map = flipMap(reference, picture);
  difference.look_mean = flip(map);
  const std::size_t rank = (map.data.size() * 99 + 99) / 100 - 1;
  std::ranges::nth_element(map.data, map.data.begin() + static_cast<std::ptrdiff_t>(rank));
  difference.look_99 = map.data[rank];
}

template <typename T>
FrameDifference compare(const Frame& frame, const FrameT<T>& reference, const Tolerance& tolerance) {
  FrameDifference result;
  result.pixels = reference.base.size();
  if (frame.width != reference.width || frame.height != reference.height) {
    for (OutputDifference& output : result.outputs) output.max = std::numeric_limits<double>::infinity();
    return result;
  }
  look(result, pictureOf(frame), pictureOf(reference));
  for (std::size_t i = 0; i < result.pixels; ++i) {
    const bool flipped = static_cast<double>(frame.count[i]) != static_cast<double>(reference.count[i]);
    result.flipped += flipped;
    const std::array<double, 7> distances = {
        differ(frame.color(i), reference.color(i)),     differ(frame.base[i], reference.base[i]),
        differ(frame.texture[i], reference.texture[i]), differ(frame.alpha[i], reference.alpha[i]),
        differ(frame.depth[i], reference.depth[i]),     differ(frame.normal[i], reference.normal[i]),
        differ(frame.count[i], reference.count[i])};
    for (std::size_t k = 0; k < distances.size(); ++k) {
      OutputDifference& output = result.outputs[k];
      output.max = std::max(output.max, distances[k]);
      if (!flipped) output.max_same = std::max(output.max_same, distances[k]);
      output.mean += distances[k] / static_cast<double>(result.pixels);
      const double factor = k == kDepth ? tolerance.depth_factor : 1.0;
      output.outliers += distances[k] > tolerance.tight * factor;
    }
  }
  return result;
}

double share(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

FrameDifference compareFrames(const FrameT<float>& frame, const FrameT<double>& reference, const Tolerance& tolerance) {
  return compare(frame, reference, tolerance);
}
FrameDifference compareFrames(const Frame& frame, const Frame& reference, const Tolerance& tolerance) {
  return compare(frame, reference, tolerance);
}

Frame rounded(const FrameT<double>& exact) {
  Frame frame;
  frame.width = exact.width;
  frame.height = exact.height;
  forEachPlane([](Output, const auto& from, auto& to) { to.assign(from.begin(), from.end()); }, exact, frame);
  return frame;
}

std::string violations(const FrameDifference& difference, const Tolerance& tolerance) {
  std::ostringstream out;
  for (std::size_t k = 0; k < difference.outputs.size(); ++k) {
    const auto output = static_cast<Output>(k);
    const OutputDifference& d = difference.outputs[k];
    const double outliers = share(d.outliers, difference.pixels);
    if (outliers > tolerance.outlier_share) {
      out << name(output) << ": too many outliers (expected " << tolerance.outlier_share << ", found " << outliers
          << ")\n";
    }
    const double loose = tolerance.loose * (k == kDepth ? tolerance.depth_factor : 1.0);
    if (d.max_same > loose) {
      out << name(output) << ": pixels of the same splats differ (expected " << loose << ", found " << d.max_same
          << ")\n";
    }
    // One splat more or less moves depth and count by any amount.
    const bool bounded = output != Output::depth && output != Output::count;
    if (!std::isfinite(d.max) || (bounded && d.max > tolerance.flip)) {
      out << name(output) << ": a pixel differs (expected " << tolerance.flip << ", found " << d.max << ")\n";
    }
  }
  const auto looks = [&](const char* what, double most, double found) {
    if (!(found <= most)) out << "FLIP, " << what << " (expected " << most << ", found " << found << ")\n";
  };
  looks("mean", tolerance.look_mean, difference.look_mean);
  looks("99th percentile", tolerance.look_99, difference.look_99);
  return out.str();
}

std::string report(const FrameDifference& difference) {
  std::ostringstream out;
  out.precision(3);
  out << difference.pixels << " pixels, " << difference.flipped << " with another number of splats, FLIP mean "
      << difference.look_mean << ", 99th percentile " << difference.look_99 << "\n";
  for (std::size_t k = 0; k < difference.outputs.size(); ++k) {
    const OutputDifference& d = difference.outputs[k];
    out << name(static_cast<Output>(k)) << ": max " << d.max << ", max of same splats " << d.max_same << ", mean "
        << d.mean << ", outliers " << 100.0 * share(d.outliers, difference.pixels) << " %\n";
  }
  return out.str();
}

}  // namespace tg::test
