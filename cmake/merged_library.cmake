# One static library of several, for programs that link it installed.

# Whether such a library keeps its inner names to itself: by GNU's tools, where the linker has nothing left to compile
# and no sanitizer has tables of its own. Tried with GCC alone.
set(TG_KEEPS_NAMES OFF)
set(tg_flags "${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_RELEASE} ${CMAKE_CXX_FLAGS_RELWITHDEBINFO} ${CMAKE_CXX_FLAGS_DEBUG}")
if(CMAKE_SYSTEM_NAME STREQUAL Linux AND CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_OBJCOPY AND CMAKE_NM
    AND NOT TG_SANITIZE AND NOT TG_FUZZ AND NOT CMAKE_INTERPROCEDURAL_OPTIMIZATION
    AND NOT tg_flags MATCHES "-flto|-fsan")
  execute_process(COMMAND ${CMAKE_LINKER} --help OUTPUT_VARIABLE tg_linker_said ERROR_QUIET)
  execute_process(COMMAND ${CMAKE_OBJCOPY} --version OUTPUT_VARIABLE tg_objcopy_said ERROR_QUIET)
  if(tg_linker_said MATCHES "--force-group-allocation" AND tg_objcopy_said MATCHES "GNU")
    set(TG_KEEPS_NAMES ON)
  endif()
endif()

# tg_add_merged_library(TARGET OF NAMESPACE): the objects of OF and of every static library of ours that it links. Other
# people's libraries are linked by whoever links TARGET; those of them that are headers alone stay behind. With
# TG_KEEPS_NAMES only what has NAMESPACE in its name is seen from outside, so that a program may call its own as we do.
function(tg_add_merged_library target of namespace)
  set(waiting ${of})
  set(ours "")
  set(theirs "")
  while(waiting)
    list(POP_FRONT waiting item)
    string(REGEX REPLACE "^\\$<LINK_ONLY:(.*)>$" "\\1" item "${item}")
    if(NOT TARGET "${item}")
      continue()
    endif()
    get_target_property(imported ${item} IMPORTED)
    get_target_property(type ${item} TYPE)
    if(imported)
      list(APPEND theirs ${item})
    elseif(NOT item IN_LIST ours)
      list(APPEND ours ${item})
      get_target_property(links ${item} INTERFACE_LINK_LIBRARIES)
      if(links)
        list(APPEND waiting ${links})
      endif()
    endif()
  endwhile()
  list(REMOVE_DUPLICATES theirs)
  list(REMOVE_ITEM theirs glm::glm nlohmann_json::nlohmann_json)
  set(objects "")
  foreach(library IN LISTS ours)
    get_target_property(type ${library} TYPE)
    if(type STREQUAL STATIC_LIBRARY)
      list(APPEND objects $<TARGET_OBJECTS:${library}>)
    endif()
  endforeach()
  add_library(${target} STATIC ${objects})
  set_target_properties(${target} PROPERTIES LINKER_LANGUAGE CXX)
  target_link_libraries(${target} PRIVATE ${theirs})
  if(NOT TG_KEEPS_NAMES)
    return()
  endif()
  string(LENGTH ${namespace} length)  # as names are mangled
  set(object ${CMAKE_CURRENT_BINARY_DIR}/${target}.o)
  # One object; objcopy hides what is weak, but not "unique" names (nm's u), which are made weak before.
  add_custom_command(TARGET ${target} POST_BUILD
    COMMAND ${CMAKE_LINKER} -r --force-group-allocation --whole-archive $<TARGET_FILE:${target}> -o ${object}
    COMMAND sh -c "'${CMAKE_NM}' '${object}' | sed -n 's/.* u //p' >'${object}.unique'"
    COMMAND ${CMAKE_OBJCOPY} --weaken-symbols=${object}.unique ${object}
    COMMAND ${CMAKE_OBJCOPY} --wildcard --keep-global-symbol=*${length}${namespace}* ${object}
    COMMAND ${CMAKE_COMMAND} -E rm $<TARGET_FILE:${target}>
    COMMAND ${CMAKE_AR} rcs $<TARGET_FILE:${target}> ${object}
    COMMAND ${CMAKE_COMMAND} -E rm ${object} ${object}.unique VERBATIM)
endfunction()
