// SPDX-License-Identifier: Apache-2.0
// Which Gaussians of a model are chosen, and the ways to choose them in a picture.
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/model/camera.h"
#include "core/model/model.h"
#include "core/system/names.h"
#include "render/settings.h"

namespace tg {

constexpr std::size_t kMostDots = 20'000;

// At least one Gaussian.
struct Selection {
  std::vector<std::uint8_t> chosen;  // [N] 0 or 1
  std::size_t count = 0;
  std::vector<std::uint32_t> dots;  // at most kMostDots of them, evenly spread: what is drawn
  glm::dvec3 center{0.0};           // mean of their means [world units]
};
using SelectionPtr = std::shared_ptr<const Selection>;  // null: nothing is chosen

// What becomes of the selection that there is.
enum class SelectMode { replace, add, subtract, intersect };
constexpr auto namesOf(SelectMode) { return enumNames("replace", "add", "subtract", "intersect"); }

// All masks are [N]. Null where none is chosen.
SelectionPtr selectionOf(const GaussianModel& model, std::vector<std::uint8_t> chosen);
std::vector<std::uint32_t> indicesOf(const Selection& selection);  // ascending
std::vector<std::uint8_t> combined(const SelectionPtr& before, std::vector<std::uint8_t> found, SelectMode mode);
std::vector<std::uint8_t> inverted(const SelectionPtr& before, std::size_t count);

// [N] the means in the camera's image [px]; not a number where they are not drawn: before the near plane, or out of the
// crop box.
std::vector<glm::vec2> projectedMeans(const GaussianModel& model, const Camera& camera, const RenderSettings& settings);
std::vector<std::uint8_t> insideRectangle(std::span<const glm::vec2> points, glm::dvec2 a, glm::dvec2 b);
// Marks what a disc of that radius [px] goes over on its way from a to b.
void sweep(std::span<const glm::vec2> points, glm::dvec2 a, glm::dvec2 b, double radius,
           std::vector<std::uint8_t>& swept);
// Takes out what a picture with these settings does not show: those that make up less than a twentieth of a pixel.
// Draws a frame, always in one order, without antialiasing.
void keepVisible(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                 std::vector<std::uint8_t>& mask);
// Where the ray of that pixel has lost half of its light, else the Gaussian of most weight; none where it hits nothing.
std::optional<glm::dvec3> surfaceAt(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                                    glm::ivec2 pixel);

// ---- By value
struct SelectValue {
  std::string_view name;  // of valuesOf()
  const char* label;
  bool logarithmic;
  const char* help;
};
std::span<const SelectValue> selectValues();

// How one number is distributed. A bar has the width of (high - low) / bars.
struct Histogram {
  std::weak_ptr<const GaussianModel> of;
  std::size_t value = 0;      // of selectValues()
  std::vector<float> values;  // [N], their logarithms to base 10 where logarithmic
  double low = 0, high = 1;
  std::vector<float> bars;  // in [0, 1], roots of the counts: single floaters are seen
};
constexpr std::size_t kHistogramBars = 64;
Histogram histogramOf(const std::shared_ptr<const GaussianModel>& model, std::size_t value);
std::vector<std::uint8_t> insideRange(const Histogram& histogram, double low, double high);

}  // namespace tg
