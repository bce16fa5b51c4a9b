# What `cpack` makes of a build: Debian packages of the components tools, dev and doc, and a .tar.gz of tools and doc
# that can lie anywhere (docs/packages.md). scripts/packages.sh builds and packs. What a package holds beside installed
# files is made in packages/stage.cmake.
set(TG_PACKAGE_MAINTAINER "The maintainers of Textured Gaussians <maintainers@example.org>"
  CACHE STRING "Whom the packages name as their maintainer")

include(GNUInstallDirs)
set(doc_folder ${CMAKE_INSTALL_DATADIR}/doc/textured-gaussians)
install(FILES README.md CHANGELOG.md CONTRIBUTING.md SECURITY.md LICENSE CITATION.cff
  DESTINATION ${doc_folder} COMPONENT doc)
install(DIRECTORY docs DESTINATION ${doc_folder} COMPONENT doc PATTERN docs/lab EXCLUDE)
# Of the lab, for maintainers, what the manuals link: its pages, without the megabytes that they are made of.
file(GLOB lab_pages CONFIGURE_DEPENDS docs/lab/*.md)
install(FILES ${lab_pages} DESTINATION ${doc_folder}/docs/lab COMPONENT doc)
# What these link to, in the same places.
install(FILES web/README.md DESTINATION ${doc_folder}/web COMPONENT doc)
install(DIRECTORY web/examples web/src DESTINATION ${doc_folder}/web COMPONENT doc)
install(DIRECTORY library/examples library/include DESTINATION ${doc_folder}/library COMPONENT doc)
install(DIRECTORY scripts/farm DESTINATION ${doc_folder}/scripts COMPONENT doc USE_SOURCE_PERMISSIONS)

set(CPACK_PACKAGE_NAME textured-gaussians)
set(CPACK_PACKAGE_VENDOR "The maintainers of Textured Gaussians")
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_STRIP_FILES ON)
set(CPACK_VERBATIM_VARIABLES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_GENERATOR DEB TGZ)
set(CPACK_COMPONENTS_ALL tools dev doc)
set(CPACK_PROJECT_CONFIG_FILE ${PROJECT_SOURCE_DIR}/cmake/packages/settings.cmake)
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/cmake/packages/stage.cmake)

set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_MAINTAINER ${TG_PACKAGE_MAINTAINER})
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_TOOLS_PACKAGE_NAME textured-gaussians)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SHLIBDEPS ON)
# Opened by name, without which there are no windows, no Vulkan, no OpenGL, no fonts of the system; colmap and ffmpeg are
# started by `tgtrain photos`.
set(CPACK_DEBIAN_TOOLS_PACKAGE_RECOMMENDS
  "libglfw3, libvulkan1, mesa-vulkan-drivers | vulkan-icd, libegl1, libgl1, libfontconfig1")
set(CPACK_DEBIAN_TOOLS_PACKAGE_SUGGESTS "colmap, ffmpeg, textured-gaussians-doc")
set(CPACK_DEBIAN_TOOLS_DESCRIPTION "train, show and convert 3D Gaussian splats with textures
Gaussian splats are a scene as a cloud of soft ellipsoids, learnt from
photographs. Here each may carry a small alpha, RGB or RGBA texture, which
shows more detail with as many of them.
.
tgtrain trains a model from photographs, tgeval measures it, tgview shows it
by Vulkan, OpenGL or on the processor, and tgconvert writes it as glTF, PLY,
SOG, SPZ or as a page for browsers, and reads those.")

set(CPACK_DEBIAN_DEV_PACKAGE_NAME libtextured-gaussians-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
# What its CMake configuration looks for.
string(JOIN ", " CPACK_DEBIAN_DEV_PACKAGE_DEPENDS libopenexr-dev libarchive-dev libssl-dev libpng-dev libjpeg-dev
  libwebp-dev zlib1g-dev libzstd-dev libhwy-dev libtinygltf-dev libmeshoptimizer-dev pkgconf)
set(CPACK_DEBIAN_DEV_PACKAGE_SUGGESTS textured-gaussians-doc)
set(CPACK_DEBIAN_DEV_DESCRIPTION "library for 3D Gaussian splats with textures
Headers and a static library to load, save, draw, train, score and convert
models of Gaussian splats that may carry textures, for programs in C++20.
CMake finds it as textured_gaussians.")

set(CPACK_DEBIAN_DOC_PACKAGE_NAME textured-gaussians-doc)
set(CPACK_DEBIAN_DOC_PACKAGE_SECTION doc)
set(CPACK_DEBIAN_DOC_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_DOC_DESCRIPTION "documentation of the Textured Gaussians tools
Manuals of tgtrain, tgeval, tgview and tgconvert, the file formats that they
read and write, every equation of training and rendering, measurements, and
a small trained model, sample.tgz.")

# Debian's changelog has an entry a release, as CHANGELOG.md has; no two of them have the same time.
file(STRINGS ${PROJECT_SOURCE_DIR}/CHANGELOG.md releases REGEX "^## [0-9.]+ \\([0-9-]+\\)")
list(LENGTH releases minute)
set(CPACK_TG_CHANGELOG "")
foreach(release IN LISTS releases)
  string(REGEX MATCH "([0-9.]+) \\(([0-9-]+)\\)" found ${release})
  set(version ${CMAKE_MATCH_1})
  execute_process(COMMAND date -u -R -d "${CMAKE_MATCH_2} 12:${minute}"
    OUTPUT_VARIABLE time OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  math(EXPR minute "${minute} - 1")
  string(APPEND CPACK_TG_CHANGELOG
    "textured-gaussians (${version}-${CPACK_DEBIAN_PACKAGE_RELEASE}) unstable; urgency=medium\n\n"
    "  * Version ${version}: changelog.gz says what is new.\n\n"
    " -- ${TG_PACKAGE_MAINTAINER}  ${time}\n\n")
endforeach()
string(TOLOWER ${CMAKE_SYSTEM_NAME}-${CMAKE_SYSTEM_PROCESSOR} CPACK_TG_MACHINE)
if(TARGET tg_glfw)
  get_target_property(CPACK_TG_GLFW glfw LOCATION)
endif()
# Debian's packages whose code becomes part of programs and of the static library: nothing else brings their licences.
set(CPACK_TG_COMPILED_IN libcli11-dev libglm-dev nlohmann-json3-dev)
if(TARGET tgview)
  list(APPEND CPACK_TG_COMPILED_IN libimgui-dev libstb-dev)
endif()
set(CPACK_TG_SOURCE ${PROJECT_SOURCE_DIR})

include(CPack)
