# SPDX-License-Identifier: Apache-2.0
# Makes a page of PAGE: every @FILE@ is replaced by that file, of the page's folder or one of FOLDERS; other words between
# @ stay. A .html may hold such words itself, not a .html of its own among them. ES modules become parts of one script:
# without their imports, with what they export for all to use. Writes the page and, for the program, its bytes as a C++
# source that defines FUNCTION of HEADER.
#   cmake -D PAGE=... -D FOLDERS=... -D OUT_PAGE=... -D OUT_SOURCE=... -D HEADER=... -D FUNCTION=... -P embed_page.cmake
cmake_minimum_required(VERSION 3.24)

file(READ "${PAGE}" page)
get_filename_component(own_folder "${PAGE}" DIRECTORY)
foreach(extension html "[a-z]+")
  string(REGEX MATCHALL "@[a-z_]+\\.${extension}@" markers "${page}")
  foreach(marker IN LISTS markers)
    string(REPLACE "@" "" name "${marker}")
    unset(file CACHE)
    find_file(file "${name}" PATHS ${own_folder} ${FOLDERS} NO_DEFAULT_PATH REQUIRED)
    file(READ "${file}" text)
    if(name MATCHES "\\.js$")
      # The forms that tests/web/modules_test.py allows.
      string(REGEX REPLACE "\nimport {[^}]*} from '\\./[a-z_]+\\.js';" "" text "${text}")
      string(REGEX REPLACE "\nexport (const|function|class|async)" "\n\\1" text "${text}")
      string(REGEX REPLACE "(^|\n)([ ]*//[^\n]*\n)+" "\\1" text "${text}")
      string(REGEX REPLACE "\n[ \n]+" "\n" text "${text}")
    endif()
    string(REPLACE "@${name}@" "${text}" page "${page}")
  endforeach()
endforeach()
file(WRITE "${OUT_PAGE}" "${page}")

file(READ "${OUT_PAGE}" hex HEX)
string(REGEX REPLACE "(................................................................)" "\\1\n" hex "${hex}")
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," hex "${hex}")
file(WRITE "${OUT_SOURCE}" "// Made by cmake/embed_page.cmake.
#include \"${HEADER}\"
namespace tg {
namespace {
constexpr unsigned char kPage[] = {
${hex}};
}  // namespace
std::string_view ${FUNCTION}() { return {reinterpret_cast<const char*>(kPage), sizeof(kPage)}; }
}  // namespace tg
")
