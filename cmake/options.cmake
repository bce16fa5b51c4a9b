# Warnings for what this project compiles, and none for a project that links it.
set(tg_cxx $<COMPILE_LANGUAGE:C,CXX>)  # nvcc knows other options; tests compile the .cu files as C++ with these, too
add_compile_options("$<${tg_cxx}:-Wall;-Wextra;-Wshadow;-Wconversion;-Wno-sign-conversion>")
if(TG_UNITY AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  # A class of a .cpp file may hold members of its anonymous namespace; in a batch GCC takes that file for a header.
  add_compile_options($<${tg_cxx}:-Wno-subobject-linkage>)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 13)
  # It takes the entry of a table that a temporary key found for a part of the key.
  add_compile_options($<${tg_cxx}:-Wno-dangling-reference>)
endif()
if(TG_WERROR)
  add_compile_options($<${tg_cxx}:-Werror>)
endif()

# One INTERFACE target that every target of ours links: reproducible floating point, asserts, sanitizers.
add_library(tg_options INTERFACE)
# Contraction off: bit-equality is tested across thread counts and backends (docs/math.md, section "Precision").
target_compile_options(tg_options INTERFACE
  $<${tg_cxx}:-ffp-contract=off> $<$<COMPILE_LANGUAGE:CUDA>:-Xcompiler=-ffp-contract=off>)
# The programs of a build with tests check, too: the tests run them.
set(TG_ASSERTS_ON OFF)
if(TG_ASSERTS STREQUAL ON OR (TG_ASSERTS STREQUAL AUTO AND TG_TESTS))
  set(TG_ASSERTS_ON ON)
  target_compile_definitions(tg_options INTERFACE TG_ASSERTS)
endif()
if(TG_SANITIZE)
  target_compile_options(tg_options INTERFACE
    "$<${tg_cxx}:-fsanitize=${TG_SANITIZE};-fno-omit-frame-pointer;-fno-sanitize-recover=all>")
  target_link_options(tg_options INTERFACE -fsanitize=${TG_SANITIZE})
endif()
if(TG_FUZZ AND NOT TG_FUZZ STREQUAL AFL)  # AFL++'s compiler instruments by itself
  target_compile_options(tg_options INTERFACE $<${tg_cxx}:-fsanitize=fuzzer-no-link>)
  target_link_options(tg_options INTERFACE -fsanitize=fuzzer-no-link)
endif()
target_include_directories(tg_options INTERFACE ${PROJECT_SOURCE_DIR})
