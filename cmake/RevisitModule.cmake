# revisit_module(NAME SOURCES ... PUBLIC ... PRIVATE ... TESTS ...)
# One folder of src/revisit as the target revisit_NAME; TESTS stand beside their sources and
# become the test program NAME_test, skipped as a whole where REVISIT_BUILD_TESTS is off.
function(revisit_module name)
  cmake_parse_arguments(M "" "" "SOURCES;PUBLIC;PRIVATE;TESTS" ${ARGN})
  set(target revisit_${name})
  if(M_SOURCES)
    add_library(${target} STATIC ${M_SOURCES})
    set(scope PUBLIC)
    target_link_libraries(${target} PRIVATE ${M_PRIVATE} $<BUILD_INTERFACE:revisit_flags>)
  else()
    add_library(${target} INTERFACE)
    set(scope INTERFACE)
  endif()
  add_library(revisit::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  target_compile_features(${target} ${scope} cxx_std_20)
  target_include_directories(${target} ${scope}
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(${target} ${scope} ${M_PUBLIC})
  set_property(GLOBAL APPEND PROPERTY REVISIT_MODULES ${target})
  if(M_TESTS AND REVISIT_BUILD_TESTS)
    revisit_test(${name}_test SOURCES ${M_TESTS} LIBRARIES ${target})
  endif()
endfunction()

# revisit_test(NAME SOURCES ... LIBRARIES ...): one GoogleTest program, each test known to CTest.
function(revisit_test name)
  cmake_parse_arguments(T "" "" "SOURCES;LIBRARIES" ${ARGN})
  add_executable(${name} ${T_SOURCES})
  set_target_properties(${name} PROPERTIES UNITY_BUILD ON)  # GoogleTest and Eigen, read once
  target_link_libraries(${name} PRIVATE ${T_LIBRARIES} revisit_flags revisit_source_dir GTest::gtest GTest::gtest_main)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  # What takes long in tests is in the library: with -O1 they compile in two thirds of the time.
  target_compile_options(${name} PRIVATE $<$<AND:$<CXX_COMPILER_ID:GNU,Clang>,$<CONFIG:Release>>:-O1>)
  set(longest_s 120)
  if(REVISIT_SANITIZE)
    set(longest_s 480)  # the slowest takes 53
  endif()
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST PROPERTIES TIMEOUT ${longest_s} LABELS ${name})
endfunction()

add_library(revisit_flags INTERFACE)
target_compile_options(revisit_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>  # GCC 12 warns of its own std::string
  # In a unity build the file that is compiled is another than the one that holds a nameless namespace.
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<BOOL:${CMAKE_UNITY_BUILD}>>:-Wno-subobject-linkage>
  # Nobody reads errno or flags of floating point: loops with roots and conditions become SIMD. No value changes.
  -fno-math-errno -fno-trapping-math)
# Highway's target for processors that count bits in whole vectors (VPOPCNTDQ), the same for every file that chooses.
target_compile_definitions(revisit_flags INTERFACE HWY_WANT_AVX3_DL)

if(REVISIT_HARDENING AND NOT REVISIT_SANITIZE)
  target_compile_options(revisit_flags INTERFACE -fstack-protector-strong -fstack-clash-protection
    $<$<CONFIG:Release,RelWithDebInfo>:-U_FORTIFY_SOURCE> $<$<CONFIG:Release,RelWithDebInfo>:-D_FORTIFY_SOURCE=2>)
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    target_compile_options(revisit_flags INTERFACE -fcf-protection)
  endif()
  target_link_options(revisit_flags INTERFACE -Wl,-z,relro,-z,now,-z,noexecstack)
endif()
if(REVISIT_SANITIZE)
  # Reads and writes through null pointers ASan sees too: checks of each use of a pointer take a fifth of the build.
  add_compile_options(-fsanitize=${REVISIT_SANITIZE} -fno-sanitize=null -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${REVISIT_SANITIZE})
  # Under ASan, Eigen would allocate otherwise than in Debian's PCL, whose buffers it then frees wrongly.
  add_compile_definitions(EIGEN_MALLOC_ALREADY_ALIGNED=1)
endif()
if(REVISIT_BUILD_TESTS)
  # The one file that knows where the project lies: what ccache keeps of the others serves every clone.
  add_library(revisit_source_dir STATIC ${PROJECT_SOURCE_DIR}/tests/source_dir.cpp)
  target_compile_features(revisit_source_dir PUBLIC cxx_std_20)
  target_compile_definitions(revisit_source_dir PRIVATE REVISIT_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
endif()
