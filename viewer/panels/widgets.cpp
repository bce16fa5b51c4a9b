// SPDX-License-Identifier: Apache-2.0
// Headings, hints, rows of buttons.
#include "viewer/panels/widgets.h"

#include <imgui_internal.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "viewer/view/names.h"

namespace tg {
namespace {

constexpr float kHintFonts = 40;    // [font heights] of a line, at most
constexpr float kHintDelay = 0.4f;  // [s] so that none covers what a click on the way has brought

}  // namespace

void heading(const char* text) {
  ImGui::Dummy({0, ImGui::GetFontSize() * 0.25f});
  ImGui::TextDisabled("%s", text);
}

namespace {

ImGuiID dueId() { return ImHashStr("hint is due"); }

// The pointer has been over the item for that long. Dear ImGui times what has an ID; a text has a place.
bool hasRested() {
  const ImGuiContext& context = *ImGui::GetCurrentContext();
  if (context.HoveredId != 0) return context.HoveredIdTimer >= kHintDelay;
  ImGuiStorage& kept = *ImGui::GetStateStorage();
  const ImVec2 corner = ImGui::GetItemRectMin();
  const ImGuiID last = ImHashData(&corner, sizeof corner), begin = ImHashStr("begin", 0, last);
  const auto now = static_cast<float>(ImGui::GetTime());
  if (kept.GetInt(last, -2) < context.FrameCount - 1) kept.SetFloat(begin, now);
  kept.SetInt(last, context.FrameCount);
  const bool rested = now - kept.GetFloat(begin) >= kHintDelay;
  if (!rested && context.HoveredWindow) context.HoveredWindow->StateStorage.SetInt(dueId(), context.FrameCount);
  return rested;
}

}  // namespace

bool hintIsDue() {
  const ImGuiContext& context = *ImGui::GetCurrentContext();
  if (context.HoveredId != 0) return context.HoveredIdTimer < kHintDelay;
  return context.HoveredWindow && context.HoveredWindow->StateStorage.GetInt(dueId(), -1) == context.FrameCount;
}

void hint(const char* text) {
  if (!ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled) || !hasRested()) return;
  ImGui::BeginTooltip();
  const float room = ImGui::GetIO().DisplaySize.x - 2 * ImGui::GetStyle().WindowPadding.x;
  ImGui::PushTextWrapPos(std::min(kHintFonts * ImGui::GetFontSize(), room));
  ImGui::TextUnformatted(text);
  ImGui::PopTextWrapPos();
  ImGui::EndTooltip();
}

void fileHint(const std::filesystem::path& file, const std::string& words) {
  if (!ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled)) return;
  std::string text = words;
  if (!file.empty()) text += (words.empty() ? "" : "\n") + ("That is " + printable(absolutePath(file).string()));
  if (!text.empty()) hint(text.c_str());
}

namespace {

// `label` without its end, where all of it is too wide.
std::string fitted(const std::string& label, float width) {
  std::string text = label.substr(0, label.find("##"));
  if (ImGui::CalcTextSize(text.c_str()).x <= width) return label;
  while (!text.empty() && ImGui::CalcTextSize((text + "...").c_str()).x > width) text.pop_back();
  return text + "...###" + label;
}

}  // namespace

bool segment(const char* label, bool active, int index, int count) {
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  if (index > 0) ImGui::SameLine(0, spacing);
  const float room = ImGui::GetContentRegionAvail().x;
  const int left = count - index;
  const float width = std::floor((room - spacing * static_cast<float>(left - 1)) / static_cast<float>(left));
  if (active) {
    ImGui::PushStyleColor(ImGuiCol_Button, kAccent);
    ImGui::PushStyleColor(ImGuiCol_ButtonHovered, kAccentHovered);
    ImGui::PushStyleColor(ImGuiCol_ButtonActive, kAccentHovered);
  }
  ImGui::PushStyleVar(ImGuiStyleVar_FramePadding, {0, ImGui::GetStyle().FramePadding.y});  // room for the label
  const bool clicked = ImGui::Button(fitted(label, width).c_str(), {width, 0});
  ImGui::PopStyleVar();
  if (active) ImGui::PopStyleColor(3);
  return clicked;
}

namespace {

using SliderValue = std::array<int, 2>;  // the bytes of one of any type

SliderValue valueAt(ImGuiDataType type, const void* value) {
  SliderValue bytes{};
  TG_ASSERT(ImGui::DataTypeGetInfo(type)->Size <= sizeof bytes, "a slider's value has at most 8 bytes");
  std::memcpy(bytes.data(), value, ImGui::DataTypeGetInfo(type)->Size);
  return bytes;
}

ImGuiID putBackId() { return ImHashStr("slider is put back"); }

// The second press of a double click on the slider, whose first one has moved it.
bool isPressedTwice(ImGuiID slider) {
  const ImGuiContext& context = *ImGui::GetCurrentContext();
  return ImGui::IsMouseDoubleClicked(0) && context.HoveredIdPreviousFrame == slider && context.LastActiveId == slider;
}

}  // namespace

bool slider(const char* id, ImGuiDataType type, void* value, const void* low, const void* high, const char* format,
            ImGuiSliderFlags flags) {
  flags |= ImGuiSliderFlags_AlwaysClamp;
  const ImGuiID item = ImGui::GetID(id), first = ImHashStr("before", 0, item), second = first + 1;
  ImGuiStorage& kept = *ImGui::GetStateStorage();
  const bool opens = isPressedTwice(item);
  const SliderValue found = valueAt(type, value);
  if (opens) {
    const SliderValue before = {kept.GetInt(first), kept.GetInt(second)};
    std::memcpy(value, before.data(), ImGui::DataTypeGetInfo(type)->Size);
  }
  const SliderValue now = valueAt(type, value);
  const bool put_back = now != found;
  if (put_back) kept.SetInt(putBackId(), ImGui::GetFrameCount());
  // Dear ImGui's own knob lies over the words.
  ImGui::PushStyleColor(ImGuiCol_SliderGrab, ImU32{0});
  ImGui::PushStyleColor(ImGuiCol_SliderGrabActive, ImU32{0});
  // With Ctrl a click opens the field of a slider; that of a number that is dragged opens at two.
  bool& control = ImGui::GetIO().KeyCtrl;
  const bool held = std::exchange(control, control || opens);
  const bool changed = ImGui::SliderScalar(id, type, value, low, high, format, flags) || put_back;
  control = held;
  if (ImGui::IsItemActivated()) {
    kept.SetInt(first, now[0]);
    kept.SetInt(second, now[1]);
  }
  ImGui::PopStyleColor(2);
  const ImRect frame(ImGui::GetItemRectMin(), ImGui::GetItemRectMax());
  ImRect knob(frame.Min, frame.Min);
  ImGui::SliderBehavior(frame, ImGui::GetID("knob"), type, value, low, high, format, flags, &knob);  // held by nobody
  const ImU32 color = ImGui::GetColorU32(ImGui::IsItemActive() ? ImGuiCol_SliderGrabActive : ImGuiCol_SliderGrab);
  const float thick = ImGui::GetStyle().FramePadding.y, inset = ImGui::GetStyle().FrameRounding / 2;
  ImDrawList* draw = ImGui::GetWindowDrawList();
  draw->AddRectFilled({frame.Min.x + inset, frame.Max.y - thick}, {knob.GetCenter().x, frame.Max.y}, color, thick / 2);
  draw->AddRectFilled({knob.Min.x, frame.Max.y - thick}, {knob.Max.x, frame.Max.y},
                      ImGui::GetColorU32(ImGuiCol_CheckMark), thick / 2);
  return changed;
}

bool sliderIsPutBack() {
  const ImGuiContext& context = *ImGui::GetCurrentContext();
  return context.ActiveIdWindow && context.ActiveIdWindow->StateStorage.GetInt(putBackId(), -1) == context.FrameCount;
}

bool slider(const char* id, float& value, float low, float high, const char* format, ImGuiSliderFlags flags) {
  return slider(id, ImGuiDataType_Float, &value, &low, &high, format, flags);
}

bool vectorField(const char* id, glm::vec3& value, float speed, const char* format) {
  const ImGuiID before = ImHashStr("before", 0, ImGui::GetID(id));
  ImGuiStorage& kept = *ImGui::GetStateStorage();
  glm::vec3 now = value;
  ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
  const bool changed = ImGui::DragFloat3(id, &now.x, speed, 0, 0, format);
  for (glm::length_t i = 0; i < 3; ++i) {
    const ImGuiID place = before + static_cast<ImGuiID>(i);
    if (ImGui::IsItemActivated()) kept.SetFloat(place, value[i]);
    if (changed) value[i] = std::isfinite(now[i]) ? now[i] : kept.GetFloat(place);
  }
  return changed;
}

bool textField(const char* id, std::string& text, const char* placeholder) {
  const auto grow = [](ImGuiInputTextCallbackData* data) {
    auto* string = static_cast<std::string*>(data->UserData);
    if (data->EventFlag == ImGuiInputTextFlags_CallbackResize) {
      string->resize(static_cast<std::size_t>(data->BufTextLen));
      data->Buf = string->data();
    }
    return 0;
  };
  return ImGui::InputTextWithHint(id, placeholder, text.data(), text.capacity() + 1, ImGuiInputTextFlags_CallbackResize,
                                  grow, &text);
}

void clippedText(ImVec2 corner, float room, ImU32 color, const std::string& text) {
  if (room <= 0) return;
  ImDrawList* draw = ImGui::GetWindowDrawList();
  draw->PushClipRect(corner, {corner.x + room, corner.y + ImGui::GetTextLineHeightWithSpacing()}, true);
  draw->AddText(corner, color, text.c_str());
  draw->PopClipRect();
}

std::string cutMiddle(const std::string& text, float room) {
  if (ImGui::CalcTextSize(text.c_str()).x <= room) return text;
  const auto begins = [&](std::size_t at) { return (static_cast<unsigned char>(text[at]) & 0xC0) != 0x80; };  // of UTF-8
  std::string cut = "...";
  std::size_t left = 0, right = text.size();
  while (left < right) {
    // A letter of the longer end less.
    std::size_t next_left = left + 1, next_right = right - 1;
    while (next_left < right && !begins(next_left)) ++next_left;
    while (next_right > left && !begins(next_right)) --next_right;
    const bool from_left = left <= text.size() - right;
    (from_left ? left : right) = from_left ? next_left : next_right;
    const std::string wider = text.substr(0, left) + "..." + text.substr(right);
    if (ImGui::CalcTextSize(wider.c_str()).x > room) break;
    cut = wider;
  }
  return cut;
}

void pushTabStop(bool stops) {
#if IMGUI_VERSION_NUM < 18940
  ImGui::PushAllowKeyboardFocus(stops);
#else
  ImGui::PushTabStop(stops);
#endif
}

void popTabStop() {
#if IMGUI_VERSION_NUM < 18940
  ImGui::PopAllowKeyboardFocus();
#else
  ImGui::PopTabStop();
#endif
}

bool enterPressed() {
#if IMGUI_VERSION_NUM < 18700
  constexpr ImGuiKey kOnKeypad = ImGuiKey_KeyPadEnter;
#else
  constexpr ImGuiKey kOnKeypad = ImGuiKey_KeypadEnter;
#endif
  return ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Enter)) ||
         ImGui::IsKeyPressed(ImGui::GetKeyIndex(kOnKeypad));
}

std::string grouped(std::size_t value) {
  std::string digits = std::to_string(value);
  for (std::ptrdiff_t i = static_cast<std::ptrdiff_t>(digits.size()) - 3; i > 0; i -= 3) {
    digits.insert(static_cast<std::size_t>(i), 1, ' ');
  }
  return digits;
}

}  // namespace tg
