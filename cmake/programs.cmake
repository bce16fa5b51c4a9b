# tg_install_programs(TARGET...): programs with what their option tables give: a manual page and completions for bash, zsh and
# fish, written by the programs once they are built. A project that adds this one as a folder
# takes the library: it builds none of them unasked, but for the tests, and installs none.
function(tg_install_programs)
  if(NOT PROJECT_IS_TOP_LEVEL)
    if(NOT TG_TESTS)
      set_target_properties(${ARGN} PROPERTIES EXCLUDE_FROM_ALL ON)
    endif()
    return()
  endif()
  install(TARGETS ${ARGN})
  if(CMAKE_CROSSCOMPILING)
    return()
  endif()
  include(GNUInstallDirs)
  foreach(program ${ARGN})
    set(folder ${PROJECT_BINARY_DIR}/share)
    set(manual ${folder}/man/man1/${program}.1)
    set(bash ${folder}/bash-completion/completions/${program})
    set(zsh ${folder}/zsh/site-functions/_${program})
    set(fish ${folder}/fish/vendor_completions.d/${program}.fish)
    foreach(file ${manual} ${bash} ${zsh} ${fish})
      cmake_path(GET file PARENT_PATH parent)
      file(MAKE_DIRECTORY ${parent})
      cmake_path(RELATIVE_PATH parent BASE_DIRECTORY ${folder})
      install(FILES ${file} DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/${parent})
    endforeach()
    add_custom_command(OUTPUT ${manual} ${bash} ${zsh} ${fish}
      COMMAND ${program} --man > ${manual}
      COMMAND ${program} --completion bash > ${bash}
      COMMAND ${program} --completion zsh > ${zsh}
      COMMAND ${program} --completion fish > ${fish}
      DEPENDS ${program} VERBATIM)
    add_custom_target(${program}_manual ALL DEPENDS ${manual} ${bash} ${zsh} ${fish})
  endforeach()
endfunction()
