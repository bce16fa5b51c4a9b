// SPDX-License-Identifier: Apache-2.0
// Folders, as they are found: names of any bytes, links to nowhere, millions of entries.
#include "viewer/view/file_browser.h"

#include <algorithm>
#include <cstdlib>
#include <system_error>
#include <utility>

#include "core/system/assert.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](char c) { return lower(c); });
  return text;
}

bool isFolder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

// The longest one that the name ends in: ".compressed.ply" is no ".ply".
const FileType* typeOf(const FileBrowser& browser, const std::string& name) {
  const std::string small = lower(name);
  const FileType* found = nullptr;
  for (const FileType& type : browser.types) {
    const bool longer = !found || type.extension.size() > found->extension.size();
    if (small.size() > type.extension.size() && small.ends_with(type.extension) && longer) found = &type;
  }
  return found;
}

bool isShown(const FileBrowser& browser, const FileEntry& entry, const std::string& wanted) {
  if (!browser.hidden && entry.name.starts_with('.')) return false;
  if (!entry.folder && !browser.all_types && !typeOf(browser, entry.name)) return false;
  return wanted.empty() || lower(entry.name).find(wanted) != std::string::npos;
}

// A path as typed: from home with a tilde, else from the folder at hand.
fs::path typedPath(const FileBrowser& browser, const std::string& text) {
  const char* home = std::getenv("HOME");
  if (home && text.starts_with("~/")) return fs::path(home) / text.substr(2);
  return browser.folder / text;
}

// The folder that is typed, with what follows its last slash left as the text.
void enterTypedFolder(FileBrowser& browser) {
  const std::size_t slash = browser.text.rfind('/');
  if (slash == std::string::npos) return;
  const fs::path folder = typedPath(browser, browser.text.substr(0, slash + 1));
  if (!isFolder(folder)) return;
  const std::string rest = browser.text.substr(slash + 1);
  browser.text = rest;  // enterFolder() looks at it, too
  enterFolder(browser, folder);
  browser.text = rest;
}

}  // namespace

void enterFolder(FileBrowser& browser, const fs::path& folder) {
  std::error_code error;
  const fs::path whole = fs::absolute(folder, error);
  browser.folder = (error ? folder : whole).lexically_normal();
  if (!browser.folder.has_filename()) browser.folder = browser.folder.parent_path();  // no slash at the end
  browser.entries.clear();
  browser.more = false;
  browser.problem.clear();
  fs::directory_iterator at(browser.folder, error);
  for (; !error && at != fs::directory_iterator(); at.increment(error)) {
    if (browser.entries.size() == kMaxFolderEntries) {
      browser.more = true;
      break;
    }
    std::error_code ignored;
    FileEntry entry{at->path().filename().string(), at->is_directory(ignored), 0};
    if (!entry.folder && at->is_regular_file(ignored)) entry.bytes = at->file_size(ignored);
    browser.entries.push_back(std::move(entry));
  }
  if (error) browser.problem = "This folder cannot be read: " + error.message();
  std::sort(browser.entries.begin(), browser.entries.end(), [](const FileEntry& a, const FileEntry& b) {
    if (a.folder != b.folder) return a.folder;
    const std::string x = lower(a.name), y = lower(b.name);
    return x != y ? x < y : a.name < b.name;
  });
  if (!browser.saves) browser.text.clear();
  filterFiles(browser);
}

void leaveFolder(FileBrowser& browser) { enterFolder(browser, browser.folder.parent_path()); }

void filterFiles(FileBrowser& browser) {
  browser.replaces = browser.renamed = false;
  browser.picked = -1;
  browser.shown.clear();
  if (browser.text.find('/') != std::string::npos) enterTypedFolder(browser);
  // What is typed to save under is no filter: the list shows what is there already.
  const std::string wanted = browser.saves ? "" : lower(browser.text);
  browser.shown.clear();
  for (std::size_t i = 0; i < browser.entries.size(); ++i) {
    if (isShown(browser, browser.entries[i], wanted)) browser.shown.push_back(i);
  }
}

void pickFile(FileBrowser& browser, int step) {
  const int count = static_cast<int>(browser.shown.size());
  if (count == 0) return;
  browser.replaces = false;
  const int from = browser.picked < 0 && step < 0 ? count : browser.picked;
  browser.picked = std::clamp(from + step, 0, count - 1);
  browser.scrolls = true;
  const FileEntry& entry = browser.entries[browser.shown[static_cast<std::size_t>(browser.picked)]];
  if (browser.saves && !entry.folder) browser.text = entry.name;
}

void completeFileName(FileBrowser& browser) {
  const FileEntry* only = nullptr;
  std::string shared;
  std::size_t fits = 0;
  for (const FileEntry& entry : browser.entries) {
    if (!entry.name.starts_with(browser.text) || !isShown(browser, entry, "")) continue;
    only = &entry;
    if (fits++ == 0) {
      shared = entry.name;
    } else {
      const auto [end, ignored] = std::mismatch(shared.begin(), shared.end(), entry.name.begin(), entry.name.end());
      shared.erase(end, shared.end());
    }
  }
  if (fits == 0) return;
  browser.text = shared;
  if (fits == 1 && only->folder) browser.text += '/';
  filterFiles(browser);
}

void setFileType(FileBrowser& browser, std::size_t type) {
  TG_ASSERT(type < browser.types.size(), "the dialog has this type");
  if (const FileType* before = typeOf(browser, browser.text)) {
    browser.text.resize(browser.text.size() - before->extension.size());
  }
  browser.text += browser.types[type].extension;
  filterFiles(browser);
}

const FileType* fileType(const FileBrowser& browser) { return typeOf(browser, browser.text); }

std::optional<fs::path> chooseFile(FileBrowser& browser) {
  if (browser.picked >= 0) {
    const FileEntry entry = browser.entries[browser.shown[static_cast<std::size_t>(browser.picked)]];
    const fs::path path = browser.folder / entry.name;
    if (entry.folder) {
      enterFolder(browser, path);
      return std::nullopt;
    }
    if (!browser.saves) return path;
  }
  if (browser.text.empty()) return std::nullopt;
  fs::path path = typedPath(browser, browser.text);
  if (isFolder(path)) {
    if (browser.saves) browser.text.clear();
    enterFolder(browser, path);
    return std::nullopt;
  }
  std::error_code ignored;
  if (!browser.saves) {
    if (fs::exists(path, ignored)) return path;
    // Letters that leave one file of the list are enough.
    if (browser.shown.size() != 1) return std::nullopt;
    browser.picked = 0;
    return chooseFile(browser);
  }
  if (!browser.types.empty() && !typeOf(browser, browser.text)) {
    const std::string& extension = browser.types.front().extension;
    if (path.has_extension()) {
      browser.text += extension;
      filterFiles(browser);
      browser.renamed = true;
      return std::nullopt;
    }
    path += extension;
  }
  if (fs::exists(path, ignored) && !std::exchange(browser.replaces, true)) return std::nullopt;
  return path;
}

}  // namespace tg
