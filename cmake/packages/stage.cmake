# Run by cpack between installing and packing.
cmake_minimum_required(VERSION 3.24)

# Into FOLDER the licences of Debian's packages, each by its name.
function(tg_stage_licences folder)
  foreach(package IN LISTS ARGN)
    configure_file(/usr/share/doc/${package}/copyright ${folder}/${package} COPYONLY)
  endforeach()
endfunction()

# Each Debian package gets its changelogs and copyright, compressed manual pages, zsh's completions where Debian's zsh
# looks for them, and no second text of the licence.
function(tg_stage_debian_package component)
  string(TOUPPER ${component} upper)
  set(root ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/${component}${CPACK_PACKAGING_INSTALL_PREFIX})
  set(doc ${root}/share/doc/${CPACK_DEBIAN_${upper}_PACKAGE_NAME})
  configure_file(${CPACK_TG_SOURCE}/cmake/packages/copyright ${doc}/copyright COPYONLY)
  if(NOT component STREQUAL "doc")
    tg_stage_licences(${doc}/libraries ${CPACK_TG_COMPILED_IN})
  endif()
  configure_file(${CPACK_TG_SOURCE}/CHANGELOG.md ${doc}/changelog COPYONLY)
  file(WRITE ${doc}/changelog.Debian "${CPACK_TG_CHANGELOG}")
  file(GLOB manuals ${root}/share/man/man*/*)
  execute_process(COMMAND gzip -9nf ${doc}/changelog ${doc}/changelog.Debian ${manuals} COMMAND_ERROR_IS_FATAL ANY)
  file(REMOVE ${root}/share/doc/textured-gaussians/LICENSE)
  if(EXISTS ${root}/share/zsh/site-functions)
    file(RENAME ${root}/share/zsh/site-functions ${root}/share/zsh/vendor-completions)
  endif()
endfunction()

# What every Linux has, and what a driver of the machine may want in a newer version than the archive's.
set(libraries_of_the_machine
  ld-linux.* libc libm libdl libpthread librt libresolv libutil libstdc\\+\\+ libgcc_s libz libexpat
  libvulkan libGL.* libEGL libOpenGL libdrm.* libgbm libX.* libxcb.* libwayland.*)

# The archive carries the libraries that its programs want, with their licences, in lib/textured-gaussians, where
# programs and libraries look for each other first.
function(tg_stage_archive root)
  list(JOIN libraries_of_the_machine "|" left_out)
  file(GLOB programs ${root}/bin/*)
  file(GET_RUNTIME_DEPENDENCIES EXECUTABLES ${programs} LIBRARIES ${CPACK_TG_GLFW} RESOLVED_DEPENDENCIES_VAR libraries
    PRE_EXCLUDE_REGEXES "^(${left_out})\\.so(\\..*)?$")
  set(folder ${root}/lib/textured-gaussians)
  foreach(library IN LISTS libraries CPACK_TG_GLFW)
    file(REAL_PATH ${library} file)
    execute_process(COMMAND patchelf --print-soname ${file} OUTPUT_VARIABLE name OUTPUT_STRIP_TRAILING_WHITESPACE
      COMMAND_ERROR_IS_FATAL ANY)
    configure_file(${file} ${folder}/${name} COPYONLY)
    execute_process(COMMAND patchelf --set-rpath "$ORIGIN" ${folder}/${name} COMMAND_ERROR_IS_FATAL ANY)
    string(REGEX REPLACE "^/usr/" "*/" known ${file})  # some packages say /lib
    execute_process(COMMAND dpkg-query --search ${known} OUTPUT_VARIABLE package COMMAND_ERROR_IS_FATAL ANY)
    string(REGEX REPLACE ":.*" "" package ${package})
    list(APPEND packages ${package})
  endforeach()
  tg_stage_licences(${root}/share/doc/textured-gaussians/libraries ${packages} ${CPACK_TG_COMPILED_IN})
  foreach(program IN LISTS programs)
    execute_process(COMMAND patchelf --set-rpath "$ORIGIN/../lib/textured-gaussians" ${program} COMMAND_ERROR_IS_FATAL ANY)
  endforeach()
endfunction()

if(CPACK_GENERATOR STREQUAL DEB)
  foreach(component IN LISTS CPACK_COMPONENTS_ALL)
    tg_stage_debian_package(${component})
  endforeach()
else()
  tg_stage_archive(${CPACK_TEMPORARY_INSTALL_DIRECTORY})
endif()
