// SPDX-License-Identifier: Apache-2.0
// The camera path: its keys, playing, files, recording.
#include <imgui.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <string>

#include "core/system/numbers.h"
#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/names.h"
#include "viewer/view/parse.h"
#include "viewer/view/path_editor.h"

namespace tg {
namespace {

// One row of the table; true when the key is gone.
bool keyRow(ViewerState& state, std::size_t index) {
  PathState& editor = state.path;
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::AlignTextToFramePadding();
  const std::string label = std::to_string(index);
  if (ImGui::Selectable(label.c_str(), static_cast<int>(index) == editor.key)) showKey(state, index);
  hint("Show this key");
  ImGui::TableNextColumn();
  ImGui::SetNextItemWidth(-1);
  auto seconds = static_cast<float>(keySeconds(editor.path, index));
  const bool last = index + 1 == editor.path.keys.size();
  if (ImGui::DragFloat("##seconds", &seconds, 0.05f, last ? 0.0f : 0.05f, 3600.0f,
                       last && seconds == 0 ? "end" : "%.2f s", ImGuiSliderFlags_AlwaysClamp)) {
    changeKeySeconds(state, index, seconds);
  }
  hint(last ? "Back to the first key; 0: the path ends here" : "To the next key");
  ImGui::TableNextColumn();
  if (ImGui::Button("Set")) replaceKey(state, index);
  hint("Put this key where the view is");
  ImGui::SameLine(0, ImGui::GetStyle().ItemInnerSpacing.x);
  if (!ImGui::Button("x")) return false;
  deleteKey(state, index);
  return true;
}

void keyTable(ViewerState& state) {
  const float row = ImGui::GetFrameHeightWithSpacing();
  const std::size_t rows = std::clamp<std::size_t>(state.path.path.keys.size(), 1, 8);
  if (!ImGui::BeginTable("keys", 3, ImGuiTableFlags_SizingFixedFit | ImGuiTableFlags_ScrollY,
                         {0, row * static_cast<float>(rows) + 4})) {
    return;
  }
  ImGui::TableSetupColumn("key", ImGuiTableColumnFlags_WidthFixed, ImGui::GetFontSize() * 2);
  ImGui::TableSetupColumn("seconds", ImGuiTableColumnFlags_WidthStretch);
  ImGui::TableSetupColumn("edit");
  for (std::size_t i = 0; i < state.path.path.keys.size(); ++i) {
    ImGui::PushID(static_cast<int>(i));
    const bool gone = keyRow(state, i);
    ImGui::PopID();
    if (gone) break;
  }
  ImGui::EndTable();
}

// Two sides in pixels, between which Tab leads. What is typed counts once both are left, if a picture may have that
// size; else it is refused with a notice.
void sizeField(ViewerState& state, const char* id, glm::ivec2& size) {
  static std::array<std::array<char, 24>, 2> sides;  // as typed, also the one that Tab has left
  ImGuiStorage& kept = *ImGui::GetStateStorage();
  const ImGuiID frame = ImGui::GetID(id);
  const bool held = kept.GetInt(frame, -2) == ImGui::GetFrameCount() - 1;
  const float gap = ImGui::GetStyle().ItemInnerSpacing.x, width = (ImGui::CalcItemWidth() - gap) / 2;
  if (held) pushTabStop(true);
  ImGui::BeginGroup();
  ImGui::PushID(id);
  for (int i = 0; i < 2; ++i) {
    auto& side = sides[static_cast<std::size_t>(i)];
    if (!held) (void)std::snprintf(side.data(), side.size(), "%d", size[i]);
    if (i > 0) ImGui::SameLine(0, gap);
    ImGui::PushID(i);
    ImGui::SetNextItemWidth(width);
    ImGui::InputText("", side.data(), side.size(),
                     ImGuiInputTextFlags_CharsDecimal | ImGuiInputTextFlags_AutoSelectAll);
    ImGui::PopID();
  }
  ImGui::PopID();
  ImGui::EndGroup();
  if (held) popTabStop();
  if (ImGui::IsItemActive()) {
    kept.SetInt(frame, ImGui::GetFrameCount());
  } else if (ImGui::IsItemDeactivated()) {
    const auto x = parseWhole<int>(sides[0].data()), y = parseWhole<int>(sides[1].data());
    const std::string typed = std::string(sides[0].data()) + "x" + sides[1].data();
    if (x && y && isImageSize(*x, *y)) {
      size = {*x, *y};
    } else if (typed != std::to_string(size.x) + "x" + std::to_string(size.y)) {
      notify(state, "No size of a picture: expected " + imageSizeLimits() + ", found " + typed);
    }
  }
}

void saveTo(ViewerState& state, std::string& file, std::string_view use,
            void (*save)(const ViewerState&, const std::filesystem::path&)) {
  file = withJson(file);
  if (!mayReplace(state, file, use)) return;
  attempt(state, [&] {
    save(state, file);
    if (save == savePath) notePathKept(state);
    notify(state, "Saved " + absolutePath(file).string());
  });
}

}  // namespace

void keySection(ViewerState& state) {
  PathState& editor = state.path;
  heading("CAMERA PATH");
  if (segment("Add key", false, 0, 3)) attempt(state, [&] { addKey(state); });
  hint("At the view at hand (K)");
  ImGui::BeginDisabled(editor.path.keys.size() < 2);
  if (segment(editor.playing ? "Pause" : "Play", editor.playing, 1, 3)) togglePlaying(state);
  hint("L");
  ImGui::EndDisabled();
  ImGui::BeginDisabled(editor.path.keys.empty());
  if (segment("Clear", false, 2, 3)) clearPath(state);
  hint("Removes all keys; Ctrl+Z brings them back");
  ImGui::EndDisabled();
  if (editor.path.keys.empty()) {
    ImGui::TextDisabled("No keys yet: go somewhere and press K");
    return;
  }
  keyTable(state);
  ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
  auto seconds = static_cast<float>(editor.at);
  const auto whole = static_cast<float>(duration(editor.path));
  const std::string format = "%.2f / " + formatted("%.2f", whole) + " s";
  if (slider("##at", seconds, 0.0f, whole, format.c_str())) seekPath(state, seconds);
  ImGui::Checkbox("Lines in the scene", &editor.drawn);
  hint("The path and its keys, drawn where they are; in no picture that is saved");
  ImGui::SameLine();
  bool loop = editor.path.closing > 0;
  if (ImGui::Checkbox("Loop", &loop)) {
    changeKeySeconds(state, editor.path.keys.size() - 1, loop ? editor.key_seconds : 0);
  }
  hint("Back to the first key at the end");
}

void pathFileSection(ViewerState& state) {
  std::string& file = state.path.file;
  heading("FILE");
  ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
  textField("##file", file, "file");
  fileHint(file);
  if (segment("Load", false, 0, 3)) attempt(state, [&] { loadPath(state, file); });
  hint("A path, or a cameras.json as keys a second apart");
  ImGui::BeginDisabled(state.path.path.keys.empty());
  if (segment("Save", false, 1, 3)) saveTo(state, file, "path", savePath);
  hint("For --path and --benchmark");
  if (segment("As cameras", false, 2, 3)) saveTo(state, file, "cameras", saveKeyCameras);
  hint("The keys as a cameras.json");
  ImGui::EndDisabled();
}

void recordSection(ViewerState& state) {
  RecordState& record = state.record;
  heading("RECORD");
  ImGui::BeginDisabled(record.wanted);
  std::string out = record.out.string();
  ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
  if (textField("##out", out, "out.mp4, frames/####.png or a folder")) record.out = out;
  fileHint(record.out, ".mp4, .mov, .mkv, .webm (with ffmpeg), frames/####.png, or a folder");
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  const float half = (ImGui::GetContentRegionAvail().x - spacing) / 2;
  ImGui::SetNextItemWidth(half);
  sizeField(state, "##size", record.size);
  hint("Width and height [px]");
  ImGui::SameLine(0, spacing);
  ImGui::SetNextItemWidth(half);
  if (recordsPath(state)) {
    auto fps = static_cast<float>(record.fps);
    if (ImGui::DragFloat("##fps", &fps, 0.5f, 1.0f, 240.0f, "%.1f / s", ImGuiSliderFlags_AlwaysClamp)) record.fps = fps;
    hint("Frames a second");
  } else {
    ImGui::DragInt("##frames", &record.turntable_frames, 1.0f, 2, 3600, "%d frames", ImGuiSliderFlags_AlwaysClamp);
    hint("Of one turn");
  }
  ImGui::EndDisabled();
  if (!record.wanted) {
    if (segment(recordsPath(state) ? "Record the path" : "Record a turn", false, 0, 1)) toggleRecording(state);
    hint("Shift+R");
    return;
  }
  const float share = record.frames > 0 ? static_cast<float>(record.done) / static_cast<float>(record.frames) : 0.0f;
  const std::string text =
      std::to_string(record.done) + " / " + std::to_string(record.frames) + (record.waits ? ", waits" : "");
  ImGui::ProgressBar(share, {half, 0}, text.c_str());
  ImGui::SameLine(0, spacing);
  if (segment("Cancel", false, 0, 1)) record.wanted = false;
}

}  // namespace tg
