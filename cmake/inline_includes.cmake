# SPDX-License-Identifier: Apache-2.0
# tg_inline_includes(TEXT_VARIABLE): writes every #include "shared/..." of a shader's text out where it stands, once
# each; SHADERS is the folder that holds shared/. tg_without_comments(TEXT_VARIABLE): of shaders, for machines to read.

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

function(tg_without_comments text_variable)
  string(REGEX REPLACE "[ ]*//[^\n]*" "" text "${${text_variable}}")
  string(REGEX REPLACE "\n([ ]*\n)+" "\n" text "${text}")
  set(${text_variable} "${text}" PARENT_SCOPE)
endfunction()
