# SPDX-License-Identifier: Apache-2.0
# Writes FOLDER/NAME.vert and .frag with their includes, for checking, and OUT, the same without comments as a module.
#   cmake -D SOURCES=web/shaders -D SHADERS=shaders -D FOLDER=... -D OUT=... -P shaders.cmake
cmake_minimum_required(VERSION 3.24)
include(${CMAKE_CURRENT_LIST_DIR}/../cmake/inline_includes.cmake)

set(module "// SPDX-License-Identifier: Apache-2.0\n// Made from web/shaders and shaders/shared by web/shaders.cmake.\n\n")
string(APPEND module "export const SHADERS = {\n")
foreach(name splat.vert splat.frag resolve.vert resolve.frag)
  file(READ "${SOURCES}/${name}" text)
  tg_inline_includes(text)
  file(WRITE "${FOLDER}/${name}" "${text}")
  tg_without_comments(text)
  string(APPEND module "  '${name}': `${text}`,\n")
endforeach()
string(APPEND module "};\n")
file(WRITE "${OUT}" "${module}")
