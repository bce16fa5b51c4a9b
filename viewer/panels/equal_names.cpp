// SPDX-License-Identifier: Apache-2.0
// Two widgets of one name in one window are one to Dear ImGui, and clicks on the second are lost. Where promises are
// checked the linker (--wrap) leads every widget of the library through here, and the second is a broken promise.
#include <imgui.h>
#include <imgui_internal.h>

#include <string>
#include <unordered_map>

#include "core/system/assert.h"

namespace {

std::unordered_map<ImGuiID, ImVec2> met;  // in this frame, and where; of the thread that draws panels

std::string placeOf(ImVec2 at) {
  return ImGui::GetCurrentWindow()->Name + std::string(", at ") + std::to_string(static_cast<int>(at.x)) + " " +
         std::to_string(static_cast<int>(at.y));
}

}  // namespace

bool libraryItemAdd(const ImRect& box, ImGuiID id, const ImRect* navigation,
                    ImGuiItemFlags flags) __asm__("__real_" TG_ITEM_ADD);
bool ourItemAdd(const ImRect& box, ImGuiID id, const ImRect* navigation,
                ImGuiItemFlags flags) __asm__("__wrap_" TG_ITEM_ADD);
void libraryNewFrame() __asm__("__real_" TG_NEW_FRAME);
void ourNewFrame() __asm__("__wrap_" TG_NEW_FRAME);

bool ourItemAdd(const ImRect& box, ImGuiID id, const ImRect* navigation, ImGuiItemFlags flags) {
  if (id != 0) {
    // A slider that is typed into becomes a field of the same name in the same place.
    const auto [first, fresh] = met.try_emplace(id, box.Min);
    const bool alone = fresh || (first->second.x == box.Min.x && first->second.y == box.Min.y);
    TG_ASSERT(
        alone,
        ("a widget's name is its own in its window: " + placeOf(first->second) + " and " + placeOf(box.Min)).c_str());
  }
  return libraryItemAdd(box, id, navigation, flags);
}

void ourNewFrame() {
  met.clear();
  libraryNewFrame();
}
