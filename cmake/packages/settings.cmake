# What differs between the packages of one cpack: the archive holds both components at once, without a prefix.
if(CPACK_GENERATOR STREQUAL TGZ)
  foreach(tool patchelf dpkg-query)  # of stage.cmake
    find_program(found_${tool} ${tool})
    if(NOT found_${tool})
      message(FATAL_ERROR "cpack -G TGZ: ${tool} not found (packages patchelf, dpkg; `cpack -G DEB` does without)")
    endif()
  endforeach()
  set(CPACK_PACKAGE_FILE_NAME ${CPACK_PACKAGE_NAME}-${CPACK_PACKAGE_VERSION}-${CPACK_TG_MACHINE})
  list(GET CPACK_INSTALL_CMAKE_PROJECTS 0 build)
  list(GET CPACK_INSTALL_CMAKE_PROJECTS 1 project)
  set(CPACK_INSTALL_CMAKE_PROJECTS ${build} ${project} tools / ${build} ${project} doc /)
  set(CPACK_PACKAGING_INSTALL_PREFIX "")
endif()
