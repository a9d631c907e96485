# The scoring library, and the programs that replay, score, make and measure recordings.

find_package(CLI11 REQUIRED)
find_package(benchmark REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(octomap REQUIRED)
if(NOT PCL_FOUND)
  message(FATAL_ERROR "The scoring library needs PCL: run scripts/install_dependencies, or build with -DFRONTIER_SURFELS_TOOLS=OFF.")
endif()

# Scores of maps.
file(GLOB SCORING_SOURCES CONFIGURE_DEPENDS src/scoring/*.cpp)
add_library(frontier_surfels_scoring SHARED ${SCORING_SOURCES})
target_include_directories(frontier_surfels_scoring SYSTEM PRIVATE ${OCTOMAP_INCLUDE_DIRS} ${PCL_INCLUDE_DIRS})
target_include_directories(frontier_surfels_scoring PRIVATE src)
target_link_libraries(frontier_surfels_scoring
  PUBLIC frontier_surfels
  PRIVATE ${OCTOMAP_LIBRARIES} ${PCL_COMMON_LIBRARIES} ${PCL_KDTREE_LIBRARIES} FLANN::FLANN Threads::Threads)
add_library(frontier_surfels::frontier_surfels_scoring ALIAS frontier_surfels_scoring)
list(APPEND LIBRARIES frontier_surfels_scoring)

# Recordings and reports. This library is for the programs below and is not installed.
set(PROGRAMS replay_score make_synthetic)
if(FRONTIER_SURFELS_WITH_ROS)
  list(APPEND PROGRAMS sequence_to_bag)
endif()
file(GLOB REPLAY_SOURCES CONFIGURE_DEPENDS src/recordings/*.cpp src/synthetic/*.cpp src/replay/*.cpp src/apps/*.cpp)
list(FILTER REPLAY_SOURCES EXCLUDE REGEX "/(replay_score|make_synthetic|sequence_to_bag)\\.cpp$")
if(NOT FRONTIER_SURFELS_WITH_ROS)
  list(FILTER REPLAY_SOURCES EXCLUDE REGEX "/bag_[a-z_]*\\.cpp$")
endif()
add_library(frontier_surfels_replay STATIC ${REPLAY_SOURCES})
target_include_directories(frontier_surfels_replay SYSTEM PUBLIC ${OpenCV_INCLUDE_DIRS})
target_include_directories(frontier_surfels_replay PUBLIC src)
target_link_libraries(frontier_surfels_replay
  PUBLIC frontier_surfels_scoring ${OpenCV_LIBS} nlohmann_json::nlohmann_json
  PRIVATE CLI11::CLI11 Threads::Threads)
file(RELATIVE_PATH SCRIPTS_FROM_BINARY ${CMAKE_RUNTIME_OUTPUT_DIRECTORY} ${PROJECT_SOURCE_DIR}/scripts)
target_compile_definitions(frontier_surfels_replay PRIVATE 
  FRONTIER_SURFELS_SCRIPTS_FROM_BINARY="${SCRIPTS_FROM_BINARY}" FRONTIER_SURFELS_VERSION="${PROJECT_VERSION}")
if(FRONTIER_SURFELS_WITH_ROS)
  target_compile_definitions(frontier_surfels_replay PUBLIC FRONTIER_SURFELS_WITH_ROS)
  target_link_libraries(frontier_surfels_replay PUBLIC frontier_surfels_ros)
endif()

foreach(program ${PROGRAMS})
  add_executable(${program} src/apps/${program}.cpp)
  target_link_libraries(${program} PRIVATE frontier_surfels_replay CLI11::CLI11)
endforeach()

# The benchmark measures what a frame costs.
file(GLOB BENCH_SOURCES CONFIGURE_DEPENDS src/bench/*.cpp)
add_executable(bench ${BENCH_SOURCES})
target_link_libraries(bench PRIVATE frontier_surfels_replay CLI11::CLI11 benchmark::benchmark)
list(APPEND PROGRAMS bench)

# Exploring, as nodes: a depth camera in the synthetic flat, a planner, and an OctoMap to compare the mapper with.
if(FRONTIER_SURFELS_WITH_ROS)
  file(GLOB SIMULATION_SOURCES CONFIGURE_DEPENDS src/ros/simulation/*.cpp)
  add_executable(simulated_camera ${SIMULATION_SOURCES})
  target_link_libraries(simulated_camera PRIVATE frontier_surfels_replay)
  add_executable(explore src/ros/exploration/explore_node.cpp src/ros/exploration/exploration_log.cpp)
  target_link_libraries(explore PRIVATE frontier_surfels_replay)
  add_executable(octomap_frontiers src/ros/exploration/octomap_frontiers.cpp)
  target_link_libraries(octomap_frontiers PRIVATE frontier_surfels_ros frontier_surfels_scoring)
  list(APPEND PROGRAMS simulated_camera explore octomap_frontiers)
endif()
