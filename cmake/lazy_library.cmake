# Libraries that a program uses where they are and starts without: the loader of Vulkan, GLFW (which wants libX11),
# fontconfig. Linked as usual they are needed even for what never calls them.
include(CheckCXXSourceCompiles)
check_cxx_source_compiles("
  #if !defined(__linux__) || !(defined(__x86_64__) || defined(__aarch64__))
  #error
  #endif
  int main() {}" TG_LAZY_LIBRARIES)

# tg_add_lazy_library(TARGET LINKED NAME PREFIX VALUE): TARGET stands for the library that the target LINKED links. Each
# function of it that begins with PREFIX jumps where dlopen(NAME) has it once the program starts; without the library, or
# without the function, it returns VALUE. On other systems, and of a static library, TARGET links LINKED.
function(tg_add_lazy_library target linked name prefix value)
  get_target_property(headers ${linked} INTERFACE_INCLUDE_DIRECTORIES)
  get_target_property(files ${linked} INTERFACE_LINK_LIBRARIES)  # of pkg-config, the library's own file first
  list(GET files 0 file)
  foreach(property IMPORTED_LOCATION IMPORTED_LOCATION_RELEASE IMPORTED_LOCATION_NONE)
    get_target_property(location ${linked} ${property})
    if(location)
      set(file ${location})
    endif()
  endforeach()
  if(NOT TG_LAZY_LIBRARIES OR NOT CMAKE_NM OR NOT file MATCHES "\\.so[.0-9]*$")
    add_library(${target} INTERFACE)
    target_link_libraries(${target} INTERFACE ${linked})
    return()
  endif()
  set(source ${CMAKE_CURRENT_BINARY_DIR}/${target}.cpp)
  add_custom_command(OUTPUT ${source}
    COMMAND ${CMAKE_COMMAND} -D NM=${CMAKE_NM} -D LIBRARY=${file} -D NAME=${name} -D PREFIX=${prefix} -D VALUE=${value}
      -D OUT=${source} -P ${PROJECT_SOURCE_DIR}/cmake/lazy_functions.cmake
    DEPENDS ${PROJECT_SOURCE_DIR}/cmake/lazy_functions.cmake ${file} VERBATIM)
  add_library(${target} STATIC ${source})
  if(headers)
    target_include_directories(${target} SYSTEM INTERFACE ${headers})
  endif()
  target_link_libraries(${target} PUBLIC ${CMAKE_DL_LIBS})
endfunction()
