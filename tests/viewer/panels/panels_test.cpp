// SPDX-License-Identifier: Apache-2.0
// The panels without a window: Dear ImGui draws them into nothing, and a pointer goes over all of it.
#include "viewer/panels/panels.h"

#include <imgui.h>
#include <imgui_internal.h>

#include <map>
#include <memory>
#include <string>

#include "core/tiny_model.h"
#include "support/catch.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/edits.h"
#include "viewer/view/path_editor.h"

using namespace tg;

namespace {

class Interface {
 public:
  Interface() {
    ImGuiIO& io = ImGui::GetIO();
    io.IniFilename = nullptr;
    io.DisplaySize = {kWidth, kHeight};
    unsigned char* pixels = nullptr;
    int width = 0, height = 0;
    io.Fonts->GetTexDataAsAlpha8(&pixels, &width, &height);
  }

  // The widget under the pointer; 0: none.
  ImGuiID hovered(ViewerState& state, ImVec2 pointer) const {
    ImGui::GetIO().MousePos = pointer;
    ImGui::GetIO().DeltaTime = 0.01f;
    ImGui::NewFrame();
    drawPanels(state, {{4, 5}, {{"blend", 3}}, "device", {64, 48}});
    ImGui::EndFrame();
    return context_->HoveredId;
  }

  static constexpr float kWidth = 900, kHeight = 1000;

 private:
  struct Destroy {
    void operator()(ImGuiContext* context) const { ImGui::DestroyContext(context); }
  };
  const std::unique_ptr<ImGuiContext, Destroy> context_{ImGui::CreateContext()};
};

// Where widgets lie that share an ID: the places where it is met leave gaps then. "": each has its own.
std::string sharedIds(ViewerState& state) {
  constexpr float kStepX = 9, kStepY = 7;  // [ImGui units] less than the sides of the smallest button
  const Interface interface;
  for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});  // scroll bars and tables settle
  struct Box {
    ImRect places;
    int met = 0;
  };
  std::map<ImGuiID, Box> boxes;
  const float width = panelWidth(state, Interface::kWidth);
  REQUIRE(width > 0);
  for (float y = 1; y < Interface::kHeight; y += kStepY) {
    for (float x = 1; x < width; x += kStepX) {
      const ImGuiID id = interface.hovered(state, {x, y});
      if (id == 0) continue;
      Box& box = boxes.try_emplace(id, Box{{x, y, x, y}}).first->second;
      box.places.Add({x, y});
      ++box.met;
    }
  }
  CHECK(boxes.size() >= 8);
  std::string shared;
  for (const auto& [id, box] : boxes) {
    const auto& [places, met] = box;
    const float columns = places.GetWidth() / kStepX + 1, rows = places.GetHeight() / kStepY + 1;
    if (met == static_cast<int>(columns * rows + 0.5f)) continue;
    shared += "between " + std::to_string(places.Min.x) + ", " + std::to_string(places.Min.y) + " and " +
              std::to_string(places.Max.x) + ", " + std::to_string(places.Max.y) + "\n";
  }
  return shared;
}

ViewerState bareState() {
  Scene scene;
  scene.path = "tiny.tgz";
  scene.model = std::make_shared<GaussianModel>(tinyTexturedModel(6));
  scene.gaussians = 6;
  scene.textured = 4;
  scene.texture_mode = TextureMode::rgba;
  scene.bounds = sceneBounds(*scene.model);
  ViewerState state;
  setScene(state, scene);
  return state;
}

// With as many widgets as there are.
ViewerState fullState() {
  ViewerState state = bareState();
  state.scene.cameras = {lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 48)};
  state.scene.warnings = {"a warning"};
  for (const char* path : {"tiny.tgz", "other.tgz"}) {
    state.documents.open.emplace_back().path = path;
    state.documents.open.back().scene = state.scene;
  }
  state.documents.shown = 0;
  state.recent = {"tiny.tgz"};
  for (int i = 0; i < 3; ++i) {
    addBookmark(state);
    addKey(state);
  }
  state.display.crop = true;
  state.inspect.inspected = true;
  state.inspect.hits.resize(3);
  for (PixelHit& hit : state.inspect.hits) hit.t = ++state.inspect.picked;
  state.compare.photographs = "photographs";
  state.follow.active = true;
  return state;
}

}  // namespace

TEST_CASE("no two widgets of a page share an ID: the second of them could not be clicked") {
  static_assert(kCount<CompareMode> <= kCount<Tab>);  // each of the modes is met on one of the pages
  for (const Tab tab : valuesOf<Tab>()) {
    INFO(name(tab));
    ViewerState bare = bareState(), full = fullState();
    bare.ui.tab = full.ui.tab = tab;
    full.compare.how.mode = static_cast<CompareMode>(static_cast<int>(tab) % kCount<CompareMode>);
    full.record.wanted = tab == Tab::path;
    full.edit.tool = full.record.wanted ? EditTool::none : EditTool::turn;
    chooseAll(full);
    CHECK(sharedIds(bare) == "");
    CHECK(sharedIds(full) == "");
  }
}
