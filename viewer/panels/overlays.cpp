// SPDX-License-Identifier: Apache-2.0
// Over the picture: the help, errors, and lines that fade.
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include "core/system/error.h"
#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"
#include "viewer/view/actions.h"
#include "viewer/view/legend.h"

namespace tg {
namespace {

// Of a size that is known, and no target of the pointer.
constexpr ImGuiWindowFlags kPassive = (kOverlay & ~ImGuiWindowFlags_AlwaysAutoResize) | ImGuiWindowFlags_NoInputs |
                                      ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoFocusOnAppearing;

// The middle of what the panel leaves of the picture.
ImVec2 pictureCenter(const ViewerState& state) {
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const float left = panelWidth(state, size.x);
  return {left + (size.x - left) / 2, size.y / 2};
}

// `room` [ImGui units]: that the text is wrapped to; 0: as wide as it is.
void helpRow(const char* keys, const char* text, float room) {
  ImGui::TableNextColumn();
  ImGui::TextColored(kHighlightText, "%s", keys);
  ImGui::TableNextColumn();
  ImGui::PushTextWrapPos(room > 0 ? ImGui::GetCursorPosX() + room : -1.0f);
  ImGui::TextUnformatted(text);
  ImGui::PopTextWrapPos();
}

constexpr float kLeastLetters = 0.85f;  // [font heights] that can be read: 11 of 13 px, more on finer screens
const ImVec2 kHelpPadding(6, 1);  // [ImGui units] beside and above a cell

// Columns of `rows` lines, in letters of full size, with the window around them.
ImVec2 helpSize(const std::vector<HelpLine>& lines, std::size_t rows) {
  float width = 0;
  for (std::size_t begin = 0; begin < lines.size(); begin += rows) {
    float keys = 0, text = 0;
    for (std::size_t i = begin; i < std::min(begin + rows, lines.size()); ++i) {
      keys = std::max(keys, ImGui::CalcTextSize(lines[i].keys).x);
      text = std::max(text, ImGui::CalcTextSize(lines[i].text).x);
    }
    width += keys + text + 4 * kHelpPadding.x;
  }
  const ImVec2 around = ImGui::GetStyle().WindowPadding;
  const float height = (ImGui::GetFontSize() + 2 * kHelpPadding.y) * static_cast<float>(rows + 1);
  return {width + 2 * around.x, height + 2 * around.y + ImGui::GetStyle().ItemSpacing.y};
}

void help(ViewerState& state) {
  std::vector<HelpLine> lines(mouseHelp().begin(), mouseHelp().end());
  for (const KeyBinding& binding : keyBindings()) {
    if (*binding.keys) lines.push_back({binding.keys, binding.text});
  }
  lines.push_back({"Drop a file", "Open a model, cameras or a path"});
  // As many columns as leave the letters largest. Beside the panel where there is room, else over it; in smaller
  // letters where even the window is too small, and where they could not be read it scrolls.
  const ImVec2 window = ImGui::GetIO().DisplaySize;
  std::size_t columns = 0, rows = 0;
  ImVec2 size;
  float scale = 0, room = 0;
  for (std::size_t i = 2; i <= 4; ++i) {
    const std::size_t of_each = (lines.size() + i - 1) / i;
    const ImVec2 needed = helpSize(lines, of_each);
    const float fits = std::min({1.0f, window.x / needed.x, window.y / needed.y});
    if (fits <= scale) continue;
    columns = i;
    rows = of_each;
    size = needed;
    scale = fits;
  }
  if (scale < kLeastLetters) {
    scale = kLeastLetters;
    const float bar = ImGui::GetStyle().ScrollbarSize;
    for (columns = 4;; --columns) {
      rows = (lines.size() + columns - 1) / columns;
      size = helpSize(lines, rows);
      if (columns == 1 || size.x * scale + bar <= window.x) break;
    }
    if (const float beyond = size.x * scale + bar - window.x; beyond > 0) {
      float text = 0;
      for (const HelpLine& line : lines) text = std::max(text, ImGui::CalcTextSize(line.text).x);
      // The window's padding is not scaled.
      const float padding = 2 * (1 - scale) * ImGui::GetStyle().WindowPadding.x;
      room = std::max(text * scale - beyond - padding, ImGui::GetFontSize());
    }
  }
  ImGui::SetNextWindowSizeConstraints({0, 0}, window);
  const bool beside = panelWidth(state, window.x) + size.x <= window.x;
  const ImVec2 center = beside ? pictureCenter(state) : ImVec2(window.x / 2, window.y / 2);
  ImGui::SetNextWindowPos(center, ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowBgAlpha(0.94f);
  ImGui::Begin("help", nullptr, kOverlay);
  ImGui::SetWindowFontScale(scale);
  state.ui.help_scrolls = ImGui::GetScrollMaxY() > ImGui::GetTextLineHeight();  // not for what rounding takes
  const float page = ImGui::GetWindowHeight() - 2 * ImGui::GetFrameHeight();  // some lines stay in view
  const int pages = std::exchange(state.ui.help_pages, 0);
  if (pages != 0) ImGui::SetScrollY(ImGui::GetScrollY() + static_cast<float>(pages) * page);
  ImGui::TextDisabled("KEYS AND MOUSE");
  ImGui::SameLine();
  if (ImGui::SmallButton("Close")) state.ui.help = false;  // in a small window it covers what opened it
  // Each column is read downwards.
  ImGui::PushStyleVar(ImGuiStyleVar_CellPadding, {kHelpPadding.x * scale, kHelpPadding.y * scale});
  if (ImGui::BeginTable("keys", static_cast<int>(2 * columns), ImGuiTableFlags_SizingFixedFit)) {
    for (std::size_t row = 0; row < rows; ++row) {
      ImGui::TableNextRow();
      for (std::size_t i = row; i < lines.size(); i += rows) helpRow(lines[i].keys, lines[i].text, room);
    }
    ImGui::EndTable();
  }
  ImGui::PopStyleVar();
  ImGui::End();
}

void errorPanel(ViewerState& state) {
  const ImVec2 center = pictureCenter(state), padding = ImGui::GetStyle().WindowPadding;
  const float room = 2 * (ImGui::GetIO().DisplaySize.x - center.x - padding.x);
  ImGui::SetNextWindowPos(center, ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::Begin("error", nullptr, kOverlay);
  ImGui::TextColored(kErrorText, "This did not work");
  ImGui::PushTextWrapPos(padding.x + std::clamp(room, 1.0f, ImGui::GetFontSize() * 32));
  ImGui::TextUnformatted(state.messages.error.c_str());
  ImGui::PopTextWrapPos();
  if (ImGui::Button("Close")) state.messages.error.clear();
  ImGui::End();
}

// Until the file is read again, or the one that was read is preferred.
void rewritten(ViewerState& state, Document& document) {
  const float font = ImGui::GetFontSize();
  ImGui::SetNextWindowPos({pictureCenter(state).x, 2.5f * font}, ImGuiCond_Always, {0.5f, 0.0f});
  ImGui::SetNextWindowBgAlpha(0.9f);
  ImGui::Begin("rewritten", nullptr, kOverlay);
  const float room = 2 * (ImGui::GetIO().DisplaySize.x - pictureCenter(state).x - 2 * font);
  ImGui::TextUnformatted(
      cutMiddle(printable(document.path.filename().string()) + " has been written again", std::max(room, font))
          .c_str());
  if (ImGui::Button("Read it again")) readAgain(state);
  ImGui::SameLine();
  if (ImGui::Button("Keep this one")) document.rewritten = false;
  ImGui::End();
}

// In the middle while --follow has no model yet.
void waiting(const ViewerState& state) {
  ImGui::SetNextWindowPos(pictureCenter(state), ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::Begin("waiting", nullptr, kOverlay);
  ImGui::PushTextWrapPos(ImGui::GetFontSize() * 32);
  ImGui::TextUnformatted(state.follow.problem.c_str());
  ImGui::PopTextWrapPos();
  ImGui::End();
}

// A window for a bar, `above` [font heights] the lower end of the picture, where notices are.
void beginProgress(const ViewerState& state, const char* id, float above) {
  const ImVec2 center = pictureCenter(state);
  const float font = ImGui::GetFontSize();
  ImGui::SetNextWindowPos({center.x, ImGui::GetIO().DisplaySize.y - above * font}, ImGuiCond_Always, {0.5f, 1.0f});
  ImGui::SetNextWindowSize({std::min(22 * font, 2 * (ImGui::GetIO().DisplaySize.x - center.x)), 0});
  ImGui::SetNextWindowBgAlpha(0.9f);
  ImGui::Begin(id, nullptr, kPassive);
}

// How far a recording is, whatever page is shown.
void recording(const ViewerState& state) {
  const RecordState& record = state.record;
  beginProgress(state, "recording", 7.5f);
  const char* words = record.waits ? "waits, Shift+R cancels" : "Shift+R cancels";
  const float room = ImGui::GetContentRegionAvail().x - ImGui::CalcTextSize(words).x - ImGui::GetFontSize();
  ImGui::TextUnformatted(cutMiddle("Recording " + printable(record.out.string()), room).c_str());
  ImGui::SameLine();
  ImGui::TextDisabled("%s", words);
  const float share = record.frames > 0 ? static_cast<float>(record.done) / static_cast<float>(record.frames) : 0.0f;
  const std::string text = "frame " + std::to_string(record.done) + " of " + std::to_string(record.frames);
  ImGui::ProgressBar(share, {-1, 0}, record.frames > 0 ? text.c_str() : "begins");
  ImGui::End();
}

// What is being read.
void progress(const ViewerState& state) {
  const LoadState& loading = state.loading;
  beginProgress(state, "loading", 3.5f);
  ImGui::TextUnformatted(printable(loading.path.filename().string()).c_str());
  ImGui::SameLine();
  if (loading.waiting > 0) {
    ImGui::TextDisabled("and %zu more, Esc stops", loading.waiting);
  } else {
    ImGui::TextDisabled("Esc stops");
  }
  const double done = static_cast<double>(loading.done) / 1e6, total = static_cast<double>(loading.total) / 1e6;
  char text[64];
  std::snprintf(text, sizeof text, "%.0f of %.0f MB", done, total);
  const float share = total > 0 ? static_cast<float>(done / total) : 0.0f;
  ImGui::ProgressBar(share, {-1, 0}, total > 0 ? (share < 1 ? text : "preparing") : "opening");
  ImGui::End();
}

// Where a model would be: the ways to open one.
void welcome(ViewerState& state) {
  const float font = ImGui::GetFontSize(), window = ImGui::GetIO().DisplaySize.x,
              room = window - panelWidth(state, window);
  const float width = std::min(30 * font, room - 2 * font);
  constexpr std::size_t kMostRecent = 10;
  ImGui::SetNextWindowPos(pictureCenter(state), ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowBgAlpha(0.0f);
  ImGui::Begin("welcome", nullptr, kOverlay | ImGuiWindowFlags_NoBringToFrontOnFocus);
  const char* words = "Drop a model here";
  ImGui::SetCursorPosX(ImGui::GetCursorPosX() + std::max((width - ImGui::CalcTextSize(words).x) / 2, 0.0f));
  ImGui::TextDisabled("%s", words);
  ImGui::Dummy({0, font * 0.3f});
  ImGui::SetCursorPosX(ImGui::GetCursorPosX() + std::max((width - 10 * font) / 2, 0.0f));
  if (ImGui::Button("Open", {10 * font, 0})) state.desktop.wanted = FileUse::open;
  hint("Ctrl+O");
  if (!state.recent.empty()) heading("RECENT");
  for (std::size_t i = 0; i < std::min(state.recent.size(), kMostRecent); ++i) {
    const std::filesystem::path path = state.recent[i];
    ImGui::PushID(static_cast<int>(i));
    const ImVec2 corner = ImGui::GetCursorScreenPos();
    if (ImGui::Selectable("##recent", false, 0, {width, 0})) state.documents.open_requests.push_back(path);
    hint(printable(path.string()).c_str());
    // The name, and as much of its folder as there is room for.
    ImGui::PopID();
    const std::string name = printable(path.filename().string()), folder = printable(path.parent_path().string());
    const float begin = ImGui::CalcTextSize(name.c_str()).x + font, rest = width - begin;
    clippedText(corner, width, ImGui::GetColorU32(ImGuiCol_Text), cutMiddle(name, width));
    clippedText({corner.x + begin, corner.y}, rest, ImGui::GetColorU32(ImGuiCol_TextDisabled), cutMiddle(folder, rest));
  }
  ImGui::End();
}

// The line of a wipe, and what lies on either side.
void comparison(const ViewerState& state) {
  const Comparison& how = state.compare.how;
  if (how.mode == CompareMode::off || !state.compare.problem.empty() || state.record.draws()) return;
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const float left = panelWidth(state, size.x), width = size.x - left, font = ImGui::GetFontSize();
  const int document = otherDocument(state);
  const std::string first = state.scene.path.filename().string();
  const std::string other = state.compare.with_photographs ? state.compare.photograph
                            : document >= 0
                                ? state.documents.open[static_cast<std::size_t>(document)].path.filename().string()
                                : "";
  ImDrawList* draw = ImGui::GetBackgroundDrawList();
  // In the middle of what is seen between two shares of the picture's width.
  const auto label = [&](float from, float to, const std::string& whole) {
    const float room = (to - from) * width, x = left + (from + to) / 2 * width;
    if (room <= 3 * font) return;
    const std::string text = cutMiddle(whole, room - 2 * font);
    const ImVec2 extent = ImGui::CalcTextSize(text.c_str());
    const ImVec2 corner(x - extent.x / 2, font * 0.6f);
    draw->AddRectFilled({corner.x - font * 0.5f, corner.y - font * 0.2f},
                        {corner.x + extent.x + font * 0.5f, corner.y + extent.y + font * 0.2f},
                        IM_COL32(27, 30, 35, 200), font * 0.3f);
    draw->AddText(corner, ImGui::GetColorU32(ImGuiCol_Text), text.c_str());
  };
  const float divider = how.mode == CompareMode::side ? 0.5f : how.divider;
  switch (how.mode) {
    case CompareMode::side:
    case CompareMode::wipe: {
      const float x = std::round(left + divider * width);
      draw->AddLine({x, 0}, {x, size.y}, IM_COL32(255, 255, 255, 200), 1.0f);
      if (divider > 0.1f) label(0, divider, first);
      if (divider < 0.9f) label(divider, 1, other);
      break;
    }
    case CompareMode::flicker:
      label(0, 1, how.shows_other ? other : first);
      break;
    case CompareMode::flip:
      label(0, 1, "FLIP of " + first + " against " + other);
      break;
    default:
      label(0, 1, how.with_sign ? other + " - " + first : "|" + other + " - " + first + "|");
      break;
  }
}

// In the half that stays empty: why there is no picture beside the model's.
void noComparison(const ViewerState& state) {
  const CompareState& compare = state.compare;
  const bool empty = compare.how.mode == CompareMode::side && !compare.problem.empty() && !state.record.draws();
  if (!empty || !state.scene.model) return;
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const float left = panelWidth(state, size.x), font = ImGui::GetFontSize();
  const float begin = left + (size.x - left) / 2, room = size.x - begin - 2 * font;
  if (room <= 3 * font) return;
  const std::string words = compare.problem + (compare.way_out.empty() ? "" : "\n") + compare.way_out;
  const char* text = words.c_str();
  const ImVec2 extent = ImGui::CalcTextSize(text, nullptr, false, room);
  ImGui::GetBackgroundDrawList()->AddText(ImGui::GetFont(), font,
                                          {begin + font + (room - extent.x) / 2, (size.y - extent.y) / 2},
                                          ImGui::GetColorU32(kWarningText), text, nullptr, room);
}

// In the lower left corner of the picture, as --legend draws it.
void legend(const ViewerState& state) {
  const DisplayState& display = state.display;
  const bool error = hasLegend(state.compare.how.mode) && !state.record.draws();
  // The picture on screen may be of the output before.
  const bool scaled = display.scale && display.scaled == display.output;
  if (error ? !state.compare.problem.empty() : kNumberOutputs.has(display.output) && !scaled) return;
  const std::optional<Legend> legend =
      error ? legendOf(state.compare.how)
            : legendOf(display.output, display.settings, display.scale.value_or(ValueScale{}));
  if (!legend) return;
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const float font = ImGui::GetFontSize(), pad = font * 0.5f;
  const float width = std::max(11 * font, ImGui::CalcTextSize(legend->title.c_str()).x);
  const ImVec2 corner(panelWidth(state, size.x) + font, size.y - 4.8f * font);
  if (corner.x + width + 2 * pad > size.x) return;
  ImDrawList* draw = ImGui::GetBackgroundDrawList();
  draw->AddRectFilled(corner, {corner.x + width + 2 * pad, size.y - font}, IM_COL32(27, 30, 35, 215), font * 0.3f);
  const ImU32 ink = ImGui::GetColorU32(ImGuiCol_Text);
  draw->AddText({corner.x + pad, corner.y + 0.3f * font}, ink, legend->title.c_str());
  const float left = corner.x + pad, top = corner.y + 1.5f * font, bottom = top + 0.8f * font;
  constexpr int kSteps = 64;
  for (int i = 0; i < kSteps; ++i) {
    const glm::vec3 color = legend->color((static_cast<float>(i) + 0.5f) / kSteps);
    const float from = std::floor(left + width * static_cast<float>(i) / kSteps);
    const float to = std::floor(left + width * static_cast<float>(i + 1) / kSteps);
    draw->AddRectFilled({from, top}, {to, bottom}, ImGui::ColorConvertFloat4ToU32({color.x, color.y, color.z, 1}));
  }
  for (int i = 0; i < 3; ++i) {
    const std::string& number = legend->numbers[static_cast<std::size_t>(i)];
    const float x = left + (width - ImGui::CalcTextSize(number.c_str()).x) * static_cast<float>(i) / 2;
    draw->AddText({x, bottom + 0.2f * font}, ink, number.c_str());
  }
}

void notice(const ViewerState& state) {
  const ImVec2 center = pictureCenter(state);
  const ImVec2 padding = ImGui::GetStyle().WindowPadding;
  // Whole paths may be wider than the picture.
  const float room = 2 * (ImGui::GetIO().DisplaySize.x - center.x - padding.x - ImGui::GetFontSize());
  const ImVec2 text = ImGui::CalcTextSize(state.messages.notice.c_str(), nullptr, false, std::max(room, 1.0f));
  ImGui::SetNextWindowPos({center.x, ImGui::GetIO().DisplaySize.y - ImGui::GetFontSize()}, ImGuiCond_Always,
                          {0.5f, 1.0f});
  ImGui::SetNextWindowSize({text.x + 2 * padding.x, text.y + 2 * padding.y});  // auto-sizing lags by a frame
  ImGui::SetNextWindowBgAlpha(0.85f);
  ImGui::Begin("notice", nullptr, kPassive);
  ImGui::PushTextWrapPos(padding.x + std::max(room, 1.0f));
  ImGui::TextUnformatted(state.messages.notice.c_str());
  ImGui::PopTextWrapPos();
  ImGui::End();
}

}  // namespace

void overlays(ViewerState& state) {
  if (state.ui.help) help(state);
  if (state.follow.active && state.follow.reloads == 0 && !state.follow.problem.empty()) waiting(state);
  if (state.ui.panel) comparison(state);
  noComparison(state);
  if (state.ui.panel && state.scene.model) legend(state);
  if (!state.scene.model && !state.loading.active && !state.follow.active) welcome(state);
  if (state.loading.active) progress(state);
  if (state.documents.shown >= 0 && !state.loading.active) {
    Document& document = state.documents.open[static_cast<std::size_t>(state.documents.shown)];
    if (document.rewritten) rewritten(state, document);
  }
  if (state.record.wanted) recording(state);
  if (!state.messages.error.empty()) errorPanel(state);
  if (state.time < state.messages.notice_until) notice(state);
}

}  // namespace tg
