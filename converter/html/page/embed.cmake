# SPDX-License-Identifier: Apache-2.0
# Makes a page of PAGE: every @FILE@ is replaced by that file, of the page's folder or one of FOLDERS, with its #include
# "shared/..." written out where it stands, once each; other words between @ stay. A .html may hold such words itself, not
# a .html of its own among them. Writes the page and, for the program,
# its bytes as a C++ source that defines FUNCTION of HEADER.
#   cmake -D PAGE=... -D FOLDERS=... -D SHADERS=... -D OUT_PAGE=... -D OUT_SOURCE=... -D HEADER=... -D FUNCTION=...
#     -P embed.cmake
cmake_minimum_required(VERSION 3.24)

# FILE(READ) into lists would trip over brackets and semicolons: text is only ever passed quoted.
function(tg_inline_includes text_variable)
  set(text "${${text_variable}}")
  set(seen "")
  while(text MATCHES "#include \"(shared/[a-z]+\\.h)\"\n")
    set(name "${CMAKE_MATCH_1}")
    set(line "${CMAKE_MATCH_0}")
    set(included "")
    if(NOT "${name}" IN_LIST seen)
      list(APPEND seen "${name}")
      file(READ "${SHADERS}/${name}" included)
    endif()
    string(FIND "${text}" "${line}" begin)
    string(LENGTH "${line}" length)
    math(EXPR end "${begin} + ${length}")
    string(SUBSTRING "${text}" 0 ${begin} before)
    string(SUBSTRING "${text}" ${end} -1 after)
    set(text "${before}${included}${after}")
  endwhile()
  set(${text_variable} "${text}" PARENT_SCOPE)
endfunction()

file(READ "${PAGE}" page)
get_filename_component(own_folder "${PAGE}" DIRECTORY)
foreach(extension html "[a-z]+")
  string(REGEX MATCHALL "@[a-z_]+\\.${extension}@" markers "${page}")
  foreach(marker IN LISTS markers)
    string(REPLACE "@" "" name "${marker}")
    unset(file CACHE)
    find_file(file "${name}" PATHS ${own_folder} ${FOLDERS} NO_DEFAULT_PATH REQUIRED)
    file(READ "${file}" text)
    tg_inline_includes(text)
    if(name MATCHES "\\.(vert|frag)$")
      get_filename_component(folder "${OUT_PAGE}" DIRECTORY)
      file(WRITE "${folder}/${name}" "${text}")
    endif()
    string(REPLACE "@${name}@" "${text}" page "${page}")
  endforeach()
endforeach()
file(WRITE "${OUT_PAGE}" "${page}")

file(READ "${OUT_PAGE}" hex HEX)
string(REGEX REPLACE "(................................................................)" "\\1\n" hex "${hex}")
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," hex "${hex}")
file(WRITE "${OUT_SOURCE}" "// Made by converter/html/page/embed.cmake.
#include \"${HEADER}\"
namespace tg {
namespace {
constexpr unsigned char kPage[] = {
${hex}};
}  // namespace
std::string_view ${FUNCTION}() { return {reinterpret_cast<const char*>(kPage), sizeof(kPage)}; }
}  // namespace tg
")
