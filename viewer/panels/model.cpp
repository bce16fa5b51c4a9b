// SPDX-License-Identifier: Apache-2.0
// Which model is shown, and what is in it.
#include <imgui.h>

#include "core/file/web_address.h"
#include "core/system/error.h"
#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"
#include "viewer/view/edits.h"
#include "viewer/view/names.h"

namespace tg {
namespace {

// What comes, and what will not.
void streamLine(const StreamState& stream) {
  if (stream.owed > 0) {
    ImGui::TextColored(kHighlightText, "loading %s, %zu to come", printable(stream.loading).c_str(), stream.owed);
  } else {
    ImGui::TextDisabled(stream.settled ? "all levels of this view are there" : "choosing levels");
  }
  if (stream.lost > 0) {
    ImGui::TextColored(kWarningText, "%zu file%s of chunks cannot be read", stream.lost, stream.lost == 1 ? "" : "s");
  }
}

}  // namespace

void modelSection(ViewerState& state) {
  const Scene& scene = state.scene;
  const char* keys = "Keys ?";
  const float button = ImGui::CalcTextSize(keys).x + 2 * ImGui::GetStyle().FramePadding.x;
  const float right = ImGui::GetContentRegionMax().x - button;
  const std::string shown = scene.path.empty() ? "No model" : printable(scene.path.filename().string());
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted(cutMiddle(shown, right - ImGui::GetCursorPosX() - ImGui::GetFontSize()).c_str());
  if (!scene.path.empty()) {
    const bool address = isWebAddress(scene.path.string());
    hint(printable((address ? scene.path : absolutePath(scene.path)).string()).c_str());
  }
  ImGui::SameLine(right);
  if (ImGui::Button(keys)) state.ui.help = !state.ui.help;
  hint("Keys and mouse; H hides this panel");
  if (!scene.model && !state.follow.active) return;
  if (scene.streamed_from > 0) {
    ImGui::TextDisabled("%s of %s Gaussians", grouped(scene.gaussians).c_str(), grouped(scene.streamed_from).c_str());
    ImGui::TextDisabled("SH degree %d", scene.sh_degree);
    streamLine(state.stream);
  } else {
    ImGui::TextDisabled("%s%s Gaussian%s, SH degree %d", scene.partial ? "a part: " : "",
                        grouped(scene.gaussians).c_str(), scene.gaussians == 1 ? "" : "s", scene.sh_degree);
  }
  if (scene.textured > 0) {
    ImGui::TextDisabled("%s textured (%s), %s texels", grouped(scene.textured).c_str(),
                        std::string(name(scene.texture_mode)).c_str(), grouped(scene.texels).c_str());
  } else {
    ImGui::TextDisabled("no textures");
  }
  if (!scene.training.empty()) ImGui::TextDisabled("%s", trainingText(state).c_str());
  if (state.follow.active) {
    const FollowState& follow = state.follow;
    const char* text = follow.waits             ? "not followed while Gaussians are chosen"
                       : follow.problem.empty() ? "following the file"
                                                : follow.problem.c_str();
    ImGui::PushStyleColor(ImGuiCol_Text, follow.waits || !follow.problem.empty() ? kWarningText : kHighlightText);
    ImGui::TextWrapped("%s", text);
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

}  // namespace tg
