// SPDX-License-Identifier: Apache-2.0
// A folder to choose a file of: what is listed, what typing does to it, what Enter means. No widgets.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tg {

constexpr std::size_t kMaxFolderEntries = 10000;  // listed of a folder
constexpr std::size_t kMaxFileName = 4096;        // [bytes] that can be typed

struct FileEntry {
  std::string name;
  bool folder = false;
  std::uint64_t bytes = 0;
};

// What can be opened or written.
struct FileType {
  std::string extension;  // in lower case, with its dot
  std::string note;       // what writing it loses; "" = nothing to say
};

struct FileBrowser {
  std::filesystem::path folder;  // absolute
  std::string text;              // typed: of the name, or a path
  bool saves = false;
  bool hidden = false;     // also names that begin with a dot
  bool all_types = false;  // also files of no type of `types`
  std::vector<FileType> types;
  std::vector<FileEntry> entries;  // folders first, in alphabetical order
  bool more = false;               // than are in `entries`
  std::string problem;             // why the folder cannot be listed; "" = none
  std::vector<std::size_t> shown;  // of `entries`
  int picked = -1;                 // of `shown`; -1: what is typed counts
  bool scrolls = false;            // until the picked one has been brought into view
  bool replaces = false;           // the file is there already: the user is asked
  bool renamed = false;            // an ending that is none of `types` was typed: the user sees what it gets
};

// Lists it. One that cannot be read is empty, with its problem.
void enterFolder(FileBrowser& browser, const std::filesystem::path& folder);
void leaveFolder(FileBrowser& browser);  // for the one that it lies in
// After a change of the text or of what is to be shown. A folder that is typed, with a slash at its end, is entered.
void filterFiles(FileBrowser& browser);
void pickFile(FileBrowser& browser, int step);             // up or down the list
void completeFileName(FileBrowser& browser);               // by what all names share that begin like the text
void setFileType(FileBrowser& browser, std::size_t type);  // of `types`: the name gets its extension
const FileType* fileType(const FileBrowser& browser);      // by the extension of the name; null: none of them
// What Enter does: goes into a folder, or asks whether to replace a file, and returns nothing; else the chosen file. A
// name to save under without a known extension gets that of the first type, which is shown first where it has another.
std::optional<std::filesystem::path> chooseFile(FileBrowser& browser);

}  // namespace tg
