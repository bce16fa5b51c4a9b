// SPDX-License-Identifier: Apache-2.0
// The file dialog without its widgets.
#include "viewer/view/file_browser.h"

#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace tg;

namespace {

void touch(const std::filesystem::path& path) { std::ofstream(path) << "abc"; }

std::vector<std::string> names(const FileBrowser& browser) {
  std::vector<std::string> result;
  for (const std::size_t i : browser.shown) result.push_back(browser.entries[i].name);
  return result;
}

// sub/inner.tgz, Beta.tgz, alpha.ply, alpine.tgz, notes.txt, .hidden.tgz
FileBrowser browserIn(const TemporaryFolder& folder, bool saves = false) {
  std::filesystem::create_directory(folder / "sub");
  for (const char* name : {"sub/inner.tgz", "Beta.tgz", "alpha.ply", "alpine.tgz", "notes.txt", ".hidden.tgz"}) {
    touch(folder / name);
  }
  FileBrowser browser;
  browser.saves = saves;
  browser.types = {{".tgz", ""}, {".ply", "Holds no textures"}, {".compressed.ply", ""}};
  enterFolder(browser, folder.path);
  return browser;
}

void type(FileBrowser& browser, const std::string& text) {
  browser.text = text;
  filterFiles(browser);
}

using Names = std::vector<std::string>;

}  // namespace

TEST_CASE("a folder shows its folders first and what can be opened, the rest when it is asked for") {
  const TemporaryFolder folder;
  FileBrowser browser = browserIn(folder);
  CHECK(names(browser) == Names{"sub", "alpha.ply", "alpine.tgz", "Beta.tgz"});
  CHECK(browser.entries[browser.shown[1]].bytes == 3);
  browser.all_types = true;
  filterFiles(browser);
  CHECK(names(browser) == Names{"sub", "alpha.ply", "alpine.tgz", "Beta.tgz", "notes.txt"});
  browser.hidden = true;
  filterFiles(browser);
  CHECK(names(browser) == Names{"sub", ".hidden.tgz", "alpha.ply", "alpine.tgz", "Beta.tgz", "notes.txt"});
}

TEST_CASE("what is typed filters, a folder typed with its slash is entered, Tab completes as far as names agree") {
  const TemporaryFolder folder;
  FileBrowser browser = browserIn(folder);
  type(browser, "BET");
  CHECK(names(browser) == Names{"Beta.tgz"});
  CHECK(chooseFile(browser) == folder / "Beta.tgz");
  type(browser, "a");
  CHECK_FALSE(chooseFile(browser));  // of several none
  completeFileName(browser);
  CHECK(browser.text == "alp");
  type(browser, "s");
  completeFileName(browser);
  CHECK(browser.folder == folder / "sub");
  CHECK(browser.text.empty());
  CHECK(names(browser) == Names{"inner.tgz"});
  type(browser, "../al");
  CHECK(browser.folder == folder.path);
  CHECK(names(browser) == Names{"alpha.ply", "alpine.tgz"});
  type(browser, (folder / "sub/inner.tgz").string());
  CHECK(chooseFile(browser) == folder / "sub/inner.tgz");
  type(browser, "nowhere/x");
  CHECK_FALSE(chooseFile(browser));
  leaveFolder(browser);
  CHECK(browser.folder == folder.path);
}

TEST_CASE("a path that is typed is gone into once, whatever the dialog is for") {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "sub/sub");
  for (const bool saves : {false, true}) {
    CAPTURE(saves);
    FileBrowser browser = browserIn(folder, saves);
    type(browser, "sub/");
    CHECK(browser.folder == folder / "sub");
    CHECK(browser.text.empty());
    CHECK(names(browser) == Names{"sub", "inner.tgz"});
    type(browser, "../al");
    CHECK(browser.folder == folder.path);
    CHECK(browser.text == "al");
    type(browser, "/");
    CHECK(browser.folder == "/");
    type(browser, (folder / "sub/inner.tgz").string());
    CHECK(browser.folder == folder / "sub");
    CHECK(browser.text == "inner.tgz");
    if (std::getenv("HOME")) {
      type(browser, "~/");
      CHECK(browser.folder == std::filesystem::path(std::getenv("HOME")).lexically_normal());
    }
  }
}

TEST_CASE("up and down pick, Enter opens what is picked and goes into folders") {
  const TemporaryFolder folder;
  FileBrowser browser = browserIn(folder);
  pickFile(browser, -1);
  CHECK(chooseFile(browser) == folder / "Beta.tgz");
  pickFile(browser, -100);
  CHECK_FALSE(chooseFile(browser));
  CHECK(browser.folder == folder / "sub");
  CHECK(browser.picked == -1);
  pickFile(browser, 1);
  CHECK(chooseFile(browser) == folder / "sub/inner.tgz");
}

TEST_CASE("saving adds an extension, keeps the longest known one, and asks before it replaces a file") {
  const TemporaryFolder folder;
  FileBrowser browser = browserIn(folder, true);
  type(browser, "new");
  CHECK(names(browser).size() == 4);  // what is there, whatever is typed
  CHECK(chooseFile(browser) == folder / "new.tgz");
  type(browser, "new.compressed.ply");
  REQUIRE(fileType(browser));
  CHECK(fileType(browser)->extension == ".compressed.ply");
  setFileType(browser, 1);
  CHECK(browser.text == "new.ply");
  CHECK(fileType(browser)->note == "Holds no textures");
  CHECK(chooseFile(browser) == folder / "new.ply");
  type(browser, "alpine");
  CHECK_FALSE(chooseFile(browser));
  CHECK(browser.replaces);
  type(browser, "alpin");
  CHECK_FALSE(browser.replaces);
  type(browser, "alpine.tgz");
  CHECK_FALSE(chooseFile(browser));
  CHECK(chooseFile(browser) == folder / "alpine.tgz");
  type(browser, "new.exr");
  CHECK_FALSE(chooseFile(browser));
  CHECK(browser.renamed);
  CHECK(browser.text == "new.exr.tgz");
  CHECK(chooseFile(browser) == folder / "new.exr.tgz");
  type(browser, "new.exr.t");
  CHECK_FALSE(browser.renamed);
  pickFile(browser, 2);
  CHECK(browser.text == "alpha.ply");
  type(browser, "");
  CHECK_FALSE(chooseFile(browser));
  type(browser, "sub");
  CHECK_FALSE(chooseFile(browser));
  CHECK(browser.folder == folder / "sub");
}

TEST_CASE("folders that are gone, crowded or full of odd names are listed as far as they go") {
  const TemporaryFolder folder;
  FileBrowser browser;
  browser.all_types = true;
  enterFolder(browser, folder / "none");
  CHECK_FALSE(browser.problem.empty());
  CHECK(browser.entries.empty());
  for (std::size_t i = 0; i < kMaxFolderEntries + 5; ++i) touch(folder / std::to_string(i));
  enterFolder(browser, folder.path);
  CHECK(browser.entries.size() == kMaxFolderEntries);
  CHECK(browser.more);
  std::filesystem::create_directory(folder / "odd");
  touch(folder / "odd/a\nb.tgz");
  touch(folder / "odd/\xff\xfe.tgz");
  std::filesystem::create_symlink(folder / "nowhere", folder / "odd/link.tgz");
  enterFolder(browser, folder / "odd/");
  CHECK(browser.folder == folder / "odd");
  CHECK(browser.shown.size() == 3);
  pickFile(browser, 1);
  CHECK(chooseFile(browser) == folder / "odd/a\nb.tgz");
  for (int i = 0; i < 40; ++i) leaveFolder(browser);
  CHECK(browser.folder == "/");
}

TEST_CASE("a folder that may not be read says so") {
  const TemporaryFolder folder;
  std::filesystem::permissions(folder.path, std::filesystem::perms(0755));
  std::filesystem::create_directory(folder / "shut");
  std::filesystem::permissions(folder / "shut", std::filesystem::perms::none);
  const uid_t user = ::geteuid();
  if (user == 0) REQUIRE(::seteuid(65534) == 0);  // nothing is kept from root
  FileBrowser browser;
  enterFolder(browser, folder / "shut");
  if (user == 0) REQUIRE(::seteuid(0) == 0);
  CHECK(browser.problem == "This folder cannot be read: Permission denied");
}
