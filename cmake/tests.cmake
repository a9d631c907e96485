# One gtest program per test/test_*.cpp, and per test/ros/test_*.cpp where there is ROS; run by ctest.

enable_testing()
find_package(GTest REQUIRED)

# Recorded sequences that some tests need; they are skipped without.
set(FRONTIER_SURFELS_DATA "${PROJECT_SOURCE_DIR}/../shared/data" CACHE PATH "folder of recorded sequences for the tests")

set(POCL_CACHE ${CMAKE_CURRENT_BINARY_DIR}/pocl_cache)
file(MAKE_DIRECTORY ${POCL_CACHE})

file(GLOB TEST_SOURCES CONFIGURE_DEPENDS test/test_*.cpp)
if(FRONTIER_SURFELS_WITH_ROS)
  file(GLOB ROS_TEST_SOURCES CONFIGURE_DEPENDS test/ros/test_*.cpp)
  list(APPEND TEST_SOURCES ${ROS_TEST_SOURCES})
endif()

foreach(source ${TEST_SOURCES})
  get_filename_component(name ${source} NAME_WE)
  set(target frontier_surfels_${name})  # in a workspace all packages share the names of targets
  add_executable(${target} ${source})
  set_target_properties(${target} PROPERTIES OUTPUT_NAME ${name} RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/test)
  target_include_directories(${target} PRIVATE src kernels test)
  target_compile_definitions(${target} PRIVATE
    FRONTIER_SURFELS_SOURCE_DIR="${PROJECT_SOURCE_DIR}" FRONTIER_SURFELS_DATA_DIR="${FRONTIER_SURFELS_DATA}")
  target_link_libraries(${target} PRIVATE frontier_surfels_replay frontier_surfels_opencl GTest::gtest_main)
  add_test(NAME ${name} COMMAND ${target})
  set_tests_properties(${name} PROPERTIES ENVIRONMENT "POCL_CACHE_DIR=${POCL_CACHE}" TIMEOUT 600)
  if(name MATCHES "^test_(stage_|surfel_packing)")  # kernels are tested at both widths
    add_test(NAME ${name}_lanes_1 COMMAND ${target})
    set_tests_properties(${name}_lanes_1 PROPERTIES
      ENVIRONMENT "POCL_CACHE_DIR=${POCL_CACHE};FRONTIER_SURFELS_TEST_LANES=1" TIMEOUT 600)
  endif()
  if(CATKIN_TOPLEVEL)  # in a workspace only `make tests` builds tests
    set_target_properties(${target} PROPERTIES EXCLUDE_FROM_ALL TRUE)
    if(TARGET tests)
      add_dependencies(tests ${target})
    endif()
  endif()
endforeach()

# The command line from outside. /usr/bin: the Python that has the modules of the report.
add_test(NAME test_replay_score
  COMMAND /usr/bin/python3 ${PROJECT_SOURCE_DIR}/test/test_replay_score.py $<TARGET_FILE:replay_score> $<TARGET_FILE:make_synthetic>)
add_test(NAME test_bench
  COMMAND /usr/bin/python3 ${PROJECT_SOURCE_DIR}/test/test_bench.py $<TARGET_FILE:bench> $<TARGET_FILE:make_synthetic>
    ${PROJECT_SOURCE_DIR}/scripts/bench_table)
set_tests_properties(test_replay_score test_bench PROPERTIES ENVIRONMENT "POCL_CACHE_DIR=${POCL_CACHE}" TIMEOUT 600)

if(FRONTIER_SURFELS_WITH_ROS)
  include(cmake/ros_tests.cmake)
endif()
