# `cmake --install` and find_package(revisit): headers (without internal/ and tests), static libraries, the program; with
# REVISIT_SHARED all of the library as one shared object, too, which asks of its user for Eigen alone.
include(CMakePackageConfigHelpers)

# Everything at once: revisit::revisit.
get_property(modules GLOBAL PROPERTY REVISIT_MODULES)
add_library(revisit_all INTERFACE)
set_target_properties(revisit_all PROPERTIES EXPORT_NAME revisit)
target_link_libraries(revisit_all INTERFACE ${modules})

set(components ${modules})
if(TARGET revisit_node)
  list(APPEND components revisit_node)
  install(FILES bindings/node/messages.hpp bindings/node/node.hpp bindings/node/ros_messages.hpp
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/revisit/node COMPONENT dev)
endif()
install(TARGETS ${components} revisit_all EXPORT revisitTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dev)
if(REVISIT_SHARED AND NOT REVISIT_SANITIZE)
  add_library(revisit_shared SHARED)
  foreach(module IN LISTS modules)
    get_target_property(type ${module} TYPE)
    if(type STREQUAL "STATIC_LIBRARY")
      target_sources(revisit_shared PRIVATE $<TARGET_OBJECTS:${module}>)
    endif()
  endforeach()
  target_link_libraries(revisit_shared PRIVATE ${modules} revisit_flags INTERFACE Eigen3::Eigen)
  target_include_directories(revisit_shared INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(revisit_shared INTERFACE cxx_std_20)
  # Until 1.0 the interface may change with each minor version.
  set_target_properties(revisit_shared PROPERTIES LINKER_LANGUAGE CXX OUTPUT_NAME revisit EXPORT_NAME shared VERSION ${PROJECT_VERSION}
    SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  list(APPEND components revisit_shared)
  install(TARGETS revisit_shared EXPORT revisitTargets LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT lib
    NAMELINK_COMPONENT dev)
endif()
install(EXPORT revisitTargets NAMESPACE revisit:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/revisit COMPONENT dev)
install(DIRECTORY src/revisit DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dev
  FILES_MATCHING PATTERN "*.hpp" PATTERN "*.h" PATTERN internal EXCLUDE)

list(TRANSFORM components REPLACE "^revisit_" "" OUTPUT_VARIABLE REVISIT_COMPONENTS)
set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/revisit)
configure_package_config_file(cmake/revisitConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/revisitConfig.cmake
  INSTALL_DESTINATION ${config_dir})
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/revisitConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/revisitConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/revisitConfigVersion.cmake
  cmake/RevisitDependencies.cmake DESTINATION ${config_dir} COMPONENT dev)
install(FILES package.xml DESTINATION share/revisit COMPONENT dev)
