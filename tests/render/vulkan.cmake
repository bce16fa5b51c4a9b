tg_add_test(test_vulkan LIBRARIES tg_render_vulkan SOURCES
  trained_model_test.cpp
  vulkan_device.cpp
  vulkan_passes_test.cpp
  vulkan_renderer_test.cpp
  vulkan_settings_test.cpp)
target_include_directories(test_vulkan PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})

# llvmpipe's subgroups have as many lanes as its vectors: 4, 8 and 16. Scan and sort must not notice.
foreach(bits 128 256 512)
  add_test(NAME "test_vulkan: scan and sort in ${bits}-bit vectors" COMMAND test_vulkan "[scan],[sort]")
  set_tests_properties("test_vulkan: scan and sort in ${bits}-bit vectors" PROPERTIES
    ENVIRONMENT LP_NATIVE_VECTOR_WIDTH=${bits} TIMEOUT 600)
endforeach()
