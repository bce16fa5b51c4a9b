tg_add_test(test_vulkan LIBRARIES tg_render_vulkan SOURCES
  vulkan_device.cpp
  vulkan_renderer_test.cpp)
target_include_directories(test_vulkan PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
