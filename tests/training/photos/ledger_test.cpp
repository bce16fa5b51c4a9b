// SPDX-License-Identifier: Apache-2.0
// What counts as done.
#include "training/photos/ledger.h"

#include <algorithm>
#include <fstream>

#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

using tg::Ledger;
using tg::PhotoStage;

TEST_CASE("a stage is done once it is finished, from what it was made of, until one before it begins", "[photos]") {
  const tg::TemporaryFolder folder;
  const std::string odd = "na\xffme \"%\n";
  {
    Ledger ledger(folder / "work");
    CHECK_FALSE(ledger.isBegun(PhotoStage::photographs, odd));
    ledger.begin(PhotoStage::photographs, odd);
    CHECK(ledger.isBegun(PhotoStage::photographs, odd));
    CHECK_FALSE(ledger.isDone(PhotoStage::photographs, odd));
    ledger.finish(PhotoStage::photographs, "[1,2]");
    ledger.begin(PhotoStage::features, "f");
    CHECK(tg::test::messageOf([&] { Ledger second(folder / "work"); }, tg::ErrorKind::cannotWrite) ==
          (folder / "work").string() + ": another tgtrain is at work in this folder");
  }
  {
    Ledger ledger(folder / "work");
    CHECK(ledger.isDone(PhotoStage::photographs, odd));
    CHECK_FALSE(ledger.isDone(PhotoStage::photographs, "another"));
    CHECK(ledger.result(PhotoStage::photographs) == "[1,2]");
    CHECK(ledger.isBegun(PhotoStage::features, "f"));
    CHECK_FALSE(ledger.isDone(PhotoStage::features, "f"));
    ledger.begin(PhotoStage::photographs, "new");
  }
  const Ledger ledger(folder / "work");
  CHECK_FALSE(ledger.isDone(PhotoStage::photographs, odd));
  CHECK_FALSE(ledger.isBegun(PhotoStage::features, "f"));
}

TEST_CASE("a folder with other people's files is refused, a broken list is none", "[photos]") {
  const tg::TemporaryFolder folder;
  std::ofstream(folder / "thesis.txt") << "years of work";
  CHECK_THAT(tg::test::messageOf([&] { Ledger ledger(folder.path); }, tg::ErrorKind::cannotWrite),
             Contains("holds other files"));
  std::filesystem::create_directory(folder / "work");
  for (const char* text : {"", "{", "[]", "{\"format\": 1}", "{\"format\": \"tgtrain-photos\", \"version\": 1}",
                           "{\"format\": \"tgtrain-photos\", \"version\": 1, \"stages\": {\"photographs\": 7}}"}) {
    std::ofstream(folder / "work/photos.json") << text;
    const Ledger ledger(folder / "work");
    CHECK_FALSE(ledger.isBegun(PhotoStage::photographs, ""));
  }
}

TEST_CASE("folders that were made for one that cannot be used go again", "[photos]") {
  const tg::TemporaryFolder folder;
  std::filesystem::path work = folder / "a/b" / std::string(300, 'c');  // a longer name than file systems have
  CHECK_THAT(tg::test::messageOf([&] { Ledger ledger(work); }, tg::ErrorKind::cannotWrite),
             Contains("cannot make this folder"));
  CHECK(std::filesystem::is_empty(folder.path));
  work = folder.path;  // as long as a path may be, so that there is none for the list
  while (work.native().size() < 4080) work /= std::string(std::min<std::size_t>(200, 4089 - work.native().size()), 'd');
  CHECK_THAT(tg::test::messageOf([&] { Ledger ledger(work); }, tg::ErrorKind::cannotWrite), Contains("photos.json"));
  CHECK(std::filesystem::is_empty(folder.path));
  std::filesystem::create_symlink(folder / "gone", folder / "link");
  CHECK_THAT(tg::test::messageOf([&] { Ledger ledger(folder / "link"); }, tg::ErrorKind::cannotWrite),
             Contains("cannot make this folder"));
  CHECK(std::filesystem::is_symlink(folder / "link"));
}

TEST_CASE("a folder in which no stage is done goes again but not what else is in it", "[photos]") {
  const tg::TemporaryFolder folder;
  const auto use = [&] {
    Ledger ledger(folder / "work");
    ledger.begin(PhotoStage::photographs, "a film");
    for (const char* made : {"logs", "images.part", "masks.part"}) {
      std::filesystem::create_directory(folder / "work" / made);
      std::ofstream(folder / "work" / made / "file") << "half of it";
    }
  };
  use();
  CHECK_FALSE(std::filesystem::exists(folder / "work"));
  std::filesystem::create_directory(folder / "old");
  for (const char* work :
       {"old/a/b/c", "old/a/b/c/", "old/a/b/.", "old/a/./b"}) {  // with the folders that were made for it
    {
      const Ledger ledger(folder / work);
    }
    CHECK(std::filesystem::is_empty(folder / "old"));
  }
  {
    const Ledger ledger(folder / "old/a/b");
    std::ofstream(folder / "old/a/mine.txt") << "mine";
  }
  CHECK_FALSE(std::filesystem::exists(folder / "old/a/b"));
  CHECK(std::filesystem::exists(folder / "old/a/mine.txt"));
  {
    const Ledger ledger(folder / "work");
    std::ofstream(folder / "work/notes.txt") << "mine";
  }
  CHECK(std::filesystem::exists(folder / "work/notes.txt"));
  CHECK_NOTHROW(Ledger(folder / "work"));  // the same command once more
  std::filesystem::remove(folder / "work/notes.txt");
  use();  // it was there before
  CHECK(std::filesystem::exists(folder / "work/photos.json"));
  std::filesystem::remove_all(folder / "work");
  {
    Ledger ledger(folder / "work");
    ledger.begin(PhotoStage::photographs, "a film");
    ledger.finish(PhotoStage::photographs);
    ledger.begin(PhotoStage::features, "f");
  }
  CHECK(std::filesystem::exists(folder / "work/photos.json"));
}
