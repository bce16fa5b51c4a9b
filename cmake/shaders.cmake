# tg_add_shaders(TARGET FILE...): compiles GLSL to SPIR-V 1.0 and embeds each module as `const uint32_t NAME[]` in
# gen/NAME.h of the build tree, NAME = file name with '.' replaced by '_' (blend.comp -> blend_comp).
find_program(TG_GLSLANG NAMES glslangValidator glslang)

function(tg_add_shaders target)
  if(NOT TG_GLSLANG)
    message(FATAL_ERROR "glslangValidator not found (package glslang-tools)")
  endif()
  file(GLOB shared_headers CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/shaders/shared/*.h ${CMAKE_SOURCE_DIR}/shaders/*.glsl)
  foreach(source ${ARGN})
    get_filename_component(name ${source} NAME)
    string(MAKE_C_IDENTIFIER ${name} variable)
    set(out ${CMAKE_CURRENT_BINARY_DIR}/gen/${variable}.h)
    add_custom_command(OUTPUT ${out}
      COMMAND ${CMAKE_COMMAND} -E make_directory ${CMAKE_CURRENT_BINARY_DIR}/gen
      COMMAND ${TG_GLSLANG} -V --target-env vulkan1.0 --quiet --vn ${variable} -I${CMAKE_SOURCE_DIR}/shaders -o ${out} ${source}
      DEPENDS ${source} ${shared_headers} VERBATIM)
    target_sources(${target} PRIVATE ${out})
  endforeach()
  target_include_directories(${target} PRIVATE ${CMAKE_CURRENT_BINARY_DIR}/gen)
endfunction()
