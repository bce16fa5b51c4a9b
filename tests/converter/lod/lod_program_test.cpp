// SPDX-License-Identifier: Apache-2.0
// tgconvert and scenes in levels of detail: written, described, checked and read back; nothing half written.
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <set>

#include "converter/glb.h"
#include "converter/lod/lod_scenes.h"
#include "converter/lod/write_lod.h"
#include "converter/registry/file_format.h"
#include "converter/scratch.h"
#include "core/bundle/ply.h"
#include "core/model/verbs.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;
namespace fs = std::filesystem;

namespace {

struct Result {
  int code = 0;
  std::string out, err;
};

Result tgconvert(const Scratch& scratch, const std::string& arguments, const std::string& before = "") {
  const fs::path out = scratch.folder() / "out.txt", err = scratch.folder() / "err.txt";
  const std::string command = before + "cd '" + scratch.folder().string() + "' && '" TG_CONVERT_PROGRAM "' " +
                              arguments + " >'" + out.string() + "' 2>'" + err.string() + "'";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, Glb::slurp(out), Glb::slurp(err)};
}

std::set<std::string> below(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    names.insert(fs::relative(entry.path(), folder).string());
  }
  return names;
}

void writeModel(const Scratch& scratch, int gaussians) {
  writeSplatPly(scratch.folder() / "in.ply", withoutTextures(test::trainedLikeModel(3, gaussians)));
}

}  // namespace

TEST_CASE("tgconvert writes levels of detail, checks them and takes the finest one out again") {
  const Scratch scratch;
  writeModel(scratch, 500);
  const Result written = tgconvert(scratch, "in.ply s/lod-meta.json --json");
  CAPTURE(written.err);
  REQUIRE(written.code == 0);
  const auto summary = nlohmann::json::parse(written.out);
  std::uintmax_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(scratch.folder() / "s")) {
    if (entry.is_regular_file()) bytes += entry.file_size();
  }
  CHECK(summary["output"]["bytes"] == bytes);
  const Result info = tgconvert(scratch, "s/lod-meta.json --info --json");
  REQUIRE(info.code == 0);
  CHECK(nlohmann::json::parse(info.out)["gaussians"] == 500);
  CHECK(nlohmann::json::parse(info.out)["file_format"] == "lod-meta.json");
  const Result check = tgconvert(scratch, "check s/lod-meta.json");
  CHECK(check.code == 0);
  CHECK(check.out == "s/lod-meta.json: valid, 0 errors, 0 warnings\n");
  REQUIRE(tgconvert(scratch, "s/lod-meta.json back.ply --quiet").code == 0);
  CHECK(readModel(scratch.folder() / "back.ply").model.size() == 500);
}

TEST_CASE("a scene in levels of detail is replaced by --overwrite only") {
  const Scratch scratch;
  writeModel(scratch, 200);
  REQUIRE(tgconvert(scratch, "in.ply s/lod-meta.json --quiet").code == 0);
  const std::string before = Glb::slurp(scratch.folder() / "s/lod-meta.json");
  const std::set<std::string> names = below(scratch.folder() / "s");
  writeModel(scratch, 150);
  const Result refused = tgconvert(scratch, "in.ply s/lod-meta.json");
  CHECK(refused.code == 4);
  CHECK(refused.err == "tgconvert: s/lod-meta.json: exists already (--overwrite replaces it)\n");
  CHECK(Glb::slurp(scratch.folder() / "s/lod-meta.json") == before);
  CHECK(below(scratch.folder() / "s") == names);
  REQUIRE(tgconvert(scratch, "in.ply s/lod-meta.json --quiet --overwrite").code == 0);
  CHECK(readModel(scratch.folder() / "s/lod-meta.json").model.size() == 150);
  CHECK(below(scratch.folder() / "s").size() == names.size());

  SECTION("with what it names, and nothing else") {
    const fs::path note = scratch.folder() / "s" / readLodScene(scratch.folder() / "s/lod-meta.json").files[0];
    std::ofstream(note.parent_path() / "note.txt") << "mine";
    REQUIRE(tgconvert(scratch, "in.ply s/lod-meta.json --quiet --overwrite").code == 0);
    CHECK(fs::exists(note.parent_path() / "note.txt"));
    CHECK(below(note.parent_path()) == std::set<std::string>{"note.txt"});
  }
  SECTION("but not where another list names it, too") {
    fs::copy_file(scratch.folder() / "s/lod-meta.json", scratch.folder() / "s/copy.lod-meta.json");
    REQUIRE(tgconvert(scratch, "in.ply s/lod-meta.json --quiet --overwrite").code == 0);
    CHECK(readModel(scratch.folder() / "s/copy.lod-meta.json").model.size() == 150);
  }
  SECTION("and nothing of another program's scene") {
    fs::create_directories(scratch.folder() / "other/2024");
    std::ofstream(scratch.folder() / "other/2024/photo.jpg") << "mine";
    auto json = nlohmann::json::parse(Glb::slurp(scratch.folder() / "s/lod-meta.json"));
    json.erase("TG_levels_of_detail");
    for (auto& file : json["filenames"]) file = "2024/" + file.get<std::string>();
    std::ofstream(scratch.folder() / "other/lod-meta.json") << json;
    REQUIRE(tgconvert(scratch, "in.ply other/lod-meta.json --quiet --overwrite").code == 0);
    CHECK(fs::exists(scratch.folder() / "other/2024/photo.jpg"));
  }
  SECTION("and nothing that has another name than such a scene's files") {
    const fs::path folder = scratch.folder() / "s";
    const auto whole = nlohmann::json::parse(Glb::slurp(folder / "lod-meta.json"));
    const std::string first = whole["filenames"][0];
    std::ofstream(folder / "budget.json") << R"({"means": {"files": ["thesis.webp"]}})";
    std::ofstream(folder / "thesis.webp") << "mine";
    fs::create_directories(folder / "photos");
    std::ofstream(folder / "photos/cameras.json") << "[]";
    std::ofstream(folder / fs::path(first).parent_path() / "thesis.txt") << "mine";
    auto image = nlohmann::json::parse(Glb::slurp(folder / first));
    image["means"]["files"] = {"thesis.txt"};
    std::ofstream(folder / first) << image;
    for (const auto& [key, value] : {std::pair<std::string, nlohmann::json>("/filenames/0", "budget.json"),
                                     {"/TG_levels_of_detail/cameras", "photos/cameras.json"},
                                     {"/filenames/0", first}}) {
      auto json = whole;
      json[nlohmann::json::json_pointer(key)] = value;
      std::ofstream(folder / "lod-meta.json") << json;
      REQUIRE(tgconvert(scratch, "in.ply s/lod-meta.json --quiet --overwrite").code == 0);
      for (const fs::path& name : {fs::path("budget.json"), fs::path("thesis.webp"), fs::path("photos/cameras.json"),
                                  fs::path(first).parent_path() / "thesis.txt"}) {
        INFO(key << " " << value);
        CHECK(fs::exists(folder / name));
      }
    }
  }
}

TEST_CASE("tgconvert says which file of a scene in levels of detail is broken, with exit code 3, and writes nothing") {
  const Scratch scratch;
  writeModel(scratch, 300);
  REQUIRE(tgconvert(scratch, "in.ply s/lod-meta.json --quiet").code == 0);
  const LodScene scene = readLodScene(scratch.folder() / "s/lod-meta.json");
  const fs::path image = (scratch.folder() / "s" / scene.files[0]).parent_path() / "quats.webp";
  fs::resize_file(image, fs::file_size(image) - 20);
  const Result read = tgconvert(scratch, "s/lod-meta.json back.ply");
  CHECK(read.code == 3);
  CHECK(std::ranges::count(read.err, '\n') == 1);
  CHECK(read.err.find("quats.webp") != std::string::npos);
  CHECK(!fs::exists(scratch.folder() / "back.ply"));
  const Result check = tgconvert(scratch, "check s/lod-meta.json");
  CHECK(check.code == 3);
  CHECK(check.out.find("quats.webp") != std::string::npos);
  CHECK(check.out.ends_with("s/lod-meta.json: not valid, 1 error, 0 warnings\n"));
  fs::remove(image);
  CHECK(tgconvert(scratch, "s/lod-meta.json back.ply").code == 2);
  CHECK(tgconvert(scratch, "check s/lod-meta.json").code == 3);
  Bundle source;
  source.model = withoutTextures(test::trainedLikeModel(3, 300));
  const fs::path many = scratch.folder() / "many/lod-meta.json";
  writeLod(many, source, {.leaf = 50, .file = 100, .coarsest = 50});
  const std::vector<std::string> files = readLodScene(many).files;
  REQUIRE(files.size() > 2);
  for (const std::string& file : files) {
    fs::resize_file((scratch.folder() / "many" / file).parent_path() / "means_l.webp", 20);
  }
  const Result all = tgconvert(scratch, "check many/lod-meta.json --json");
  CHECK(all.code == 3);
  const auto errors = nlohmann::json::parse(all.out)["errors"];
  REQUIRE(errors.size() == files.size());
  for (std::size_t i = 0; i < files.size(); ++i) {
    CHECK(errors[i]["message"].get<std::string>().find(files[i]) != std::string::npos);
  }
  fs::resize_file(scratch.folder() / "s/lod-meta.json", 100);
  CHECK(tgconvert(scratch, "check s/lod-meta.json").code == 3);
}

TEST_CASE("a scene in levels of detail that cannot be written leaves nothing, and the older one as it was") {
  const Scratch scratch;
  writeModel(scratch, 3000);
  const std::string full = "trap '' XFSZ; ulimit -f 20; ";  // files of 10 KiB: some images fit, others do not
  const Result first = tgconvert(scratch, "in.ply s/lod-meta.json", full);
  CHECK(first.code == 4);
  CHECK(std::ranges::count(first.err, '\n') == 1);
  CHECK(!fs::exists(scratch.folder() / "s"));
  REQUIRE(tgconvert(scratch, "in.ply s/lod-meta.json --quiet").code == 0);
  const std::set<std::string> names = below(scratch.folder() / "s");
  CHECK(tgconvert(scratch, "in.ply s/lod-meta.json --overwrite", full).code == 4);
  CHECK(below(scratch.folder() / "s") == names);
  CHECK(tgconvert(scratch, "check s/lod-meta.json --quiet").code == 0);
}

TEST_CASE("a signal leaves nothing of a scene in levels of detail") {
  const Scratch scratch;
  writeModel(scratch, 60'000);
  fs::create_directory(scratch.folder() / "s");
  const std::string script = "cd '" + scratch.folder().string() +
                             "'; '" TG_CONVERT_PROGRAM
                             "' in.ply s/lod-meta.json --quiet & "
                             "until ls -A s | grep -q '^[.]'; do kill -0 $! || exit 1; done; kill -TERM $!; wait $!";
  const int status = std::system(script.c_str());
  CHECK(WEXITSTATUS(status) == 128 + 15);
  CHECK(fs::is_empty(scratch.folder() / "s"));
}
