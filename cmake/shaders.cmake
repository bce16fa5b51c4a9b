# tg_add_shaders(TARGET FILE...): compiles GLSL to SPIR-V 1.0 and embeds each module as `const uint32_t NAME[]` in
# gen/NAME.h of the build tree, NAME = file name with '.' replaced by '_' (blend.comp -> blend_comp). Beside it lies the
# text with includes and macros resolved, as `const char STEM_text[]` in gen/STEM_text.h (blend.comp -> blend_text), and
# of a shader that includes shaders/fetch.glsl, by itself or through another, STEM_storage as well.
find_program(TG_GLSLANG NAMES glslangValidator glslang)

function(tg_add_shaders target)
  if(NOT TG_GLSLANG)
    message(FATAL_ERROR "glslangValidator not found (package glslang-tools)")
  endif()
  file(GLOB shared_headers CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/shaders/shared/*.h ${PROJECT_SOURCE_DIR}/shaders/*.glsl)
  foreach(source ${ARGN})
    get_filename_component(name ${source} NAME)
    string(MAKE_C_IDENTIFIER ${name} variable)
    set(out ${CMAKE_CURRENT_BINARY_DIR}/gen/${variable}.h)
    add_custom_command(OUTPUT ${out}
      COMMAND ${CMAKE_COMMAND} -E make_directory ${CMAKE_CURRENT_BINARY_DIR}/gen
      COMMAND ${TG_GLSLANG} -V --target-env vulkan1.0 --quiet --vn ${variable} -I${PROJECT_SOURCE_DIR}/shaders -o ${out} ${source}
      DEPENDS ${source} ${shared_headers} VERBATIM)
    get_filename_component(stem ${source} NAME_WE)
    file(STRINGS ${source} fetches REGEX "include \"(fetch|gaussian|scan_runs)\\.glsl\"")
    if(fetches)
      set(storage ${CMAKE_CURRENT_BINARY_DIR}/gen/${stem}_storage.h)
      add_custom_command(OUTPUT ${storage}
        COMMAND ${TG_GLSLANG} -V --target-env vulkan1.0 --quiet -DTG_STORAGE --vn ${stem}_storage
                -I${PROJECT_SOURCE_DIR}/shaders -o ${storage} ${source}
        DEPENDS ${source} ${shared_headers} ${out} VERBATIM)
      target_sources(${target} PRIVATE ${storage})
    endif()
    set(text ${CMAKE_CURRENT_BINARY_DIR}/gen/${stem}_text.h)
    add_custom_command(OUTPUT ${text}
      COMMAND ${CMAKE_COMMAND} -DGLSLANG=${TG_GLSLANG} -DINCLUDE=${PROJECT_SOURCE_DIR}/shaders -DSOURCE=${source}
              -DNAME=${stem}_text -DOUT=${text} -P ${PROJECT_SOURCE_DIR}/cmake/shader_text.cmake
      DEPENDS ${source} ${shared_headers} ${PROJECT_SOURCE_DIR}/cmake/shader_text.cmake VERBATIM)
    target_sources(${target} PRIVATE ${out} ${text})
  endforeach()
  target_include_directories(${target} PRIVATE ${CMAKE_CURRENT_BINARY_DIR}/gen)
endfunction()
