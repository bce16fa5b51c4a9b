# A program is built with what pkg-config says of the library in PKG_CONFIG_PATH, and draws:
# cmake -DPKG_CONFIG= -DVERSION= -DCOMPILER= -DFLAGS= -P tests/pkg_config_test.cmake
cmake_minimum_required(VERSION 3.24)
set(tree ${CMAKE_CURRENT_LIST_DIR}/..)
execute_process(COMMAND ${PKG_CONFIG} --cflags --libs "textured_gaussians = ${VERSION}" OUTPUT_VARIABLE said
  OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(said UNIX_COMMAND "${said}")  # with backslashes before the spaces of folders
separate_arguments(flags UNIX_COMMAND "${FLAGS}")
execute_process(COMMAND ${COMPILER} ${flags} -std=c++20 ${tree}/library/examples/render.cpp -o rendering ${said}
  COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ./rendering ${tree}/docs/sample.tgz rendering.png COMMAND_ERROR_IS_FATAL ANY)
