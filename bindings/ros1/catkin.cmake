# As a package of a catkin workspace: `ln -s PROJECT/bindings/ros1 src/revisit_ros`, then catkin_make.
project(revisit_ros LANGUAGES C CXX)
set(messages diagnostic_msgs geometry_msgs nav_msgs sensor_msgs std_msgs std_srvs visualization_msgs)
find_package(catkin REQUIRED COMPONENTS message_generation roscpp tf2_ros topic_tools ${messages})
add_message_files(FILES Loop.msg)
generate_messages(DEPENDENCIES geometry_msgs std_msgs)
catkin_package(CATKIN_DEPENDS message_runtime roscpp tf2_ros topic_tools ${messages})

if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
# The library as the repository around has it; where this folder is a release of its own, as it is installed.
get_filename_component(here ${CMAKE_CURRENT_LIST_DIR} REALPATH)
if(EXISTS ${here}/../node/node.hpp)
  add_subdirectory(${here}/../.. revisit EXCLUDE_FROM_ALL)
else()
  find_package(revisit 0.2 REQUIRED COMPONENTS node)
endif()

add_executable(revisit_ros1 src/node.cpp)
set_target_properties(revisit_ros1 PROPERTIES CXX_STANDARD 17 OUTPUT_NAME revisit_node)
add_dependencies(revisit_ros1 revisit_ros_generate_messages_cpp)
target_include_directories(revisit_ros1 SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
target_link_libraries(revisit_ros1 PRIVATE revisit::node ${catkin_LIBRARIES})

install(TARGETS revisit_ros1 RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
install(DIRECTORY launch rviz DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
