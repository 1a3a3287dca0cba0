# `cmake --install` and find_package(revisit): headers (without internal/ and tests), static libraries, the program.
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
