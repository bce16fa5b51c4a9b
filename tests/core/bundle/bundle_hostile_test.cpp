// SPDX-License-Identifier: Apache-2.0
// model.tgz from a stranger: every refusal of docs/bundle.md, each from an archive made for it.
#include <sys/stat.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "core/bundle/bundle.h"
#include "core/bundle/ply.h"
#include "core/file/file.h"
#include "core/file/sha256.h"
#include "core/system/error.h"
#include "core/tar_file.h"
#include "core/tiny_model.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using Bytes = std::vector<std::uint8_t>;
using tg::TarEntry;

namespace {

Bytes toBytes(const std::string& text) { return {text.begin(), text.end()}; }

// Without the sync to disk that makes thousands of small files slow.
void writeQuickly(const std::filesystem::path& path, std::span<const std::uint8_t> bytes) {
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

// A valid archive to break, and a file to write it to.
struct Archive {
  tg::TemporaryFolder folder;
  std::filesystem::path file = folder / "a.tgz";
  std::vector<TarEntry> entries;

  explicit Archive(std::size_t gaussians = 4) {
    tg::Bundle bundle;
    bundle.model = tg::tinyTexturedModel(gaussians);
    bundle.cameras.push_back(tg::lookAt({1, 2, 3}, {0, 0, 0}, {0, -1, 0}, 0.7, 64, 48));
    bundle.training_json = "{}";
    bundle.preview = tg::Image(2, 2, 3, 0.2f);
    tg::writeBundle(file, bundle);
    entries = tg::readTar(file);
  }
  TarEntry& at(const std::string& name) {
    for (TarEntry& entry : entries) {
      if (entry.name == name) return entry;
    }
    throw std::runtime_error("no entry " + name);
  }
  nlohmann::json manifest() { return nlohmann::json::parse(at("manifest.json").bytes); }
  void setManifest(const nlohmann::json& json) { at("manifest.json").bytes = toBytes(json.dump()); }
  // Makes the manifest agree again with what the entries hold.
  void relist() {
    nlohmann::json json = manifest();
    for (nlohmann::json& listed : json["files"]) {
      const Bytes& bytes = at(listed["name"]).bytes;
      listed["bytes"] = bytes.size();
      listed["sha256"] = tg::sha256Hex(bytes);
    }
    setManifest(json);
  }
  void add(const std::string& name, char type = '0', const std::string& link = "") {
    TarEntry entry;
    entry.name = name;
    entry.type = type;
    entry.link = link;
    entries.push_back(entry);
  }
  tg::Bundle read(const tg::BundleLimits& limits = {}) {
    writeQuickly(file, tg::gzip(tg::formatTar(entries)));
    return tg::readBundle(file, limits);
  }
};

// One Gaussian and its manifest: about 1 kB.
std::vector<TarEntry> smallestEntries(const std::filesystem::path& file) {
  tg::Bundle bundle;
  bundle.model = tg::tinyModel(1, 0);
  tg::writeBundle(file, bundle);
  return tg::readTar(file);
}

// Applies `change` to the manifest of a fresh archive and reads it.
void readWithManifest(const std::function<void(nlohmann::json&)>& change) {
  Archive archive;
  nlohmann::json json = archive.manifest();
  change(json);
  archive.setManifest(json);
  archive.read();
}

}  // namespace

TEST_CASE("the archive these tests break is valid before") {
  Archive archive;
  archive.relist();
  REQUIRE(archive.read().warnings.empty());
}

TEST_CASE("names that could leave a folder are refused") {
  for (const char* name :
       {"/etc/passwd", "../a", "a/../b", "..", "./manifest.json", ".", "a//b", "a/.", "a\\b", "C:evil", "c:\\evil"}) {
    INFO(name);
    Archive archive;
    archive.add(name);
    REQUIRE_THROWS_WITH(archive.read(), Contains("name "));
  }
  {
    Archive archive;
    archive.add("//");  // a name that ends in a slash is a folder, whatever its type flag says
    REQUIRE_THROWS_WITH(archive.read(), Contains("is a folder"));
  }
  // 256 bytes, by way of a pax header.
  Archive archive;
  const std::string path = std::string(250, 'a') + "/bcdef";
  TarEntry pax;
  pax.name = "pax";
  pax.type = 'x';
  pax.bytes = toBytes("266 path=" + path + "\n");
  REQUIRE(pax.bytes.size() == 266);
  archive.entries.push_back(pax);
  archive.add("short");
  REQUIRE_THROWS_WITH(archive.read(), Contains("name is longer than 255 bytes"));
}

TEST_CASE("names that are not UTF-8 are refused") {
  const char* const broken[] = {"\xff\xfe", "\xe6\x97", "\xe6-\xa5", "\xf0\x9f\x8e", "\xf0-\x8e\xa8"};
  const char* const longer[] = {"\xc0\xaf", "\xe0\x9f\xbf", "\xf0\x8f\xbf\xbf"};  // than need be
  const char* const beyond[] = {"\xed\xa0\x80", "\xf4\x90\x80\x80"};              // U+D800, U+110000
  for (const std::span<const char* const> names : {std::span<const char* const>(broken), {longer}, {beyond}}) {
    for (const char* name : names) {
      Archive archive;
      archive.add(name);
      REQUIRE_THROWS_WITH(archive.read(), Contains("is not UTF-8"));
    }
  }
  Archive archive;
  for (const char* name : {"ä", "日本", "🎨", "\xe0\xa0\x80", "\xed\x9f\xbf", "\xf4\x8f\xbf\xbf"}) archive.add(name);
  REQUIRE(archive.read().warnings.size() == 6);  // that nobody knows them
}

TEST_CASE("a pax header cannot smuggle a name past the checks") {
  for (const char* path : {"../up", "/abs"}) {
    Archive archive;
    TarEntry pax;
    pax.name = "pax";
    pax.type = 'x';
    const std::string record = std::string(" path=") + path + "\n";
    pax.bytes = toBytes(std::to_string(record.size() + 2) + record);
    archive.entries.push_back(pax);
    archive.add("harmless");
    REQUIRE_THROWS_WITH(archive.read(), Contains("name "));
  }
}

TEST_CASE("links, folders, devices, pipes and sparse files are refused, whatever they are called") {
  struct Kind {
    char type;
    const char* word;
  };
  for (const Kind& kind : {Kind{'1', "hard link"},
                           {'2', "symbolic link"},
                           {'3', "device"},
                           {'4', "device"},
                           {'5', "folder"},
                           {'6', "pipe"}}) {
    INFO(kind.word);
    Archive archive;
    archive.add("extra", kind.type, "/etc/passwd");
    REQUIRE_THROWS_WITH(archive.read(), Contains(kind.word));
    Archive known;
    known.at("training.json").type = kind.type;
    known.at("training.json").bytes.clear();
    known.at("training.json").link = "manifest.json";
    REQUIRE_THROWS_AS(known.read(), tg::Error);
  }
  // GNU's old sparse header: 2 bytes of data at offset 512 of a file of 514.
  Archive sparse;
  TarEntry& entry = sparse.at("training.json");
  entry.type = 'S';
  entry.magic = std::string("ustar  \0", 8);
  entry.sparse_map = std::string(
      "00000001000\0"
      "00000000002\0",
      24);
  entry.real_size = std::string("00000001002\0", 12);
  REQUIRE_THROWS_WITH(sparse.read(), Contains("sparse file"));
}

TEST_CASE("names that are there twice are refused, also when only their case differs") {
  for (const char* name : {"training.json", "Training.JSON", "manifest.json"}) {
    Archive archive;
    archive.add(name);
    REQUIRE_THROWS_WITH(archive.read(), Contains("is there twice"));
  }
}

TEST_CASE("an entry that takes a listed name in another case does not stand in for it") {
  Archive archive;
  archive.at("atlas_000.exr").name = "ATLAS_000.exr";
  REQUIRE_THROWS_WITH(archive.read(), Contains("lacks \"atlas_000.exr\""));
}

TEST_CASE("broken tar headers are refused") {
  Archive checksum;
  checksum.at("gaussians.ply").bad_checksum = true;
  REQUIRE_THROWS_AS(checksum.read(), tg::Error);
  for (const std::string& size : {std::string("\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff", 12),  // base-256: -1
                                  std::string("\x80\x00\x00\x00\x7f\xff\xff\xff\xff\xff\xff\xff", 12),  // 2^63 - 1
                                  std::string("77777777777\0", 12),                                     // 8 GiB - 1
                                  std::string("zzzzzzzzzzz\0", 12)}) {
    Archive archive;
    archive.at("gaussians.ply").raw_size = size;
    REQUIRE_THROWS_AS(archive.read(), tg::Error);
  }
}

TEST_CASE("any changed byte of the first tar header gives a model or tg::Error") {
  tg::TemporaryFolder folder;
  const Bytes tar = tg::formatTar(smallestEntries(folder / "a.tgz"));
  for (std::size_t i = 0; i < 512; ++i) {
    for (const std::uint8_t change : {std::uint8_t{0x01}, std::uint8_t{0xff}}) {
      Bytes bad = tar;
      bad[i] ^= change;
      writeQuickly(folder / "a.tgz", tg::gzip(bad, 1));
      try {
        tg::readBundle(folder / "a.tgz");
      } catch (const tg::Error&) {
      }
    }
  }
}

TEST_CASE("limits on entries and bytes hold before anything is allocated") {
  Archive archive;
  tg::BundleLimits limits;
  limits.entries = static_cast<int>(archive.entries.size());
  REQUIRE_NOTHROW(archive.read(limits));
  limits.entries -= 1;
  REQUIRE_THROWS_WITH(archive.read(limits), Contains("too many entries"));
  limits = {};
  limits.entry_bytes = archive.at("gaussians.ply").bytes.size() - 1;
  REQUIRE_THROWS_WITH(archive.read(limits), Contains("exceeds the limits"));
  limits = {};
  limits.total_bytes = 0;
  for (const TarEntry& entry : archive.entries) limits.total_bytes += entry.bytes.size();
  REQUIRE_NOTHROW(archive.read(limits));
  limits.total_bytes -= 1;
  REQUIRE_THROWS_WITH(archive.read(limits), Contains("exceeds the limits"));
  limits = {};
  const nlohmann::json atlas = archive.manifest()["atlas"];
  limits.max_texels = atlas["width"].get<std::uint64_t>() * atlas["height"].get<std::uint64_t>();
  REQUIRE_NOTHROW(archive.read(limits));
  limits.max_texels -= 1;
  REQUIRE_THROWS_WITH(archive.read(limits), Contains("too many texels"));
}

TEST_CASE("a gzip bomb is refused") {
  tg::TemporaryFolder folder;
  std::vector<TarEntry> entries = smallestEntries(folder / "a.tgz");
  entries.emplace_back();
  entries.back().name = "zeros";
  entries.back().bytes.resize(std::size_t{64} << 20);
  writeQuickly(folder / "a.tgz", tg::gzip(tg::formatTar(entries), 6));
  REQUIRE_THROWS_WITH(tg::readBundle(folder / "a.tgz"), Contains("inflates more than 1000 : 1"));
}

TEST_CASE("an entry cannot claim more bytes than the file can hold") {
  Archive archive;
  archive.at("gaussians.ply").raw_size = std::string("00400000000\0", 12);  // 64 MiB
  nlohmann::json json = archive.manifest();
  json["files"][0]["bytes"] = 64 << 20;
  archive.setManifest(json);
  REQUIRE_THROWS_WITH(archive.read(), Contains("longer than the file can hold"));
}

TEST_CASE("an archive cut at every 64 bytes is refused") {
  Archive archive;
  const Bytes whole = tg::readFile(archive.file, 1 << 20);
  for (std::size_t length = 0; length < whole.size(); length += 64) {
    writeQuickly(archive.file, std::span(whole).first(length));
    REQUIRE_THROWS_AS(tg::readBundle(archive.file), tg::Error);
  }
  // And inside the gzip trailer.
  for (std::size_t missing = 1; missing <= 8; ++missing) {
    writeQuickly(archive.file, std::span(whole).first(whole.size() - missing));
    REQUIRE_THROWS_WITH(tg::readBundle(archive.file), Contains("gzip stream ends early"));
  }
}

TEST_CASE("a tar cut at every 64 bytes inside a whole gzip stream is refused") {
  Archive archive;
  const Bytes tar = tg::formatTar(archive.entries);
  for (std::size_t length = 0; length + 1024 < tar.size(); length += 64) {
    writeQuickly(archive.file, tg::gzip({tar.begin(), tar.begin() + static_cast<std::ptrdiff_t>(length)}, 1));
    REQUIRE_THROWS_AS(tg::readBundle(archive.file), tg::Error);
  }
}

TEST_CASE("a wrong gzip checksum or length is refused") {
  Archive archive;
  const Bytes whole = tg::readFile(archive.file, 1 << 20);
  for (std::size_t i = whole.size() - 8; i < whole.size(); ++i) {
    Bytes bad = whole;
    bad[i] ^= 1;
    writeQuickly(archive.file, bad);
    REQUIRE_THROWS_WITH(tg::readBundle(archive.file), Contains("broken gzip stream"));
  }
}

TEST_CASE("bytes after the gzip stream are ignored with a warning") {
  Archive archive;
  Bytes bytes = tg::readFile(archive.file, 1 << 20);
  bytes.push_back('x');
  writeQuickly(archive.file, bytes);
  const tg::Bundle bundle = tg::readBundle(archive.file);
  REQUIRE(bundle.warnings.size() == 1);
  REQUIRE_THAT(bundle.warnings[0], Catch::Matchers::StartsWith("ignored bytes after the end"));
}

TEST_CASE("a bundle in several gzip streams, as parallel compressors make them, is read") {
  const tg::TemporaryFolder folder;
  const Archive archive;
  const Bytes tar = tg::formatTar(archive.entries);
  const std::size_t half = tar.size() / 2;
  Bytes bytes = tg::gzip({tar.begin(), tar.begin() + static_cast<std::ptrdiff_t>(half)});
  const Bytes nothing = tg::gzip({}), rest = tg::gzip({tar.begin() + static_cast<std::ptrdiff_t>(half), tar.end()});
  bytes.insert(bytes.end(), nothing.begin(), nothing.end());
  bytes.insert(bytes.end(), rest.begin(), rest.end());
  writeQuickly(folder / "a.tgz", bytes);
  const tg::Bundle bundle = tg::readBundle(folder / "a.tgz");
  CHECK(bundle.warnings.empty());
  CHECK(bundle.model.size() == tg::readBundle(archive.file).model.size());
  bytes.pop_back();
  writeQuickly(folder / "a.tgz", bytes);
  CHECK_THROWS_WITH(tg::readBundle(folder / "a.tgz"), Contains("gzip stream ends early"));
}

TEST_CASE("files that are no gzip, empty files and folders are refused") {
  const tg::TemporaryFolder folder;
  writeQuickly(folder / "a.tgz", toBytes("ply\n"));
  REQUIRE_THROWS_AS(tg::readBundle(folder / "a.tgz"), tg::Error);
  writeQuickly(folder / "a.tgz", Bytes{});
  REQUIRE_THROWS_WITH(tg::readBundle(folder / "a.tgz"), Contains("is empty"));
  writeQuickly(folder / "a.tgz", tg::gzip({}));
  REQUIRE_THROWS_AS(tg::readBundle(folder / "a.tgz"), tg::Error);
  writeQuickly(folder / "a.tgz", tg::gzip(tg::formatTar({})));
  REQUIRE_THROWS_WITH(tg::readBundle(folder / "a.tgz"), Contains("empty archive"));
  for (const std::string name : {"", "nothing.tgz"}) {
    try {
      tg::readBundle(folder / name);
      FAIL("expected an error");
    } catch (const tg::Error& e) {
      REQUIRE(e.kind == tg::ErrorKind::cannotRead);
    }
  }
}

TEST_CASE("a pipe or a device in the place of a bundle is refused, not waited for") {
  const tg::TemporaryFolder folder;
  REQUIRE(::mkfifo((folder / "a.tgz").c_str(), 0600) == 0);
  std::filesystem::create_symlink("/dev/zero", folder / "b.tgz");
  for (const std::string name : {"a.tgz", "b.tgz"}) {
    REQUIRE_THROWS_WITH(tg::readBundle(folder / name), Contains(name + ": is no regular file"));
  }
}

TEST_CASE("the manifest must come first, be short and nest little") {
  Archive order;
  std::swap(order.entries[0], order.entries[1]);
  REQUIRE_THROWS_WITH(order.read(),
                      Contains("wrong first entry (expected \"manifest.json\", found \"gaussians.ply\")"));
  Archive size;
  size.at("manifest.json").bytes.resize((1 << 20) + 1, ' ');
  REQUIRE_THROWS_WITH(size.read(), Contains("is too long (expected at most 1048576 bytes"));
  Archive depth;
  depth.at("manifest.json").bytes = toBytes("{\"a\":" + std::string(100000, '[') + std::string(100000, ']') + "}");
  REQUIRE_THROWS_WITH(depth.read(), Contains("JSON nests too deep"));
  for (const char* text : {"", "null", "[]", "{", "{}", "\xff", "{\"format\": 7}", "{\"format\": \"zip\"}"}) {
    Archive archive;
    archive.at("manifest.json").bytes = toBytes(text);
    REQUIRE_THROWS_WITH(archive.read(), Contains("a.tgz/manifest.json: "));
  }
}

TEST_CASE("a manifest that asks for what this program cannot show is refused by key") {
  const auto refused = [](const char* key, const nlohmann::json& value) {
    INFO(key);
    REQUIRE_THROWS_WITH(readWithManifest([&](nlohmann::json& m) { m[key] = value; }), Contains("manifest.json: "));
    REQUIRE_THROWS_WITH(readWithManifest([&](nlohmann::json& m) { m.erase(key); }), Contains("manifest.json: "));
  };
  refused("format", "other");
  refused("formatVersion", "2.0");
  refused("extent", 2.5);
  refused("filter", "nearest");
  refused("sampling", "center");
  refused("uvOrder", "other");
  refused("axes", "luf");
  refused("colorSpace", "lin_rec709_display");
  refused("antialias", "mip");
  refused("mode", "rgbx");
  refused("intersection", "sphere");
  refused("shDegree", 4);
  refused("background", {0, 0});
  refused("background", {0, 0, "x"});
  refused("background", {0, 0, 1e300});
  refused("counts", 3);
  refused("atlas", nlohmann::json::object());
  refused("files", 3);
  REQUIRE_THROWS_WITH(readWithManifest([](nlohmann::json& m) { m["outside"] = "skip"; }),
                      Contains("manifest.json: \"outside\": expected base, clip or edge, found \"skip\""));
  REQUIRE_THROWS_WITH(readWithManifest([](nlohmann::json& m) { m["outside"] = 1; }), Contains("\"outside\""));
  REQUIRE_THROWS_WITH(readWithManifest([](nlohmann::json& m) { m["atlas"]["channels"] = {"R", "G", "B", "A"}; }),
                      Contains("\"channels\": not supported (expected [\"R\",\"G\",\"B\",\"alpha\"], found "));
  REQUIRE_THROWS_WITH(readWithManifest([](nlohmann::json& m) { m["atlas"]["associatedAlpha"] = true; }),
                      Contains("\"associatedAlpha\": not supported (expected false, found true)"));
  REQUIRE_NOTHROW(readWithManifest([](nlohmann::json& m) { m["atlas"].erase("channels"); }));
  REQUIRE_NOTHROW(readWithManifest([](nlohmann::json& m) { m["formatVersion"] = "1.7", m["news"] = true; }));
}

TEST_CASE("the page of the format says of every key of a file whether a reader needs it") {
  // The rows of docs/bundle.md from heading `from` to heading `to`: keys in backticks, then "yes" or "no".
  const auto rowsOf = [](const std::string& from, const std::string& to) {
    std::ifstream page("docs/bundle.md");
    std::map<std::string, bool> required;
    std::string line;
    while (std::getline(page, line) && line != from) continue;
    while (std::getline(page, line) && line != to) {
      if (!line.starts_with("| `")) continue;
      const std::string keys = line.substr(0, line.find(" | "));
      const bool needed = line.substr(keys.size() + 3).starts_with("yes");
      for (std::size_t at = 0; (at = keys.find('`', at)) != std::string::npos;) {
        const std::size_t end = keys.find('`', at + 1);
        required[keys.substr(at + 1, end - at - 1)] = needed;
        at = end + 1;
      }
    }
    return required;
  };
  using Json = nlohmann::json;
  // Drops each key of an object in turn, reads, and ticks its row off. `prefix`: what the page writes before the key.
  const auto check = [](std::map<std::string, bool>& rows, Json& object, const std::string& prefix,
                        const std::function<void()>& read) {
    const Json whole = object;
    for (const auto& item : whole.items()) {
      if (item.key() == "counts" || item.key() == "atlas" || item.key() == "files") continue;
      INFO(prefix << item.key());
      const auto row = rows.find(prefix + item.key());
      REQUIRE(row != rows.end());
      object.erase(item.key());
      if (row->second) {
        CHECK_THROWS_AS(read(), tg::Error);
      } else {
        CHECK_NOTHROW(read());
      }
      rows.erase(row);
      object = whole;
    }
  };
  {
    Archive archive;
    Json json = archive.manifest();
    std::map<std::string, bool> rows = rowsOf("## manifest.json", "## gaussians.ply");
    const auto read = [&] {
      archive.setManifest(json);
      archive.read();
    };
    check(rows, json, "", read);
    check(rows, json["counts"], "counts.", read);
    check(rows, json["atlas"], "atlas.", read);
    check(rows, json["files"][0], "files[].", read);
    CHECK(rows.empty());
  }
  Archive archive;
  Json cameras = Json::parse(archive.at("cameras.json").bytes);
  std::map<std::string, bool> rows = rowsOf("## cameras.json", "## Bytes");
  check(rows, cameras[0], "", [&] {
    archive.at("cameras.json").bytes = toBytes(cameras.dump());
    archive.relist();
    archive.read();
  });
  CHECK(rows.empty());
}

TEST_CASE("counts that disagree are refused") {
  for (const char* key : {"gaussians", "atlasPages", "cameras"}) {
    for (const nlohmann::json& value : {nlohmann::json(0), nlohmann::json(5), nlohmann::json(-1), nlohmann::json(1.5),
                                        nlohmann::json(1e18), nlohmann::json("4")}) {
      INFO(key << " " << value);
      REQUIRE_THROWS_AS(readWithManifest([&](nlohmann::json& m) { m["counts"][key] = value; }), tg::Error);
    }
  }
  REQUIRE_THROWS_WITH(readWithManifest([](nlohmann::json& m) { m["shDegree"] = 2; }), Contains("SH degree"));
  REQUIRE_THROWS_WITH(readWithManifest([](nlohmann::json& m) { m["atlas"]["width"] = 4; }), Contains("its size"));
  REQUIRE_THROWS_AS(readWithManifest([](nlohmann::json& m) { m["atlas"]["width"] = 4097; }), tg::Error);
}

TEST_CASE("the file table is held against the entries") {
  const auto file = [](nlohmann::json& m, std::size_t i) -> nlohmann::json& { return m["files"][i]; };
  REQUIRE_THROWS_WITH(readWithManifest([&](nlohmann::json& m) { file(m, 0)["bytes"] = 7; }), Contains("its bytes"));
  REQUIRE_THROWS_WITH(readWithManifest([&](nlohmann::json& m) { file(m, 0)["sha256"] = std::string(64, '0'); }),
                      Contains("gaussians.ply: is damaged"));
  REQUIRE_THROWS_WITH(readWithManifest([&](nlohmann::json& m) { file(m, 0)["sha256"] = "abc"; }), Contains("sha256"));
  REQUIRE_THROWS_WITH(readWithManifest([&](nlohmann::json& m) { m["files"].push_back(file(m, 0)); }),
                      Contains("is listed twice"));
  REQUIRE_THROWS_WITH(readWithManifest([&](nlohmann::json& m) { m["files"].erase(5); }), Contains("is not listed"));
  REQUIRE_THROWS_WITH(readWithManifest([&](nlohmann::json& m) { m["files"].erase(0); }),
                      Contains("lacks gaussians.ply"));
  REQUIRE_THROWS_WITH(readWithManifest([&](nlohmann::json& m) { m["files"].erase(1); }), Contains("belong together"));
  REQUIRE_THROWS_WITH(readWithManifest([&](nlohmann::json& m) { m["files"].erase(1), m["files"].erase(1); }),
                      Contains("lacks rects.npy"));
  REQUIRE_THROWS_WITH(readWithManifest([&](nlohmann::json& m) { m["files"].erase(3); }),
                      Contains("lacks atlas_000.exr"));
  for (const char* name : {"gaussians.ply", "rects.npy", "atlas_id.npy", "atlas_000.exr", "cameras.json"}) {
    Archive archive;
    std::erase_if(archive.entries, [&](const TarEntry& e) { return e.name == name; });
    REQUIRE_THROWS_WITH(archive.read(), Contains(std::string("lacks \"") + name));
  }
  Archive flipped;
  flipped.at("atlas_000.exr").bytes[400] ^= 1;
  REQUIRE_THROWS_WITH(flipped.read(), Contains("a.tgz/atlas_000.exr: is damaged"));
}

TEST_CASE("entries of unknown names are skipped with a warning") {
  Archive archive;
  archive.add("notes/readme.txt");
  archive.entries.back().bytes = toBytes("hello");
  archive.add("atlas_255.exr");
  archive.add("evil\n\x1b[31m.txt");
  const tg::Bundle bundle = archive.read();
  REQUIRE(bundle.warnings.size() == 3);
  REQUIRE_THAT(bundle.warnings[0], Contains("skipped unknown entry \"notes/readme.txt\""));
  REQUIRE_THAT(bundle.warnings[2], Contains("\"evil??[31m.txt\""));
}

TEST_CASE("rectangles outside of their page, on missing pages, or overlapping without end are refused") {
  // The data of rects.npy starts at byte 128: x, y, w, h of Gaussian 0.
  const auto withRect = [](std::size_t component, std::uint16_t value) {
    Archive archive;
    std::memcpy(archive.at("rects.npy").bytes.data() + 128 + 2 * component, &value, 2);
    archive.relist();
    archive.read();
  };
  REQUIRE_THROWS_WITH(withRect(0, 65535), Contains("Gaussian 0: texture rectangle leaves its page"));
  REQUIRE_THROWS_WITH(withRect(1, 4000), Contains("Gaussian 0: texture rectangle leaves its page"));
  REQUIRE_THROWS_WITH(withRect(2, 65535), Contains("Gaussian 0: texture rectangle leaves its page"));
  REQUIRE_THROWS_WITH(withRect(3, 0), Contains("Gaussian 0: texture rectangle has one empty side"));
  Archive page;
  page.at("atlas_id.npy").bytes[128] = 1;
  page.relist();
  REQUIRE_THROWS_WITH(page.read(), Contains("Gaussian 0: texture rectangle lies on a missing page"));
  Archive overlap;
  const nlohmann::json atlas = overlap.manifest()["atlas"];
  const std::uint16_t whole[4] = {0, 0, atlas["width"], atlas["height"]};
  for (std::size_t i = 0; i < 4; ++i) std::memcpy(overlap.at("rects.npy").bytes.data() + 128 + 8 * i, whole, 8);
  overlap.relist();
  REQUIRE_THROWS_WITH(overlap.read(), Contains("Gaussian 1: texture rectangles overlap"));
}

TEST_CASE("NumPy arrays of another type, shape or length are refused") {
  const auto withHeader = [](const std::string& from, const std::string& to) {
    Archive archive;
    Bytes& bytes = archive.at("rects.npy").bytes;
    const auto found = std::search(bytes.begin(), bytes.end(), from.begin(), from.end());
    REQUIRE(found != bytes.end());
    std::copy(to.begin(), to.end(), found);
    archive.relist();
    archive.read();
  };
  REQUIRE_THROWS_WITH(withHeader("<u2", "<i2"), Contains("rects.npy: wrong NumPy array"));
  REQUIRE_THROWS_WITH(withHeader("<u2", ">u2"), Contains("rects.npy: wrong NumPy array"));
  REQUIRE_THROWS_WITH(withHeader("False", "True "), Contains("rects.npy: wrong NumPy array"));
  REQUIRE_THROWS_WITH(withHeader("(4, 4)", "(5, 4)"), Contains("rects.npy: wrong NumPy array"));
  REQUIRE_THROWS_WITH(withHeader("NUMPY\x01", "NUMPY\x02"), Contains("not a NumPy file"));
  Archive shorter;
  shorter.at("rects.npy").bytes.pop_back();
  shorter.relist();
  REQUIRE_THROWS_WITH(shorter.read(), Contains("wrong length of NumPy data"));
  Archive header;
  header.at("rects.npy").bytes.resize(20);
  header.relist();
  REQUIRE_THROWS_WITH(header.read(), Contains("NumPy header ends early"));
}

TEST_CASE("atlas pages with another size, other channels or impossible values are refused") {
  const auto withPage = [](const tg::Image& image, const std::vector<std::string>& channels) {
    Archive archive;
    archive.at("atlas_000.exr").bytes = tg::encodeExr(image, channels);
    archive.relist();
    archive.read();
  };
  Archive archive;
  const int width = archive.manifest()["atlas"]["width"], height = archive.manifest()["atlas"]["height"];
  const std::vector<std::string> ours = {"R", "G", "B", "alpha"};
  REQUIRE_NOTHROW(withPage(tg::Image(width, height, 4, 0.5f), ours));
  REQUIRE_THROWS_WITH(withPage(tg::Image(width + 1, height, 4, 0.5f), ours),
                      Contains("disagrees with the manifest on its size"));
  REQUIRE_THROWS_WITH(withPage(tg::Image(width, height, 4, 0.5f), {"R", "G", "B", "A"}), Contains("missing channel"));
  REQUIRE_THROWS_WITH(withPage(tg::Image(width, height, 4, 1.5f), ours),
                      Contains("Gaussian 0: texel 0 has an alpha outside"));
  REQUIRE_THROWS_WITH(withPage(tg::Image(width, height, 4, NAN), ours), Contains("Gaussian 0: texel 0 is not finite"));
  Bytes& page = archive.at("atlas_000.exr").bytes;
  const std::string attribute("tg:associated\0int\0\4\0\0\0", 22);
  const auto value = std::ranges::search(page, attribute).end();
  REQUIRE(value != page.end());
  *value = 1;
  archive.relist();
  REQUIRE_THROWS_WITH(archive.read(), Contains("atlas_000.exr: attribute tg:associated: not supported (expected 0"));
}

TEST_CASE("a preview that is large, has no colour or is no PNG is refused") {
  const auto withPreview = [](const Bytes& bytes) {
    Archive archive;
    archive.at("preview.png").bytes = bytes;
    archive.relist();
    archive.read();
  };
  REQUIRE_THROWS_WITH(withPreview(tg::encodePng(tg::Image(513, 1, 3))),
                      Contains("preview.png: image size out of range"));
  REQUIRE_THROWS_WITH(withPreview(tg::encodePng(tg::Image(4, 4, 1))),
                      Contains("preview.png: wrong number of channels"));
  REQUIRE_THROWS_WITH(withPreview(toBytes("\xff\xd8\xff")), Contains("preview.png: not a PNG file"));
  Bytes cut = tg::encodePng(tg::Image(2, 2, 3, 0.2f));
  cut.resize(23);  // a byte less than width and height end with
  REQUIRE_THROWS_WITH(withPreview(cut), Contains("preview.png: not a PNG file"));
}

TEST_CASE("broken PLY, cameras and training entries are refused under the entry's name") {
  const auto withEntry = [](const std::string& name, const std::string& text) {
    Archive archive;
    archive.at(name).bytes = toBytes(text);
    archive.relist();
    archive.read();
  };
  REQUIRE_THROWS_WITH(withEntry("gaussians.ply", "hello"), Contains("a.tgz/gaussians.ply: not a PLY file"));
  REQUIRE_THROWS_WITH(withEntry("cameras.json", "[{\"img_name\": 3}]"),
                      Contains("a.tgz/cameras.json: camera 0: \"img_name\""));
  REQUIRE_THROWS_WITH(withEntry("cameras.json", "[]"),
                      Contains("a.tgz/cameras.json: disagrees with the manifest on cameras"));
  REQUIRE_THROWS_WITH(withEntry("training.json", "[]"), Contains("a.tgz/training.json: expected a JSON object"));
  REQUIRE_THROWS_WITH(withEntry("training.json", "{"), Contains("a.tgz/training.json: not valid JSON"));
}
