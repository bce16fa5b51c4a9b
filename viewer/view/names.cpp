// SPDX-License-Identifier: Apache-2.0
// Everything that has a name.
#include "viewer/view/names.h"

#include <string>
#include <system_error>

namespace tg {

void forEachName(const ViewerState& state, const std::function<void(std::string_view)>& take) {
  take(state.scene.path.native());
  for (const Camera& camera : state.scene.cameras) take(camera.name);
  for (const std::string& warning : state.scene.warnings) take(warning);
  for (const Document& document : state.documents.open) take(document.path.native());
  for (const std::string& path : state.recent) take(path);
  for (const Camera& bookmark : state.camera.bookmarks) take(bookmark.name);
  for (const std::string* text :
       {&state.camera.bookmark_file, &state.path.file, &state.messages.notice, &state.messages.error,
        &state.follow.problem, &state.compare.problem, &state.compare.photograph}) {
    take(*text);
  }
  take(state.record.out.native());
  take(state.loading.path.native());
  if (!state.desktop.dialog) return;
  const FileBrowser& browser = state.desktop.dialog->browser;
  take(browser.folder.native());
  take(browser.text);
  take(browser.problem);
  for (const std::size_t i : browser.shown) take(browser.entries[i].name);
}

std::filesystem::path absolutePath(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::path whole = std::filesystem::absolute(path, error);
  return error ? path : whole.lexically_normal();
}

}  // namespace tg
