// SPDX-License-Identifier: Apache-2.0
// viewer/desktop: what cmake --install gives a desktop.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

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
  std::string known, line;
  while (std::getline(types, line)) known += line + ";";
  std::istringstream entry(contents("tgview.desktop"));
  std::size_t own = 0;
  while (std::getline(entry, line)) {
    if (!line.starts_with("MimeType=")) continue;
    std::istringstream named(line.substr(9));
    for (std::string type; std::getline(named, type, ';');) {
      if (!type.starts_with("application/x-")) continue;
      ++own;
      CHECK_THAT(known, Contains(type + ";"));
    }
  }
  CHECK(own == 5);
}

TEST_CASE("every format that has a MIME type of ours is read") {
  const std::string text = contents("textured-gaussians.xml");
  for (const char* name : {"tgz", "sog", "spz", "splat", "ksplat"}) {
    INFO(name);
    CHECK_THAT(text, Contains("." + std::string(name) + "\""));
    REQUIRE(findFormat(name));
    CHECK(findFormat(name)->read != nullptr);
  }
}

TEST_CASE("the icon is there in the sizes that are installed") {
  for (const int side : {48, 128, 256}) {
    const Image icon = readImage("viewer/desktop/tgview-" + std::to_string(side) + ".png");
    CHECK(icon.width == side);
    CHECK(icon.height == side);
  }
  CHECK_THAT(contents("tgview.svg"), Contains("<svg"));
}
