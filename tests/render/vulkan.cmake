tg_add_gpu_tests(vulkan_test vulkan_device.cpp tg_render_vulkan)
target_sources(vulkan_test PRIVATE vulkan_frames_test.cpp vulkan_limits_test.cpp)
target_link_options(vulkan_test PRIVATE LINKER:--wrap=vkGetPhysicalDeviceQueueFamilyProperties)
# SwiftShader, the second implementation, is spared the cases that take it longest, and those that claim to bind fewer
# texels than storage buffers, which it reads in their place. Skipped where scripts/fetch_swiftshader.sh could not fetch
# it: nothing that the build needs brings it.
add_test(NAME "vulkan_test: on SwiftShader"
  COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/on_swiftshader.sh ${PROJECT_BINARY_DIR}/swiftshader $<TARGET_FILE:vulkan_test>
    ~[slow]~[limits]~[large])
set_tests_properties("vulkan_test: on SwiftShader" PROPERTIES TIMEOUT 600 WORKING_DIRECTORY ${PROJECT_SOURCE_DIR} SKIP_REGULAR_EXPRESSION ${tg_skipped})
