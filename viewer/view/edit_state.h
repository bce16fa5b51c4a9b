// SPDX-License-Identifier: Apache-2.0
// What the user is choosing and changing in the model shown.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/system/names.h"
#include "viewer/view/gizmo.h"
#include "viewer/view/selection.h"

namespace tg {

// What the left button does in the picture. none: the camera's.
enum class EditTool { none, rectangle, brush, sphere, move, turn, scale };
constexpr auto namesOf(EditTool) { return enumNames("none", "rectangle", "brush", "sphere", "move", "turn", "scale"); }
constexpr double kMinBrush = 2, kMaxBrush = 400;       // [px] its radius
constexpr double kMinSphere = 1e-4, kMaxSphere = 1e4;  // [scene radii] its radius

// Of models: no two that were read or edited have the same one.
std::uint64_t newRevision();

// While the left button is down.
struct SelectDrag {
  SelectMode mode = SelectMode::replace;
  SelectionPtr before;
  std::vector<glm::vec2> points;    // projectedMeans()
  std::vector<std::uint8_t> swept;  // of the brush
  glm::dvec2 from{0.0}, to{0.0};    // [px]
};
struct GizmoDrag {
  Gizmo gizmo;
  Handle handle = Handle::none;
  glm::dvec2 from{0.0};  // [px]
  Similarity similarity;
};
// The model as the drag under way would leave it.
struct EditPreview {
  std::shared_ptr<const GaussianModel> of, model;
  Similarity similarity;
};

struct EditState {
  EditTool tool = EditTool::none;
  SelectMode mode = SelectMode::replace;
  bool visible_only = false;  // rectangle and brush leave what is hidden alone
  double brush = 24;          // [px] radius
  double sphere = 0.1;        // [scene radii] radius
  SelectionPtr selection;     // of the model shown
  std::size_t value = 0;      // of selectValues(): what the histogram is of
  std::optional<Histogram> histogram;
  double low = 0, high = -1;                 // range of the histogram that was dragged; none while low > high
  std::optional<SelectionPtr> range_before;  // the selection before that drag, while it is under way
  SelectionPtr range_found;                  // the selection that the drag made
  glm::dvec3 move{0.0};                      // fields of the page [world units]
  glm::dvec3 turn{0.0};                      // [degrees] about x, then y, then z
  double scale = 1;

  bool in_right = false;  // of two pictures beside each other the pointer, or where its drag began, is in the right one
  std::optional<glm::dvec2> pointer;  // [px] of the picture, while a tool is at work there
  std::optional<glm::dvec3> surface;  // under it, for the sphere
  std::optional<SelectDrag> selecting;
  std::optional<GizmoDrag> moving;
  std::optional<EditPreview> preview;
  Handle hovered = Handle::none;

  // Which model this is: every edit makes a new one, taking it back the old one.
  std::uint64_t read = newRevision();  // as the file had it; edits have greater ones
  std::uint64_t revision = read;
  std::uint64_t saved = read;  // what a file holds
};

// For another model: with the tool at hand.
inline EditState afresh(const EditState& before) {
  EditState fresh;
  fresh.tool = before.tool;
  fresh.mode = before.mode;
  fresh.visible_only = before.visible_only;
  fresh.value = before.value;
  fresh.brush = before.brush;
  fresh.sphere = before.sphere;
  return fresh;
}

}  // namespace tg
