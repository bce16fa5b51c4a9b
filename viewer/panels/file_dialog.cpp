// SPDX-License-Identifier: Apache-2.0
// The dialog that asks for a file, and the question before something is lost.
#include <imgui.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/system/error.h"
#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"

namespace tg {
namespace {

constexpr ImGuiWindowFlags kDialogWindow = ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize |
                                           ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings;

const char* titleOf(FileUse use) {
  switch (use) {
    case FileUse::open:
      return "Open a model, cameras or a path";
    case FileUse::saveModel:
      return "Save the model as";
    case FileUse::savePicture:
      return "Save the picture as";
    case FileUse::savePath:
      return "Save the camera path as";
    case FileUse::saveBookmarks:
      return "Save the bookmarks as";
  }
  return "";
}

std::string sizeText(std::uint64_t bytes) {
  constexpr std::array units = {"B", "kB", "MB", "GB", "TB"};
  auto value = static_cast<double>(bytes);
  std::size_t unit = 0;
  for (; value >= 999.5 && unit + 1 < units.size(); ++unit) value /= 1000;
  char text[32];
  std::snprintf(text, sizeof text, unit > 0 && value < 9.95 ? "%.1f %s" : "%.0f %s", value, units[unit]);
  return text;
}

// What keys do while the name is typed: the widget's own copy of the text has to follow.
int onTyping(ImGuiInputTextCallbackData* data) {
  auto& browser = *static_cast<FileBrowser*>(data->UserData);
  const std::string before(data->Buf, static_cast<std::size_t>(data->BufTextLen));
  if (data->EventFlag == ImGuiInputTextFlags_CallbackEdit) {
    browser.text = before;
    filterFiles(browser);
  } else if (data->EventFlag == ImGuiInputTextFlags_CallbackCompletion) {
    completeFileName(browser);
  } else {
    pickFile(browser, data->EventKey == ImGuiKey_UpArrow ? -1 : 1);
  }
  if (browser.text == before) return 0;
  data->DeleteChars(0, data->BufTextLen);
  data->InsertChars(0, browser.text.c_str());
  return 0;
}

// True when Enter was pressed in it.
bool nameField(FileDialog& dialog) {
  FileBrowser& browser = dialog.browser;
  // It has the keyboard whenever nothing else does, a list that hangs from the dialog among it.
  const bool idle = !ImGui::IsAnyItemActive() &&
                    ImGui::IsWindowFocused(ImGuiFocusedFlags_RootAndChildWindows | ImGuiFocusedFlags_NoPopupHierarchy);
  if (dialog.fresh || idle) ImGui::SetKeyboardFocusHere();
  dialog.fresh = false;
  std::array<char, kMaxFileName> text{};
  browser.text.copy(text.data(), text.size() - 1);
  ImGui::SetNextItemWidth(-1);
  const char* hint = browser.saves ? "Name" : "Type to filter, or a path; Tab completes it";
  const bool entered = ImGui::InputTextWithHint(
      "##name", hint, text.data(), text.size(),
      ImGuiInputTextFlags_CallbackEdit | ImGuiInputTextFlags_CallbackCompletion | ImGuiInputTextFlags_CallbackHistory |
          ImGuiInputTextFlags_EnterReturnsTrue | ImGuiInputTextFlags_AutoSelectAll,
      onTyping, &browser);
  dialog.has_keyboard = dialog.has_keyboard || ImGui::IsItemActive();
  return entered;
}

void places(FileBrowser& browser) {
  if (ImGui::Button("Up")) leaveFolder(browser);
  hint("The folder that this one lies in (../)");
  ImGui::SameLine(0, ImGui::GetStyle().ItemInnerSpacing.x);
  const char* home = std::getenv("HOME");
  ImGui::BeginDisabled(!home || !*home);
  if (ImGui::Button("Home")) enterFolder(browser, home);
  ImGui::EndDisabled();
  hint("~/");
  ImGui::SameLine();
  ImGui::AlignTextToFramePadding();
  // The end of a long path says most.
  const std::string path = printable(browser.folder.string());
  const float room = ImGui::GetContentRegionAvail().x, width = ImGui::CalcTextSize(path.c_str()).x;
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  ImGui::PushClipRect(corner, {corner.x + room, corner.y + ImGui::GetFrameHeight()}, true);
  if (width > room) ImGui::SetCursorPosX(ImGui::GetCursorPosX() + room - width);
  ImGui::TextUnformatted(path.c_str());
  ImGui::PopClipRect();
  hint(path.c_str());
}

// True when a file was clicked twice.
bool fileRow(FileBrowser& browser, int row) {
  const FileEntry& entry = browser.entries[browser.shown[static_cast<std::size_t>(row)]];
  const bool folder = entry.folder;
  const std::string label = printable(entry.name) + (folder ? "/" : "");
  const std::string size = folder ? "" : sizeText(entry.bytes);
  const float width = ImGui::GetContentRegionAvail().x, size_width = ImGui::CalcTextSize(size.c_str()).x;
  const float room = size.empty() ? width : width - size_width - ImGui::GetFontSize();
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const bool clicked = ImGui::Selectable("##file", row == browser.picked, ImGuiSelectableFlags_AllowDoubleClick);
  if (ImGui::CalcTextSize(label.c_str()).x > room) hint(label.c_str());
  clippedText(corner, room, folder ? ImGui::GetColorU32(kHighlightText) : ImGui::GetColorU32(ImGuiCol_Text),
              cutMiddle(label, room));
  clippedText({corner.x + width - size_width, corner.y}, size_width, ImGui::GetColorU32(ImGuiCol_TextDisabled), size);
  if (!clicked) return false;
  browser.picked = -1;
  pickFile(browser, row + 1);
  return ImGui::IsMouseDoubleClicked(0);
}

// True when what is picked is chosen. `height` [ImGui units].
bool fileList(FileBrowser& browser, float height) {
  bool chosen = false;
  ImGui::BeginChild("files", {0, height}, true);
  if (!browser.problem.empty()) ImGui::TextColored(kWarningText, "%s", browser.problem.c_str());
  if (browser.problem.empty() && browser.shown.empty()) ImGui::TextDisabled("Nothing here that fits");
  ImGuiListClipper clipper;
  clipper.Begin(static_cast<int>(browser.shown.size()));
  const float row = ImGui::GetTextLineHeightWithSpacing();
  while (clipper.Step() && !chosen) {
    for (int i = clipper.DisplayStart; i < clipper.DisplayEnd && !chosen; ++i) {
      ImGui::PushID(i);
      chosen = fileRow(browser, i);
      ImGui::PopID();
    }
  }
  clipper.End();
  if (std::exchange(browser.scrolls, false)) {
    const float top = row * static_cast<float>(browser.picked);
    if (top < ImGui::GetScrollY()) ImGui::SetScrollY(top);
    if (top + 2 * row > ImGui::GetScrollY() + ImGui::GetWindowHeight()) {
      ImGui::SetScrollY(top + 2 * row - ImGui::GetWindowHeight());
    }
  }
  if (browser.more) ImGui::TextDisabled("and more: only %zu are listed", kMaxFolderEntries);
  ImGui::EndChild();
  return chosen;
}

void filters(FileBrowser& browser) {
  if (ImGui::Checkbox("Hidden", &browser.hidden)) filterFiles(browser);
  hint("Also names that begin with a dot");
  ImGui::SameLine();
  if (ImGui::Checkbox("All files", &browser.all_types)) filterFiles(browser);
  if (!browser.saves || browser.types.size() < 2) return;
  ImGui::SameLine();
  const FileType* type = fileType(browser);
  ImGui::SetNextItemWidth(ImGui::GetFontSize() * 9);
  if (ImGui::BeginCombo("##type", type ? type->extension.c_str() : "format", ImGuiComboFlags_HeightLarge)) {
    for (std::size_t i = 0; i < browser.types.size(); ++i) {
      if (ImGui::Selectable(browser.types[i].extension.c_str(), &browser.types[i] == type)) setFileType(browser, i);
      if (!browser.types[i].note.empty()) hint(browser.types[i].note.c_str());
    }
    ImGui::EndCombo();
  }
}

// True when the first of the two was clicked.
bool buttons(const char* yes, bool& cancelled) {
  const float width = ImGui::GetFontSize() * 6, spacing = ImGui::GetStyle().ItemSpacing.x;
  ImGui::SetCursorPosX(ImGui::GetContentRegionMax().x - 2 * width - spacing);
  const bool clicked = ImGui::Button(yes, {width, 0});
  ImGui::SameLine(0, spacing);
  cancelled = ImGui::Button("Cancel", {width, 0}) || cancelled;
  return clicked;
}

void contents(FileDialog& dialog, bool& cancelled) {
  FileBrowser& browser = dialog.browser;
  const float line = ImGui::GetFrameHeightWithSpacing();
  ImGui::TextDisabled("%s", titleOf(dialog.use));
  places(browser);
  bool chosen = nameField(dialog);
  const float width = ImGui::GetContentRegionAvail().x;
  const auto heightOf = [&](const std::string& words) {
    if (words.empty()) return 0.0f;
    return ImGui::CalcTextSize(words.c_str(), nullptr, false, width).y + ImGui::GetStyle().ItemSpacing.y;
  };
  const float words = heightOf(dialog.note) + heightOf(dialog.problem);
  const float below = 2 * line + ImGui::GetTextLineHeightWithSpacing() + words;
  chosen = fileList(browser, std::max(ImGui::GetContentRegionAvail().y - below, 3 * line)) || chosen;
  filters(browser);
  const auto say = [](const std::string& said, const ImVec4& color) {
    if (said.empty()) return;
    ImGui::PushStyleColor(ImGuiCol_Text, color);
    ImGui::TextWrapped("%s", said.c_str());
    ImGui::PopStyleColor();
  };
  say(dialog.note, kWarningText);
  say(dialog.problem, kErrorText);
  const FileType* type = fileType(browser);
  if (browser.replaces) {
    ImGui::TextColored(kWarningText, "A file of this name is there already");
  } else if (browser.renamed) {
    ImGui::TextColored(kWarningText, "Files with the ending that was typed cannot be written");
  } else {
    ImGui::TextDisabled("%s", browser.saves && type ? type->note.c_str() : "");
  }
  const char* yes = browser.replaces ? "Replace" : browser.saves ? "Save" : "Open";
  chosen = buttons(yes, cancelled) || chosen;
  if (chosen) dialog.chosen = chooseFile(browser);
}

// True when it was not open before: the key that asked for it is not meant for it.
bool open(const char* id) {
  if (ImGui::IsPopupOpen(id)) return false;
  ImGui::OpenPopup(id);
  return true;
}

void fileDialog(ViewerState& state, bool escape) {
  constexpr const char* kId = "file dialog";
  if (!state.desktop.dialog || state.desktop.dialog->chosen) return;  // chosen: until the window has taken it
  escape = !open(kId) && escape;
  const ImVec2 window = ImGui::GetIO().DisplaySize;
  const float font = ImGui::GetFontSize();
  ImGui::SetNextWindowPos({window.x / 2, window.y / 2}, ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowSize({std::min(48 * font, window.x - font), std::min(34 * font, window.y - font)});
  if (!ImGui::BeginPopupModal(kId, nullptr, kDialogWindow)) return;
  bool cancelled = escape;
  contents(*state.desktop.dialog, cancelled);
  if (cancelled) {
    state.desktop.dialog.reset();
    keepUnsaved(state);
  }
  if (cancelled || state.desktop.dialog->chosen) ImGui::CloseCurrentPopup();
  ImGui::EndPopup();
}

// Whether the recording that is asked about has been written while the question was open.
bool hasEnded(const ViewerState& state) {
  return state.desktop.question->what == Unsaved::recording && !state.record.wanted;
}

std::string lossOf(const ViewerState& state) {
  const ClosingQuestion& question = *state.desktop.question;
  switch (question.what) {
    case Unsaved::path:
      return "The camera path has not been saved.";
    case Unsaved::bookmarks:
      return "The bookmarks have not been saved.";
    case Unsaved::run:
      return "The run is paused, or about to be, as it was told here. Without a window it waits on.";
    case Unsaved::recording:
      if (hasEnded(state)) return "The recording has been written meanwhile.";
      return "The recording is not finished: " + std::to_string(state.record.done) + " of " +
             std::to_string(state.record.frames) + " pictures.";
    case Unsaved::edits:
      break;
  }
  const bool again = question.closing.way == Closing::Way::reading;
  return "The edits of " + printable(question.model.filename().string()) + " have not been saved." +
         (again ? "\nIts file has changed; reading it again loses them." : "");
}

// The answers to a question, side by side. Left, Right and Tab choose the one that Enter gives, which is lit: the
// first one where the question is `fresh`, the last one where the one that was lit is gone. Returns the one that was
// given; -1: none.
int answers(std::span<const char* const> labels, bool fresh) {
  const auto pressed = [](ImGuiKey key) { return ImGui::IsKeyPressed(ImGui::GetKeyIndex(key), false); };
  const bool back = pressed(ImGuiKey_LeftArrow) || (pressed(ImGuiKey_Tab) && ImGui::GetIO().KeyShift);
  const bool on = pressed(ImGuiKey_RightArrow) || (pressed(ImGuiKey_Tab) && !ImGui::GetIO().KeyShift);
  const int count = static_cast<int>(labels.size());
  int& lit = *ImGui::GetStateStorage()->GetIntRef(ImGui::GetID("lit"));
  lit = fresh ? 0 : (std::min(lit, count - 1) + on - back + count) % count;
  int given = enterPressed() ? lit : -1;
  for (int i = 0; i < count; ++i) {
    const char* label = labels[static_cast<std::size_t>(i)];
    const float width = ImGui::CalcTextSize(label).x + 2 * ImGui::GetStyle().FramePadding.x;
    if (i > 0) ImGui::SameLine();
    ImGui::PushStyleColor(ImGuiCol_Button, i == lit ? kAccent : ImGui::GetStyleColorVec4(ImGuiCol_Button));
    if (ImGui::Button(label, {std::max(width, ImGui::GetFontSize() * 6), 0})) given = i;
    ImGui::PopStyleColor();
    hint(i + 1 == count ? "Esc" : i == lit ? "Enter" : "Left, Right or Tab, then Enter");
  }
  return given;
}

void closingQuestion(ViewerState& state, bool escape) {
  constexpr const char* kId = "closing";
  if (!state.desktop.question) return;
  const bool fresh = open(kId);
  const ImVec2 window = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({window.x / 2, window.y / 2}, ImGuiCond_Always, {0.5f, 0.5f});
  if (!ImGui::BeginPopupModal(kId, nullptr, kDialogWindow | ImGuiWindowFlags_AlwaysAutoResize)) return;
  ImGui::TextUnformatted(lossOf(state).c_str());
  ImGui::Dummy({0, ImGui::GetFontSize() * 0.3f});
  enum { save, discard, cancel };
  std::vector labels = {"Save", "Discard", "Cancel"};
  if (state.desktop.question->what == Unsaved::run) labels = {"Go on", "Leave it paused", "Cancel"};
  if (state.desktop.question->what == Unsaved::recording) labels[save] = "Finish it first";
  if (hasEnded(state)) labels = {"Close", "Cancel"};  // nothing is left to discard
  int answer = answers(labels, fresh);
  if (answer + 1 == static_cast<int>(labels.size())) answer = cancel;
  if (answer < 0 && escape && !fresh) answer = cancel;
  if (answer >= 0) ImGui::CloseCurrentPopup();
  ImGui::EndPopup();
  if (answer == save) {
    saveUnsaved(state);
  } else if (answer == discard) {
    discardUnsaved(state);
  } else if (answer == cancel) {
    keepUnsaved(state);
  }
}

}  // namespace

void dialogs(ViewerState& state, bool escape) {
  // One at a time: the question comes first, the dialog waits below it.
  state.desktop.question ? closingQuestion(state, escape) : fileDialog(state, escape);
}

}  // namespace tg
