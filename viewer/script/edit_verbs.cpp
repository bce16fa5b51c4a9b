// SPDX-License-Identifier: Apache-2.0
// Script commands that choose, change and save Gaussians, and undo.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "converter/edit/select.h"
#include "converter/registry/file_format.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "viewer/script/verb.h"
#include "viewer/view/edits.h"

namespace tg {
namespace {

constexpr int kRows = 1000;  // [px] of the picture in which places are shares

template <std::size_t kCountOfNumbers>
std::array<double, kCountOfNumbers> listOf(const Call& call, const char* expected) {
  std::array<double, kCountOfNumbers> numbers{};
  const bool all = parseList<double>(call[0], numbers);
  if (!all || !std::ranges::all_of(numbers, [](double n) { return std::abs(n) <= 1e9; })) {
    refuseValue(call.what, call[0], expected);
  }
  return numbers;
}

void requireModel(const Call& call) {
  if (!mayEdit(call.state)) throw Error(ErrorKind::usage, call.what + ": there is no whole model");
}

std::vector<std::uint8_t> inRectangle(const Call& call, glm::dvec2 from, glm::dvec2 to) {
  const ViewerState& state = call.state;
  const Camera camera =
      toCamera(state.camera.pose, state.camera.lens, std::max(static_cast<int>(kRows * state.camera.aspect), 1), kRows);
  const RenderSettings settings = effectiveSettings(state);
  const glm::dvec2 size(camera.size);
  std::vector<std::uint8_t> found =
      insideRectangle(projectedMeans(*state.scene.model, camera, settings), size * from, size * to);
  if (state.edit.visible_only) keepVisible(*state.scene.model, camera, settings, found);
  return found;
}

void requireFormat(const Call& call) {
  try {
    (void)modelFormat(call[0]);
  } catch (const Error& error) {
    throw Error(error.kind, call.what + ": " + error.what());
  }
}

std::vector<std::uint8_t> inExpression(const Call& call) {
  try {
    return whereValue(*call.state.scene.model, call[0]);
  } catch (const Error& error) {
    throw Error(error.kind, call.what + ": " + error.what());
  }
}

void combine(const Call& call, std::vector<std::uint8_t> found) {
  choose(call.state, std::move(found), call.state.edit.mode, call.state.edit.selection);
}

constexpr std::array kEditVerbs = {
    Verb{"undo", 0, kFramesOfPanels, [](const Call& c) { undo(c.state); }},
    Verb{"redo", 0, kFramesOfPanels, [](const Call& c) { redo(c.state); }},
    Verb{"tool", 1, kFramesOfPanels,
         [](const Call& c) {
           setTool(c.state, EditTool::none);
           setTool(c.state, c.named<EditTool>());
         }},
    Verb{"select-mode", 1, 0, [](const Call& c) { c.state.edit.mode = c.named<SelectMode>(); }},
    Verb{"visible-only", 1, 0, [](const Call& c) { c.state.edit.visible_only = c.on(); }},
    Verb{"select", 1, 1,
         [](const Call& c) {
           requireModel(c);
           if (c[0] == "all") return chooseAll(c.state);
           if (c[0] == "none") return chooseNone(c.state);
           if (c[0] == "invert") return invertChoice(c.state);
           combine(c, inExpression(c));
         }},
    Verb{"select-rectangle", 4, 1,
         [](const Call& c) {
           requireModel(c);
           combine(c, inRectangle(c, {c.number(0, 0, 1), c.number(1, 0, 1)}, {c.number(2, 0, 1), c.number(3, 0, 1)}));
         }},
    Verb{"select-sphere", 1, 1,
         [](const Call& c) {
           requireModel(c);
           const auto n = listOf<4>(c, "x,y,z,RADIUS");
           if (!(n[3] > 0)) refuseValue(c.what, c[0], "a radius above 0");
           combine(c, insideSphere(*c.state.scene.model, {n[0], n[1], n[2]}, n[3]));
         }},
    Verb{"delete-selection", 0, 1, [](const Call& c) { deleteChosen(c.state); }},
    Verb{"move-selection", 1, 1,
         [](const Call& c) {
           requireModel(c);
           const auto n = listOf<3>(c, "x,y,z");
           transformChosen(c.state, similarityOf(c.state, {n[0], n[1], n[2]}, glm::dvec3(0.0), 1));
         }},
    Verb{"turn-selection", 1, 1,
         [](const Call& c) {
           requireModel(c);
           const auto n = listOf<3>(c, "x,y,z in degrees");
           transformChosen(c.state, similarityOf(c.state, glm::dvec3(0.0), {n[0], n[1], n[2]}, 1));
         }},
    Verb{"scale-selection", 1, 1,
         [](const Call& c) {
           requireModel(c);
           transformChosen(c.state, similarityOf(c.state, glm::dvec3(0.0), glm::dvec3(0.0), c.number(0, 1e-3, 1e3)));
         }},
    Verb{"save-model", 1, kFramesOfPanels,
         [](const Call& c) {
           requireModel(c);
           requireFormat(c);
           c.state.desktop.save_request = c[0];
         }},
};

}  // namespace

std::span<const Verb> editVerbs() { return kEditVerbs; }

}  // namespace tg
