// SPDX-License-Identifier: Apache-2.0
// The panel beside the picture, the help, and messages over the picture.
#include "viewer/panels.h"

#include <imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace tg {
namespace {

constexpr float kPanelFonts = 21;   // panel width in font heights
constexpr float kNarrowFonts = 46;  // windows below this: the panel lies over the picture
constexpr double kDegrees = 3.14159265358979323846 / 180.0;

const ImVec4 kAccent(0.184f, 0.435f, 0.624f, 1.0f);
const ImVec4 kAccentHovered(0.231f, 0.506f, 0.710f, 1.0f);
const ImVec4 kErrorText(0.98f, 0.52f, 0.47f, 1.0f);
const ImVec4 kWarningText(0.93f, 0.77f, 0.42f, 1.0f);
const ImVec4 kFollowText(0.455f, 0.714f, 0.894f, 1.0f);

void heading(const char* text) {
  ImGui::Dummy({0, ImGui::GetFontSize() * 0.25f});
  ImGui::TextDisabled("%s", text);
}

void hint(const char* text) {
  if (ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled)) ImGui::SetTooltip("%s", text);
}

// One of `count` buttons that share a row, the active one coloured. True when clicked.
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
  const bool clicked = ImGui::Button(label, {width, 0});
  if (active) ImGui::PopStyleColor(3);
  return clicked;
}

std::string grouped(std::size_t value) {
  std::string digits = std::to_string(value);
  for (std::ptrdiff_t i = static_cast<std::ptrdiff_t>(digits.size()) - 3; i > 0; i -= 3) {
    digits.insert(static_cast<std::size_t>(i), 1, ' ');
  }
  return digits;
}

void modelSection(ViewerState& state) {
  const Scene& scene = state.scene;
  const char* keys = "Keys ?";
  const float button = ImGui::CalcTextSize(keys).x + 2 * ImGui::GetStyle().FramePadding.x;
  const float right = ImGui::GetContentRegionMax().x - button;
  const ImVec2 clip = ImGui::GetCursorScreenPos();
  ImGui::PushClipRect(clip, {clip.x + right - ImGui::GetFontSize(), clip.y + ImGui::GetFrameHeight()}, true);
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted(scene.path.filename().string().c_str());
  ImGui::PopClipRect();
  hint(scene.path.string().c_str());
  ImGui::SameLine(right);
  if (ImGui::Button(keys)) apply(state, Action::toggleHelp);
  hint("Keys and mouse; H hides this panel");
  ImGui::TextDisabled("%s Gaussians, SH degree %d", grouped(scene.gaussians).c_str(), scene.sh_degree);
  if (scene.textured > 0) {
    ImGui::TextDisabled("%s textured (%s), %s texels", grouped(scene.textured).c_str(),
                        std::string(name(scene.texture_mode)).c_str(), grouped(scene.texels).c_str());
  } else {
    ImGui::TextDisabled("no textures");
  }
  if (!scene.training.empty()) ImGui::TextDisabled("%s", scene.training.c_str());
  if (state.following) {
    ImGui::PushStyleColor(ImGuiCol_Text, state.follow_problem.empty() ? kFollowText : kWarningText);
    ImGui::TextWrapped("%s", state.follow_problem.empty() ? "following the file" : state.follow_problem.c_str());
    ImGui::PopStyleColor();
  }
  if (!scene.warnings.empty()) {
    ImGui::PushStyleColor(ImGuiCol_Text, kWarningText);
    const bool open = ImGui::TreeNode("warnings", "%zu warning%s in this file", scene.warnings.size(),
                                      scene.warnings.size() == 1 ? "" : "s");
    ImGui::PopStyleColor();
    if (open) {
      for (const std::string& warning : scene.warnings) ImGui::TextWrapped("%s", warning.c_str());
      ImGui::TreePop();
    }
  }
}

void outputSection(ViewerState& state) {
  struct Choice {
    const char* label;
    const char* hint;
  };
  constexpr std::array<Choice, 7> choices = {{
      {"Final", "Base + texture + background"},
      {"Base", "Spherical harmonics alone, with the background"},
      {"Texture", "What the textures add to the colour; mid grey = nothing"},
      {"Alpha", "Coverage; black = the background shows"},
      {"Depth", "Near is bright, scaled to this picture; black = nothing hit"},
      {"Normal", "Shortest axis: red = right, green = up, blue = towards you"},
      {"Splats", "Blended splats per pixel; white = the most in this picture"},
  }};
  heading("SHOW");
  for (int i = 0; i < static_cast<int>(choices.size()); ++i) {
    const int row_start = i < 3 ? 0 : 3, row_count = i < 3 ? 3 : 4;
    if (segment(choices[i].label, static_cast<int>(state.output) == i, i - row_start, row_count)) {
      state.output = static_cast<Output>(i);
    }
    hint(choices[i].hint);
  }
}

void textureSection(ViewerState& state) {
  constexpr std::array<std::pair<const char*, TextureMode>, 4> choices = {{
      {"Off", TextureMode::none},
      {"Alpha", TextureMode::alpha},
      {"RGB", TextureMode::rgb},
      {"RGBA", TextureMode::rgba},
  }};
  heading("TEXTURES");
  ImGui::BeginDisabled(state.scene.textured == 0);
  const TextureMode shown = effectiveSettings(state).textures;
  for (int i = 0; i < static_cast<int>(choices.size()); ++i) {
    if (segment(choices[i].first, shown == choices[i].second, i, static_cast<int>(choices.size()))) {
      state.settings.textures = choices[i].second;
    }
    hint("T steps through these; hold Tab to compare with none");
  }
  ImGui::EndDisabled();
  heading("INTERSECTION");
  const IntersectionModel current = state.settings.intersection.value_or(state.scene.intersection);
  const auto choose = [&](const char* label, IntersectionModel model, int index) {
    if (segment(label, current == model, index, 2)) state.settings.intersection = model;
    hint(model == state.scene.intersection ? "What the model was trained with" : "Not what the model was trained with");
  };
  choose("Plane", IntersectionModel::plane, 0);
  choose("Max response", IntersectionModel::maxResponse, 1);
}

bool escapePressed() { return ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape)); }

std::string cameraLabel(const Camera& camera, int index) {
  std::string label = std::to_string(index);
  if (!camera.name.empty()) label += "  " + camera.name;
  if (camera.test) label += "  (test)";
  return label;
}

void cameraList(ViewerState& state) {
  const std::vector<Camera>& cameras = state.scene.cameras;
  const std::string preview = state.camera >= 0 ? cameraLabel(cameras[state.camera], state.camera) : "free";
  const float button = ImGui::GetFrameHeight();
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x - 2 * (button + spacing));
  if (ImGui::BeginCombo("##camera", preview.c_str(), ImGuiComboFlags_HeightLarge)) {
    if (escapePressed()) ImGui::CloseCurrentPopup();
    ImGuiListClipper clipper;
    clipper.Begin(static_cast<int>(cameras.size()));
    while (clipper.Step()) {
      for (int i = clipper.DisplayStart; i < clipper.DisplayEnd; ++i) {
        ImGui::PushID(i);
        if (ImGui::Selectable(cameraLabel(cameras[i], i).c_str(), i == state.camera)) goToCamera(state, i);
        ImGui::PopID();
      }
    }
    ImGui::EndCombo();
  }
  ImGui::SameLine(0, spacing);
  if (ImGui::ArrowButton("##previous", ImGuiDir_Left)) apply(state, Action::previousCamera);
  hint("Previous camera (Shift+Space)");
  ImGui::SameLine(0, spacing);
  if (ImGui::ArrowButton("##next", ImGuiDir_Right)) apply(state, Action::nextCamera);
  hint("Next camera (Space)");
}

void cameraSection(ViewerState& state) {
  heading("CAMERA");
  if (state.scene.cameras.empty())
    ImGui::TextDisabled("The model has no cameras");
  else
    cameraList(state);
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  const float half = (ImGui::GetContentRegionAvail().x - spacing) / 2;
  ImGui::SetNextItemWidth(half);
  auto degrees = static_cast<float>(state.lens.fov_y / kDegrees);
  if (ImGui::SliderFloat("##lens", &degrees, 5.0f, 140.0f, "Lens %.1f\xc2\xb0", ImGuiSliderFlags_AlwaysClamp)) {
    state.lens.fov_y = degrees * kDegrees;
    state.camera = -1;
  }
  hint("Vertical field of view (Ctrl+wheel)");
  ImGui::SameLine(0, spacing);
  ImGui::SetNextItemWidth(half);
  auto speed = static_cast<float>(state.speed);
  if (ImGui::SliderFloat("##speed", &speed, 0.02f, 20.0f, "Speed %.2f",
                         ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp)) {
    state.speed = speed;
  }
  hint("Of flying, in scene radii per second; Shift 4 x, Ctrl 1/4");
  if (segment("Frame", false, 0, 3)) apply(state, Action::frameScene);
  hint("The whole model in view (F)");
  if (segment("Reset", false, 1, 3)) apply(state, Action::resetView);
  hint("The first view (Shift+F)");
  if (segment("Save", false, 2, 3)) apply(state, Action::saveCamera);
  hint("This camera as JSON, for --camera (C)");
}

void backgroundSection(ViewerState& state) {
  heading("BACKGROUND");
  glm::vec3& color = state.settings.background;
  ImGui::ColorEdit3("##background", &color.x, ImGuiColorEditFlags_NoInputs);
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  ImGui::SameLine(0, spacing);
  if (segment("Black", color == glm::vec3(0.0f), 0, 3)) color = glm::vec3(0.0f);
  if (segment("White", color == glm::vec3(1.0f), 1, 3)) color = glm::vec3(1.0f);
  if (segment("Model's", color == state.scene.background, 2, 3)) color = state.scene.background;
  hint("What the model was trained against");
}

// A bar of the cell's width.
void shareBar(double share) {
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const float width = ImGui::GetContentRegionAvail().x;
  const float line = ImGui::GetTextLineHeight();
  ImDrawList* draw = ImGui::GetWindowDrawList();
  const auto bar = [&](float length, ImU32 color) {
    draw->AddRectFilled({corner.x, corner.y + line * 0.32f}, {corner.x + length, corner.y + line * 0.78f}, color, 2);
  };
  bar(width, ImGui::GetColorU32(ImGuiCol_FrameBg));
  bar(std::max(1.0f, width * static_cast<float>(share)), ImGui::GetColorU32(ImGuiCol_PlotHistogram));
}

void timeSection(ViewerState& state, const FrameStatistics& statistics) {
  heading("TIME");
  if (!statistics.frame_ms.empty()) {
    const float last = statistics.frame_ms.back();
    const float worst = *std::max_element(statistics.frame_ms.begin(), statistics.frame_ms.end());
    ImGui::SameLine();
    ImGui::Text("%.1f ms, %.0f / s", last, last > 0 ? 1000.0f / last : 0.0f);
    ImGui::PlotLines("##frames", statistics.frame_ms.data(), static_cast<int>(statistics.frame_ms.size()), 0, nullptr,
                     0.0f, worst * 1.1f, {ImGui::GetContentRegionAvail().x, ImGui::GetFontSize() * 2});
    hint("Wall time of the last frames");
  }
  double sum = 0;
  for (const PassTime& pass : statistics.passes) sum += pass.milliseconds;
  ImGui::PushStyleVar(ImGuiStyleVar_CellPadding, {4, 1});
  if (ImGui::BeginTable("passes", 3, ImGuiTableFlags_SizingFixedFit)) {
    ImGui::TableSetupColumn("pass");
    ImGui::TableSetupColumn("ms");
    ImGui::TableSetupColumn("share", ImGuiTableColumnFlags_WidthStretch);
    for (const PassTime& pass : statistics.passes) {
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(pass.name.c_str());
      ImGui::TableNextColumn();
      ImGui::Text("%.2f ms", pass.milliseconds);
      ImGui::TableNextColumn();
      shareBar(sum > 0 ? pass.milliseconds / sum : 0);
    }
    ImGui::EndTable();
  }
  ImGui::PopStyleVar();
  ImGui::TextDisabled("sum %.2f ms at %d x %d%s", sum, statistics.picture_size.x, statistics.picture_size.y,
                      statistics.reduced ? ", moving" : "");
  ImGui::Checkbox("Draw without pause", &state.continuous);
  hint("Otherwise a frame is drawn only when something changes");
  ImGui::TextDisabled("%s", statistics.device.c_str());
}

void panel(ViewerState& state, const FrameStatistics& statistics) {
  const ImGuiIO& io = ImGui::GetIO();
  ImGui::SetNextWindowPos({0, 0});
  ImGui::SetNextWindowSize({kPanelFonts * ImGui::GetFontSize(), io.DisplaySize.y});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0.0f);
  ImGui::Begin("panel", nullptr,
               ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoBringToFrontOnFocus);
  ImGui::PopStyleVar();
  modelSection(state);
  outputSection(state);
  textureSection(state);
  cameraSection(state);
  backgroundSection(state);
  timeSection(state, statistics);
  ImGui::End();
}

constexpr ImGuiWindowFlags kOverlay = ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize |
                                      ImGuiWindowFlags_NoMove | ImGuiWindowFlags_AlwaysAutoResize |
                                      ImGuiWindowFlags_NoSavedSettings;

// The middle of the picture, which lies right of the panel.
ImVec2 pictureCenter(const ViewerState& state) {
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const float left = panelWidth(state, size.x);
  return {left + (size.x - left) / 2, size.y / 2};
}

void helpRow(const char* keys, const char* text) {
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::TextColored(ImVec4(0.455f, 0.714f, 0.894f, 1.0f), "%s", keys);
  ImGui::TableNextColumn();
  ImGui::TextUnformatted(text);
}

void help(ViewerState& state) {
  ImGui::SetNextWindowPos(pictureCenter(state), ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowBgAlpha(0.94f);
  ImGui::Begin("help", nullptr, kOverlay);
  ImGui::TextDisabled("KEYS AND MOUSE");
  if (ImGui::BeginTable("keys", 2, ImGuiTableFlags_SizingFixedFit)) {
    for (const HelpLine& line : mouseHelp()) helpRow(line.keys, line.text);
    for (const KeyBinding& binding : keyBindings()) {
      if (*binding.keys) helpRow(binding.keys, binding.text);
    }
    helpRow("Drop a file", "Open a model, or a cameras.json");
    ImGui::EndTable();
  }
  ImGui::End();
}

void errorPanel(ViewerState& state) {
  ImGui::SetNextWindowPos(pictureCenter(state), ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::Begin("error", nullptr, kOverlay);
  ImGui::TextColored(kErrorText, "This did not work");
  ImGui::PushTextWrapPos(ImGui::GetFontSize() * 32);
  ImGui::TextUnformatted(state.error.c_str());
  ImGui::PopTextWrapPos();
  ImGui::TextDisabled("The view is as it was.");
  if (ImGui::Button("Close")) state.error.clear();
  ImGui::End();
}

// In the middle while --follow has no model yet.
void waiting(const ViewerState& state) {
  ImGui::SetNextWindowPos(pictureCenter(state), ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::Begin("waiting", nullptr, kOverlay);
  ImGui::PushTextWrapPos(ImGui::GetFontSize() * 32);
  ImGui::TextUnformatted(state.follow_problem.c_str());
  ImGui::PopTextWrapPos();
  ImGui::End();
}

void notice(const ViewerState& state) {
  const ImVec2 center = pictureCenter(state);
  const ImVec2 text = ImGui::CalcTextSize(state.notice.c_str());
  const ImVec2 padding = ImGui::GetStyle().WindowPadding;
  ImGui::SetNextWindowPos({center.x, ImGui::GetIO().DisplaySize.y - ImGui::GetFontSize()}, ImGuiCond_Always,
                          {0.5f, 1.0f});
  ImGui::SetNextWindowSize({text.x + 2 * padding.x, text.y + 2 * padding.y});  // auto-sizing lags by a frame
  ImGui::SetNextWindowBgAlpha(0.85f);
  ImGui::Begin("notice", nullptr,
               (kOverlay & ~ImGuiWindowFlags_AlwaysAutoResize) | ImGuiWindowFlags_NoInputs |
                   ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoFocusOnAppearing);
  ImGui::TextUnformatted(state.notice.c_str());
  ImGui::End();
}

}  // namespace

float panelWidth(const ViewerState& state, float window_width) {
  const float font = ImGui::GetFontSize();
  return state.show_panel && window_width >= kNarrowFonts * font ? kPanelFonts * font : 0.0f;
}

bool popupIsOpen() { return ImGui::IsPopupOpen(nullptr, ImGuiPopupFlags_AnyPopupId | ImGuiPopupFlags_AnyPopupLevel); }

void drawPanels(ViewerState& state, const FrameStatistics& statistics) {
  if (state.show_panel) panel(state, statistics);
  if (state.show_help) help(state);
  if (state.following && state.reloads == 0 && !state.follow_problem.empty()) waiting(state);
  if (!state.error.empty()) errorPanel(state);
  if (state.time < state.notice_until) notice(state);
}

}  // namespace tg
