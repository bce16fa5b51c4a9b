# What cmake/hide_names.cmake makes of a small library, in a folder that a shell would read otherwise: with a
# build's tools, cmake -DCOMPILER= -DFLAGS= -DNM= -DOBJCOPY= -DAR= -P tests/hide_names_test.cmake
cmake_minimum_required(VERSION 3.24)
set(folder "${CMAKE_CURRENT_BINARY_DIR}/hide_names/o'b c")
set(archive ${folder}/liba.a)
file(REMOVE_RECURSE ${folder})
file(WRITE ${folder}/a.cpp "inline int& inner() { static int number; return number; }
namespace outside { int outer() { return inner(); } }\n")

separate_arguments(own_flags UNIX_COMMAND "${FLAGS}")

# check(OBJCOPY FLAG NAMES SAID): made so, with that objcopy, the library shows these names, and the script says that.
function(check objcopy flag names said)
  file(REMOVE ${archive})
  execute_process(COMMAND ${COMPILER} ${own_flags} ${flag} -c ${folder}/a.cpp -o ${folder}/a.o
    COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND ${AR} rcs ${archive} ${folder}/a.o COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND ${CMAKE_COMMAND} -DARCHIVE=${archive} -DNAMESPACE=outside -DCOMPILER=${COMPILER}
    "-DFLAGS=${FLAGS} ${flag}" -DNM=${NM} -DOBJCOPY=${objcopy} -DAR=${AR}
    -P ${CMAKE_CURRENT_FUNCTION_LIST_DIR}/../cmake/hide_names.cmake
    ERROR_VARIABLE line COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND ${NM} --extern-only --defined-only --format=just-symbols ${archive} OUTPUT_VARIABLE found)
  string(REGEX MATCHALL "_Z[^\n]+" found "${found}")
  list(SORT found)
  if(NOT found STREQUAL names OR NOT line MATCHES "${said}")
    message(SEND_ERROR "${objcopy} ${flag}: expected \"${names}\", found \"${found}\": ${line}")
  endif()
  file(GLOB left RELATIVE ${folder} ${folder}/*)
  if(NOT left STREQUAL "a.cpp;a.o;liba.a")
    message(SEND_ERROR "left in the folder: ${left}")
  endif()
endfunction()
set(outer _ZN7outside5outerEv)
set(all "_Z5innerv;${outer};_ZZ5innervE6number")
check(${OBJCOPY} "" "${outer}" "^$")
execute_process(COMMAND ${COMPILER} ${own_flags} -m32 -c ${folder}/a.cpp -o ${folder}/a.o
  RESULT_VARIABLE failed ERROR_QUIET)
if(NOT failed)  # not every machine has 32 bits
  check(${OBJCOPY} -m32 "${outer}" "^$")
endif()
check(${CMAKE_COMMAND} "" "${all}" "^[^\n]*liba.a: inner names stay visible [^\n]*\n$")
