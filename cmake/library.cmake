# How sources become libraries and programs, but for what tg_options says.
tg_switch(TG_UNITY ON "Compile the sources of a target in batches: a cold build takes about half the time")
set(CMAKE_UNITY_BUILD ${TG_UNITY})
set(CMAKE_UNITY_BUILD_BATCH_SIZE 8)

# -O2 where nobody asks for more or less (tg_optimize): instead of CMake's own choice, not of a user's.
if(CMAKE_CXX_FLAGS_RELEASE STREQUAL "-O3 -DNDEBUG")
  set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")
endif()

# tg_add_alone(TARGET FILE...): sources that no batch can hold, since they set up headers that another wants otherwise.
function(tg_add_alone target)
  target_sources(${target} PRIVATE ${ARGN})
  set_source_files_properties(${ARGN} TARGET_DIRECTORY ${target} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# tg_add_kernels(TARGET FILE...): sources whose loops take a program's time, at -O3 and alone: Highway includes such a file
# once per SIMD target.
function(tg_add_kernels target)
  tg_add_alone(${target} ${ARGN})
  set_source_files_properties(${ARGN} TARGET_DIRECTORY ${target} PROPERTIES COMPILE_OPTIONS "$<$<CONFIG:Release>:-O3>")
endfunction()

# tg_optimize(LEVEL TARGET...): another level than -O2 for a release of these targets: 3 where loops over pixels, Gaussians or
# texels take a program's time, 1 for what reads flags and draws widgets, 0 for cases: CLI11, Dear ImGui and Catch2
# cost the optimizer more than a program can win.
function(tg_optimize level)
  foreach(target ${ARGN})
    target_compile_options(${target} PRIVATE $<$<AND:$<CONFIG:Release>,$<COMPILE_LANGUAGE:CXX>>:-O${level}>)
  endforeach()
endfunction()
