# How sources become libraries and programs, but for what tg_warnings says.
option(TG_UNITY "Compile the sources of a target in batches: a cold build takes a third of the time" ON)
set(CMAKE_UNITY_BUILD ${TG_UNITY})
set(CMAKE_UNITY_BUILD_BATCH_SIZE 8)

# tg_add_alone(TARGET FILE...): sources that no batch can hold: what Highway includes once per SIMD target, and what sets up
# headers that another source wants otherwise.
function(tg_add_alone target)
  target_sources(${target} PRIVATE ${ARGN})
  set_source_files_properties(${ARGN} TARGET_DIRECTORY ${target} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()
