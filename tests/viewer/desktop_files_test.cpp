// SPDX-License-Identifier: Apache-2.0
// viewer/desktop: what cmake --install gives a desktop.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <string_view>

#include "converter/registry/file_format.h"
#include "core/image/image.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace tg;

namespace {

std::string without(const std::string& program, const std::string& package) {
  const bool there = std::system(("command -v " + program + " >/dev/null 2>&1").c_str()) == 0;
  return there ? "" : "no " + program + " (package " + package + ")";
}

std::string contents(const std::string& name) {
  std::ifstream file("viewer/desktop/" + name);
  std::stringstream text;
  text << file.rdbuf();
  REQUIRE(file);
  return text.str();
}

// Those of the desktop entry.
std::set<std::string> openedTypes() {
  std::set<std::string> types;
  std::istringstream entry(contents("tgview.desktop"));
  for (std::string line; std::getline(entry, line);) {
    if (!line.starts_with("MimeType=")) continue;
    std::istringstream named(line.substr(9));
    for (std::string type; std::getline(named, type, ';');) types.insert(type);
  }
  return types;
}

}  // namespace

TEST_CASE("the desktop entry is a valid one") {
  TG_SKIP_IF(without("desktop-file-validate", "desktop-file-utils"));
  CHECK(std::system("desktop-file-validate viewer/desktop/tgview.desktop") == 0);
}

TEST_CASE("the MIME types are valid, and those that the desktop entry names and nobody else knows are there") {
  TG_SKIP_IF(without("update-mime-database", "shared-mime-info"));
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "packages");
  std::filesystem::copy("viewer/desktop/textured-gaussians.xml", folder / "packages");
  const std::string log = (folder / "log").string();
  CHECK(std::system(("update-mime-database '" + folder.path.string() + "' >'" + log + "' 2>&1").c_str()) == 0);
  std::ifstream types(folder / "types");
  std::string known;
  for (std::string line; std::getline(types, line);) known += line + ";";
  for (const std::string& type : openedTypes()) {
    if (type.starts_with("application/x-")) CHECK_THAT(known, Contains(type + ";"));
  }
}

TEST_CASE("every format that is read has a MIME type of ours or a reason to have none") {
  const std::string text = contents("textured-gaussians.xml");
  // Of others' files, too, which have a type of their own and a program that opens them.
  const std::set<std::string_view> others = {"ply", "compressed.ply", "meta.json", "lod-meta.json", "tileset.json",
                                             "glb", "gltf",           "html"};
  for (const Format& format : formats()) {
    const std::string name(format.name);
    if (!format.read || others.contains(name)) continue;
    INFO("viewer/desktop/textured-gaussians.xml needs a type with <glob pattern=\"*."
         << name << "\"/>, or `others` here its name");
    CHECK((text.find("." + name + "\"/>") != std::string::npos || text.find("." + name + "\" ") != std::string::npos));
  }
}

TEST_CASE("what tgview is said to open is the same in its three files") {
  INFO(
      "viewer/desktop: MimeType of tgview.desktop, <mediatype> of tgview.metainfo.xml.in, and of ours, "
      "application/x-, <mime-type> of textured-gaussians.xml");
  const auto typesOf = [](const std::string& text, const std::string& begin) {
    std::set<std::string> types;
    for (std::size_t at = text.find(begin); at != std::string::npos; at = text.find(begin, at)) {
      at += begin.size();
      types.insert(text.substr(at, text.find_first_of("\"<", at) - at));
    }
    return types;
  };
  std::set<std::string> opened = openedTypes();
  CHECK(typesOf(contents("tgview.metainfo.xml.in"), "<mediatype>") == opened);
  std::erase_if(opened, [](const std::string& type) { return !type.starts_with("application/x-"); });
  CHECK(typesOf(contents("textured-gaussians.xml"), "<mime-type type=\"") == opened);
}

TEST_CASE("the icon is there in the sizes that are installed") {
  for (const int side : {48, 128, 256}) {
    const Image icon = readImage("viewer/desktop/tgview-" + std::to_string(side) + ".png");
    CHECK(icon.width == side);
    CHECK(icon.height == side);
  }
  CHECK_THAT(contents("tgview.svg"), Contains("<svg"));
}
