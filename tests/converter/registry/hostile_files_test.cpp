// SPDX-License-Identifier: Apache-2.0
// Every format that is read, cut short and with bits flipped: an Error or a sound model, never anything else.
#include <algorithm>
#include <set>

#include "converter/convert.h"
#include "converter/glb.h"
#include "converter/gltf/meshopt.h"
#include "converter/html/html.h"
#include "converter/scenes.h"
#include "converter/scratch.h"
#include "converter/sog/folder.h"
#include "converter/splat_files.h"
#include "core/bundle/bundle.h"
#include "core/system/error.h"
#include "support/catch.h"

using namespace tg;

namespace {

struct HostileFile {
  std::string name;  // with the extension that says what it is
  std::string bytes;
  bool exact = true;  // no part of it is a whole file
};

// A textured model in every format that keeps it, and small files of the others.
std::vector<HostileFile> goodFiles(const Scratch& scratch) {
  const test::TestScene scene = test::makeScene(test::SceneKind::mixed, 61, 30);
  Bundle bundle;
  bundle.model = scene.model;
  bundle.cameras = {scene.camera};
  const auto source = scratch.folder() / "source.tgz";
  writeBundle(source, bundle);
  std::vector<HostileFile> files = {{"a.tgz", Glb::slurp(source)}};
  const auto add = [&](const std::string& name, const ConvertOptions& options = {}) {
    ConvertOptions quick = options;
    quick.measure = Measure::never;
    quick.overwrite = true;
    convert(source, scratch.folder() / name, quick);
    files.push_back({name, Glb::slurp(scratch.folder() / name)});
  };
  add("plain.ply");
  add("written.compressed.ply");
  add("written.spz");
  add("gzip.spz", {.spz_version = 3});
  add("images.sog");
  add("png8.glb");
  add("exr.glb", {.atlas = AtlasFormat::exr});
  add("webp.glb", {.atlas = AtlasFormat::webp});
  add("integers.glb", {.quantize = true});
  if (hasMeshopt()) add("packed.glb", {.quantize = true, .meshopt = true});
  if (hasMeshopt()) add("steps.glb", {.atlas = AtlasFormat::webp, .steps = 2.0f});
  add("open.gltf");
  REQUIRE(files.back().bytes.ends_with("}\n"));
  files.back().bytes.pop_back();
  for (const ZipEntry& entry : sogFiles(bundle.model, "meta.json")) {
    const std::string bytes(entry.bytes.begin(), entry.bytes.end());
    scratch.write(entry.name, bytes);
    if (entry.name == kSogMetaName) files.push_back({entry.name, bytes});
  }
  add("lod-meta.json");
  add("tileset.json");
  REQUIRE(files.back().bytes.ends_with("}\n"));
  files.back().bytes.pop_back();
  add("page.html");
  // Of the page, the viewer in front of the model is of no interest here.
  std::string& page = files.back().bytes;
  const std::size_t model = page.find("<script type=\"text/plain\"");
  page = "<!doctype html>\n" + page.substr(model);
  files.push_back({"packed.ply", compressedPly()});
  files.push_back({"clear.spz", SpzParts(2).whole()});
  files.push_back({"streams.spz", SpzParts(4).version4()});
  files.push_back({"floats.ksplat", KsplatParts{.level = 0, .degree = 1}.whole()});
  files.push_back({"buckets.ksplat", KsplatParts{.level = 1, .degree = 2}.whole()});
  files.push_back({"bytes.ksplat", KsplatParts{.level = 2, .degree = 2}.whole()});
  files.push_back({"a.splat", std::string(32 * 40, '\x40'), false});
  return files;
}

// "" for a sound model.
std::string messageOf(const std::filesystem::path& path) {
  try {
    checkModel(readModel(path).model, path.string());
  } catch (const Error& error) {
    const bool known = error.kind == ErrorKind::badData || error.kind == ErrorKind::cannotRead;
    return (known ? "" : "another exit code: ") + std::string(error.what());
  }
  return "";
}

}  // namespace

TEST_CASE("files of every format are refused when they end at any 512 bytes, and name themselves") {
  const Scratch scratch;
  std::set<std::string_view> cut;
  for (const HostileFile& file : goodFiles(scratch)) {
    CAPTURE(file.name);
    const auto path = scratch.folder() / ("cut_" + file.name);
    scratch.write(path.filename().string(), file.bytes);
    REQUIRE(messageOf(path) == "");
    cut.insert(detectFormat(path).name);
    std::vector<std::size_t> lengths = {0, 1, file.bytes.size() - 1};
    for (std::size_t length = 512; length < file.bytes.size(); length += 512) lengths.push_back(length);
    // What follows the model in a page is not needed to read it.
    std::size_t needed = file.bytes.size();
    if (file.name == "page.html") {
      needed = file.bytes.find(kHtmlModelEnd, file.bytes.rfind(kHtmlModelTag)) + kHtmlModelEnd.size();
      CHECK(file.bytes.size() - needed < 100);
    }
    for (const std::size_t length : lengths) {
      scratch.write(path.filename().string(), std::string_view(file.bytes).substr(0, length));
      const std::string message = messageOf(path);
      CAPTURE(length, message);
      if (message.empty()) CHECK((!file.exact || length >= needed));
      if (!message.empty()) CHECK(message.rfind(path.string() + ": ", 0) == 0);
    }
  }
  for (const Format& format : formats()) {
    INFO("goodFiles() needs a file of " << format.name);
    CHECK((!format.read || cut.contains(format.name)));
  }
}

TEST_CASE("files of every format with a bit flipped anywhere are errors or sound models") {
  const Scratch scratch;
  test::Random random(62);
  for (const HostileFile& file : goodFiles(scratch)) {
    CAPTURE(file.name);
    const std::string name = "flipped_" + file.name;
    for (int k = 0; k < 150; ++k) {
      std::string bytes = file.bytes;
      // Half of them where headers are.
      const double range = k % 2 == 0 ? static_cast<double>(std::min<std::size_t>(bytes.size(), 2048))
                                      : static_cast<double>(bytes.size());
      const auto at = static_cast<std::size_t>(random.uniform(0.0, range));
      bytes[at] = static_cast<char>(bytes[at] ^ 1 << static_cast<int>(random.uniform(0.0, 8.0)));
      const auto path = scratch.write(name, bytes);
      CAPTURE(at);
      CHECK_NOTHROW(messageOf(path));
    }
  }
}
