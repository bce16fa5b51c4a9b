// SPDX-License-Identifier: Apache-2.0
// What the panels are built from.
#pragma once
#include <imgui.h>

#include <cstddef>
#include <filesystem>
#include <glm/glm.hpp>
#include <string>

namespace tg {

const ImVec4 kAccent(0.184f, 0.435f, 0.624f, 1.0f);
const ImVec4 kAccentHovered(0.231f, 0.506f, 0.710f, 1.0f);
const ImVec4 kErrorText(0.98f, 0.52f, 0.47f, 1.0f);
const ImVec4 kWarningText(0.93f, 0.77f, 0.42f, 1.0f);
const ImVec4 kHighlightText(0.455f, 0.714f, 0.894f, 1.0f);

constexpr ImGuiWindowFlags kOverlay = ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize |
                                      ImGuiWindowFlags_NoMove | ImGuiWindowFlags_AlwaysAutoResize |
                                      ImGuiWindowFlags_NoSavedSettings;

// Whether the Tab key leads to the widgets between them.
void pushTabStop(bool stops);
void popTabStop();

void heading(const char* text);
// The tooltip of the widget before, once the pointer has been over it for a while.
void hint(const char* text);
// The pointer is over a widget, and has not been for that long.
bool hintIsDue();
// The same as a hint of a field with a file's name: where that file is, below other words.
void fileHint(const std::filesystem::path& file, const std::string& words = "");
// One of `count` buttons that share a row, the active one coloured. True when clicked.
bool segment(const char* label, bool active, int index, int count);
// A slider as wide as the next item, whose mark lies below its words. `value`, `low` and `high` are of `type`. A double
// click opens a field with the value from before it.
bool slider(const char* id, ImGuiDataType type, void* value, const void* low, const void* high, const char* format,
            ImGuiSliderFlags flags = 0);
bool slider(const char* id, float& value, float low, float high, const char* format, ImGuiSliderFlags flags = 0);
// Whether one has taken back in this frame what the first press of a double click had done.
bool sliderIsPutBack();
// Three numbers, as wide as there is room, to be dragged or typed. What is typed counts where it is finite, else what
// was there before. True when they were changed.
bool vectorField(const char* id, glm::vec3& value, float speed, const char* format);
// A line of text; `placeholder` where it is empty. True when it was changed.
bool textField(const char* id, std::string& text, const char* placeholder);
// Text at a place of the screen, cut where its room [ImGui units] ends.
void clippedText(ImVec2 corner, float room, ImU32 color, const std::string& text);
// `text` with "..." in its middle where it is wider than its room [ImGui units].
std::string cutMiddle(const std::string& text, float room);
bool enterPressed();
std::string grouped(std::size_t value);  // 1 234 567

}  // namespace tg
