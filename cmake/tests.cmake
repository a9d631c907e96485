# ctest runs one gtest program for each test/test_*.cpp and, with ROS, for each test/ros/test_*.cpp.

enable_testing()
find_package(GTest REQUIRED)

# Some tests need recorded sequences. Without them these tests are skipped.
set(FRONTIER_SURFELS_DATA "${PROJECT_SOURCE_DIR}/../shared/data" CACHE PATH "folder of recorded sequences for the tests")

set(POCL_CACHE ${CMAKE_CURRENT_BINARY_DIR}/pocl_cache)
file(MAKE_DIRECTORY ${POCL_CACHE})

# Tests of these names need the tools: frames of the synthetic room, recordings, scores. All others are of the core alone.
set(NEED_TOOLS "/(ros/test_.*|test_(coverage|exact_test|folder_source|mapper|object|octomap_truth|real_data|sampling|summary|synthetic|tools|truth).*)\\.cpp$")
# This one needs no library at all: ThreadSanitizer's build of it takes seconds.
set(NEED_NOTHING "/ros/test_worker\\.cpp$")
# These of ROS need only the node's library: ThreadSanitizer's build of them is then half as large.
set(NEED_NO_RECORDINGS "/ros/test_(inbox|map_publisher|octomap_message)\\.cpp$")
file(GLOB TEST_SOURCES CONFIGURE_DEPENDS test/test_*.cpp)
if(FRONTIER_SURFELS_WITH_ROS)
  file(GLOB ROS_TEST_SOURCES CONFIGURE_DEPENDS test/ros/test_*.cpp)
  if(CATKIN_ENABLE_TESTING)
    find_package(pcl_conversions QUIET)
  endif()
  if(NOT pcl_conversions_FOUND)
    list(FILTER ROS_TEST_SOURCES EXCLUDE REGEX "/test_pcl_clouds\\.cpp$")
    message(WARNING "frontier_surfels: no pcl_conversions found, so its test is LEFT OUT: scripts/install_dependencies --test")
  endif()
  list(APPEND TEST_SOURCES ${ROS_TEST_SOURCES})
endif()
if(NOT FRONTIER_SURFELS_TOOLS)
  list(FILTER TEST_SOURCES EXCLUDE REGEX ${NEED_TOOLS})
endif()
find_library(PCL_IO_LIBRARY pcl_io)  # the component io would look for VTK and MPI as well
if(NOT PCL_FOUND OR NOT PCL_IO_LIBRARY)
  list(FILTER TEST_SOURCES EXCLUDE REGEX "/test_pcl\\.cpp$")
  message(WARNING "frontier_surfels: PCL was not found, so its test is LEFT OUT. Run scripts/install_dependencies --test.")
endif()

find_package(rapidcheck QUIET)
if(NOT rapidcheck_FOUND)
  list(FILTER TEST_SOURCES EXCLUDE REGEX "/test_mapper_model\\.cpp$")
  message(WARNING "frontier_surfels: rapidcheck was not found, so its test is LEFT OUT. Run scripts/install_dependencies --test.")
endif()

# What nearly every test includes is compiled once.
add_executable(frontier_surfels_test_headers test/precompiled.cpp)
set_target_properties(frontier_surfels_test_headers PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/test)
target_include_directories(frontier_surfels_test_headers PRIVATE src kernels test)
target_link_libraries(frontier_surfels_test_headers PRIVATE frontier_surfels frontier_surfels_opencl GTest::gtest_main)
target_precompile_headers(frontier_surfels_test_headers PRIVATE <gtest/gtest.h> <algorithm> <atomic> <chrono> <filesystem> <fstream> <functional> <map>
  <memory> <mutex> <random> <string> <thread> <vector> <Eigen/Geometry> <CL/opencl.hpp> <frontier_surfels/mapper.hpp>)
if(CATKIN_TOPLEVEL)  # in a workspace, tests are built only by `make tests`
  set_target_properties(frontier_surfels_test_headers PROPERTIES EXCLUDE_FROM_ALL TRUE)
endif()

foreach(source ${TEST_SOURCES})
  get_filename_component(name ${source} NAME_WE)
  set(target frontier_surfels_${name})  # the packages of a workspace share one set of target names
  add_executable(${target} ${source})
  set_target_properties(${target} PROPERTIES OUTPUT_NAME ${name} RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/test)
  target_include_directories(${target} PRIVATE src kernels test)
  target_compile_definitions(${target} PRIVATE
    FRONTIER_SURFELS_SOURCE_DIR="${PROJECT_SOURCE_DIR}" FRONTIER_SURFELS_DATA_DIR="${FRONTIER_SURFELS_DATA}")
  target_link_libraries(${target} PRIVATE Threads::Threads GTest::gtest_main)
  if(NOT source MATCHES ${NEED_NOTHING})
    target_link_libraries(${target} PRIVATE frontier_surfels frontier_surfels_opencl SQLiteCpp)
    target_precompile_headers(${target} REUSE_FROM frontier_surfels_test_headers)
    if(source MATCHES ${NEED_NO_RECORDINGS})
      target_link_libraries(${target} PRIVATE frontier_surfels_ros)
    elseif(source MATCHES ${NEED_TOOLS})
      target_link_libraries(${target} PRIVATE frontier_surfels_replay)
    endif()
  endif()
  add_test(NAME ${name} COMMAND ${target})
  set_tests_properties(${name} PROPERTIES ENVIRONMENT "POCL_CACHE_DIR=${POCL_CACHE}" TIMEOUT 600)
  # Kernels are tested at both widths, and so is what the host does in another way for graphics processors.
  if(name MATCHES "^test_(stage_|surfel_packing|mapper_(changes|ids|splits)$)")
    add_test(NAME ${name}_lanes_1 COMMAND ${target})
    set_tests_properties(${name}_lanes_1 PROPERTIES
      ENVIRONMENT "POCL_CACHE_DIR=${POCL_CACHE};FRONTIER_SURFELS_TEST_LANES=1" TIMEOUT 600)
  endif()
  # The kernels in which work items wait for each other at barriers that PoCL compiles within seconds.
  if(name MATCHES "^test_stage_(creation|evidence|taken_points|taking_back|thin_gaps)$")
    add_test(NAME ${name}_groups COMMAND ${target})
    set_tests_properties(${name}_groups PROPERTIES
      ENVIRONMENT "POCL_CACHE_DIR=${POCL_CACHE};FRONTIER_SURFELS_TEST_LANES=1;FRONTIER_SURFELS_TEST_GROUPS=1" TIMEOUT 600)
  endif()
  if(CATKIN_TOPLEVEL)  # in a workspace, tests are built only by `make tests`
    set_target_properties(${target} PROPERTIES EXCLUDE_FROM_ALL TRUE)
    if(TARGET tests)
      add_dependencies(tests ${target})
    endif()
  endif()
endforeach()

if(TARGET frontier_surfels_test_pcl_clouds)
  target_include_directories(frontier_surfels_test_pcl_clouds SYSTEM PRIVATE ${pcl_conversions_INCLUDE_DIRS})
  list(FILTER pcl_conversions_LIBRARIES INCLUDE REGEX "pcl_")  # without those of viewers
  target_link_libraries(frontier_surfels_test_pcl_clouds PRIVATE ${pcl_conversions_LIBRARIES})
endif()

if(TARGET frontier_surfels_test_mapper_model)
  target_link_libraries(frontier_surfels_test_mapper_model PRIVATE rapidcheck)
endif()

if(TARGET frontier_surfels_test_octomap_truth_states)  # makes trees of its own
  target_include_directories(frontier_surfels_test_octomap_truth_states SYSTEM PRIVATE ${OCTOMAP_INCLUDE_DIRS})
  target_link_libraries(frontier_surfels_test_octomap_truth_states PRIVATE ${OCTOMAP_LIBRARIES})
endif()

if(TARGET frontier_surfels_test_pcl)
  target_include_directories(frontier_surfels_test_pcl SYSTEM PRIVATE ${PCL_INCLUDE_DIRS})
  target_link_libraries(frontier_surfels_test_pcl PRIVATE ${PCL_LIBRARIES} ${PCL_IO_LIBRARY})
endif()

# What a frame costs on a device, and the frames for it: scripts/pack_device_tests carries both to other machines.
set(DEVICE_PROGRAMS device_times)
if(FRONTIER_SURFELS_TOOLS)
  list(APPEND DEVICE_PROGRAMS raw_frames)
endif()
foreach(name ${DEVICE_PROGRAMS})
  set(target frontier_surfels_${name})
  add_executable(${target} test/device/${name}.cpp)
  set_target_properties(${target} PROPERTIES OUTPUT_NAME ${name} RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/test)
  target_include_directories(${target} PRIVATE test)
  target_link_libraries(${target} PRIVATE frontier_surfels frontier_surfels_opencl)
  if(CATKIN_TOPLEVEL)
    set_target_properties(${target} PROPERTIES EXCLUDE_FROM_ALL TRUE)
  endif()
endforeach()
if(FRONTIER_SURFELS_TOOLS)
  target_link_libraries(frontier_surfels_raw_frames PRIVATE frontier_surfels_replay)
endif()

if(NOT FRONTIER_SURFELS_TOOLS)
  return()
endif()

# The programs as a user calls them. /usr/bin/python3 is the Python that has the report's modules.
foreach(name test_replay_score test_replay_failures test_replay_truth)
  add_test(NAME ${name}
    COMMAND /usr/bin/python3 -B ${PROJECT_SOURCE_DIR}/test/${name}.py $<TARGET_FILE:replay_score> $<TARGET_FILE:make_synthetic>)
endforeach()
foreach(name test_report_page test_explore_page)
  add_test(NAME ${name} COMMAND /usr/bin/python3 -B ${PROJECT_SOURCE_DIR}/test/${name}.py)
endforeach()
add_test(NAME test_bench
  COMMAND /usr/bin/python3 ${PROJECT_SOURCE_DIR}/test/test_bench.py $<TARGET_FILE:bench> $<TARGET_FILE:make_synthetic>
    ${PROJECT_SOURCE_DIR}/scripts/bench_table)
set_tests_properties(test_replay_score test_replay_failures test_replay_truth test_bench PROPERTIES ENVIRONMENT "POCL_CACHE_DIR=${POCL_CACHE}" TIMEOUT 600)

if(FRONTIER_SURFELS_WITH_ROS)
  include(cmake/ros_tests.cmake)
endif()
