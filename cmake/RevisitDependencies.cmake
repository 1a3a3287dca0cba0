# Every outside library, found once. Debian 12 package names: scripts/packages.txt.
# Installed beside revisitConfig.cmake, so that consumers find the same things.
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(tomlplusplus REQUIRED)
find_package(nlohmann_json 3 REQUIRED)
find_package(TBB 2021 REQUIRED)
find_package(embree 3 REQUIRED)
find_package(tsl-robin-map REQUIRED)
find_package(Ceres 2.1 REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(HWY REQUIRED IMPORTED_TARGET libhwy)
pkg_check_modules(XXHASH REQUIRED IMPORTED_TARGET libxxhash)

# PCL's own package file searches for VTK, Qt and more; the five libraries used here need none of them at build time.
if(NOT TARGET revisit_pcl)
  find_path(REVISIT_PCL_INCLUDE_DIR pcl/pcl_config.h PATH_SUFFIXES pcl-1.13 pcl-1.14 pcl-1.12 pcl REQUIRED)
  add_library(revisit_pcl INTERFACE IMPORTED)
  target_include_directories(revisit_pcl SYSTEM INTERFACE ${REVISIT_PCL_INCLUDE_DIR})
  foreach(component registration features filters search kdtree sample_consensus io io_ply octree common)
    find_library(REVISIT_PCL_${component}_LIBRARY pcl_${component} REQUIRED)
    target_link_libraries(revisit_pcl INTERFACE ${REVISIT_PCL_${component}_LIBRARY})
  endforeach()
  target_link_libraries(revisit_pcl INTERFACE Eigen3::Eigen)
endif()
