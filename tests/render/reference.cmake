# What the GLSL compiler makes of shared/layout.h, for layout_test.cpp.
find_program(TG_SPIRV_CROSS spirv-cross)
set(layout_reflection "")
if(TG_GLSLANG AND TG_SPIRV_CROSS)
  set(layout_reflection ${CMAKE_CURRENT_BINARY_DIR}/layout.json)
  add_custom_command(OUTPUT ${layout_reflection}
    COMMAND ${TG_GLSLANG} -V --target-env vulkan1.0 --quiet -I${PROJECT_SOURCE_DIR}/shaders
            -o ${CMAKE_CURRENT_BINARY_DIR}/layout.spv ${CMAKE_CURRENT_SOURCE_DIR}/layout.comp
    COMMAND ${TG_SPIRV_CROSS} ${CMAKE_CURRENT_BINARY_DIR}/layout.spv --reflect --output ${layout_reflection}
    DEPENDS layout.comp ${PROJECT_SOURCE_DIR}/shaders/shared/layout.h ${PROJECT_SOURCE_DIR}/shaders/shared/lang.h VERBATIM)
endif()

tg_add_test(reference_test LIBRARIES tg_render tg_goldens nlohmann_json::nlohmann_json SOURCES
  frame_test.cpp golden_test.cpp inspect_test.cpp layout_test.cpp record_test.cpp reference_blend_test.cpp
  reference_cases_test.cpp reference_gradient_test.cpp reference_settings_test.cpp settings_test.cpp
  shared_math_test.cpp
  ${layout_reflection})
# What computes much itself takes five times as long at -O0, which the precompiled headers are for.
set_source_files_properties(record_test.cpp shared_math_test.cpp PROPERTIES SKIP_PRECOMPILE_HEADERS ON
  COMPILE_OPTIONS $<$<CONFIG:Release>:-O1>)
target_compile_definitions(reference_test PRIVATE TG_LAYOUT_REFLECTION="${layout_reflection}")
