# tg_add_gpu_tests(NAME DEVICE LIBRARY): the tests of every backend on a GPU, for the API of DEVICE.
function(tg_add_gpu_tests name device library)
  tg_add_test(${name} LIBRARIES ${library} tg_render_devices SOURCES
    ${device}
    gpu_passes_test.cpp
    gpu_renderer_test.cpp
    gpu_settings_test.cpp)
  set_source_files_properties(gpu_passes_test.cpp PROPERTIES SKIP_PRECOMPILE_HEADERS ON)  # it asks Catch2 for more
  target_include_directories(${name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
  # llvmpipe's subgroups have as many lanes as its vectors: 4, 8 and 16. Scan and sort must not notice.
  foreach(bits 128 256 512)
    add_test(NAME "${name}: scan and sort in ${bits}-bit vectors" COMMAND ${name} "[scan],[sort]")
    set_tests_properties("${name}: scan and sort in ${bits}-bit vectors" PROPERTIES
      ENVIRONMENT LP_NATIVE_VECTOR_WIDTH=${bits} TIMEOUT 600)
  endforeach()
endfunction()
