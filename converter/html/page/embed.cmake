# SPDX-License-Identifier: Apache-2.0
# Makes the page of page.html: every @FILE@ is replaced by that file, with its #include "shared/..." written out
# where it stands, once each. @TITLE@ and @PAYLOAD@ stay for html.cpp. Writes the page and, for the program, its
# bytes as a C++ source.
#   cmake -D SHADERS=... -D OUT_PAGE=... -D OUT_SOURCE=... -P embed.cmake
cmake_minimum_required(VERSION 3.24)
set(files splat.vert splat.frag resolve.vert resolve.frag sort_worker.js png.js webp.js meshopt.js glb.js camera.js
  renderer.js viewer.js style.css)

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

file(READ "${CMAKE_CURRENT_LIST_DIR}/page.html" page)
foreach(name IN LISTS files)
  file(READ "${CMAKE_CURRENT_LIST_DIR}/${name}" text)
  tg_inline_includes(text)
  if(name MATCHES "\\.(vert|frag)$")
    get_filename_component(folder "${OUT_PAGE}" DIRECTORY)
    file(WRITE "${folder}/${name}" "${text}")
  endif()
  string(REPLACE "@${name}@" "${text}" page "${page}")
endforeach()
file(WRITE "${OUT_PAGE}" "${page}")

file(READ "${OUT_PAGE}" hex HEX)
string(REGEX REPLACE "(................................................................)" "\\1\n" hex "${hex}")
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," hex "${hex}")
file(WRITE "${OUT_SOURCE}" "// Made by converter/html/page/embed.cmake.
#include \"converter/html/html.h\"
namespace tg {
namespace {
constexpr unsigned char kPage[] = {
${hex}};
}  // namespace
std::string_view htmlPage() { return {reinterpret_cast<const char*>(kPage), sizeof(kPage)}; }
}  // namespace tg
")
