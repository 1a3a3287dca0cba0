# `make deb`: Debian packages of what was built, with CPack: the program (which carries the viewer's page), the shared
# library, the library to build on (headers and static libraries), and the Python module. debian/ makes the same.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME revisit)
set(CPACK_PACKAGE_CONTACT "The revisit authors <revisit@packages.debian.org>")
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_SOURCE_DIR}/out/deb)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_COMPONENTS_ALL program dev)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME revisit)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAM_DESCRIPTION "Program: recognises from LiDAR scans the places that a robot has seen
before, closes the loop with a verified pose, and makes corrected
trajectories and maps of recordings (ROS bags, packet captures, KITTI,
folders of scans).")

set(CPACK_DEBIAN_DEV_PACKAGE_NAME librevisit-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
if(TARGET revisit_shared)
  list(APPEND CPACK_COMPONENTS_ALL lib)
  set(CPACK_DEBIAN_LIB_PACKAGE_NAME librevisit${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  set(CPACK_DEBIAN_LIB_PACKAGE_SECTION libs)
  set(CPACK_DEBIAN_LIB_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
  set(CPACK_DEBIAN_LIB_PACKAGE_CONTROL_EXTRA "${CMAKE_CURRENT_BINARY_DIR}/debian/triggers")
  set(CPACK_DEBIAN_LIB_DESCRIPTION "Shared library: recognises from LiDAR scans the places that a robot
has seen before, closes the loop, and makes maps.")
  file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/debian/triggers "activate-noawait ldconfig\n")
  set(shared_dependency "${CPACK_DEBIAN_LIB_PACKAGE_NAME} (= ${PROJECT_VERSION}), ")
endif()
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "${shared_dependency}libbz2-dev, libceres-dev, libeigen3-dev, libembree-dev, libgeographiclib-dev, \
libhwy-dev, liblz4-dev, libopencv-features2d-dev, libpcap-dev, libpcl-dev, libsqlite3-dev, libtbb-dev, libzstd-dev, pkg-config, zlib1g-dev")
set(CPACK_DEBIAN_DEV_DESCRIPTION "C++ library: headers, static libraries and the CMake package
(find_package(revisit)).")

if(TARGET revisit_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-revisit)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
  execute_process(COMMAND ${REVISIT_PYTHON_EXECUTABLE} -c "import sys; print(sys.version_info.minor)"
    OUTPUT_VARIABLE python_minor OUTPUT_STRIP_TRAILING_WHITESPACE)
  math(EXPR next_python "${python_minor} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= 3.${python_minor}), python3 (<< 3.${next_python}), \
python3-numpy, revisit (= ${PROJECT_VERSION})")
  set(CPACK_DEBIAN_PYTHON_DESCRIPTION "Python module: loop detection, registration, SLAM and localisation on
NumPy arrays.")
endif()

# What Debian expects beside the files: a changelog, a copyright, and a page for `man`.
file(STRINGS debian/changelog changelog LIMIT_COUNT 1)
if(NOT changelog MATCHES "^revisit \\(${PROJECT_VERSION}\\)")
  message(FATAL_ERROR "debian/changelog begins with '${changelog}', not with version ${PROJECT_VERSION}")
endif()
configure_file(debian/changelog ${CMAKE_CURRENT_BINARY_DIR}/debian/changelog COPYONLY)
execute_process(COMMAND gzip -9nkf ${CMAKE_CURRENT_BINARY_DIR}/debian/changelog)
foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  string(TOUPPER ${component} name)
  install(FILES ${PROJECT_SOURCE_DIR}/debian/copyright ${CMAKE_CURRENT_BINARY_DIR}/debian/changelog.gz
    DESTINATION share/doc/${CPACK_DEBIAN_${name}_PACKAGE_NAME} COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/debian/revisit.1.gz DESTINATION share/man/man1 COMPONENT program OPTIONAL)
include(CPack)
