# The mapper among ROS nodes, and the conversions of ROS messages.

file(GLOB ROS_SOURCES CONFIGURE_DEPENDS src/ros/*.cpp src/ros/*/*.cpp)
list(FILTER ROS_SOURCES EXCLUDE REGEX "/(mapper_node\\.cpp|(simulation|exploration)/[a-z_]+\\.cpp)$")  # these need the tools
add_library(frontier_surfels_ros SHARED ${ROS_SOURCES})
add_dependencies(frontier_surfels_ros ${${PROJECT_NAME}_EXPORTED_TARGETS})
target_include_directories(frontier_surfels_ros SYSTEM PUBLIC ${catkin_INCLUDE_DIRS} ${OpenCV_INCLUDE_DIRS})
target_include_directories(frontier_surfels_ros PUBLIC src)
find_package(octomap REQUIRED)  # the octree for planners
find_package(octomap_msgs QUIET)  # where it exists, the node publishes the octree as well
if(octomap_msgs_FOUND)
  target_compile_definitions(frontier_surfels_ros PUBLIC FRONTIER_SURFELS_OCTOMAP_MSGS)
  target_include_directories(frontier_surfels_ros SYSTEM PUBLIC ${octomap_msgs_INCLUDE_DIRS})
endif()
target_include_directories(frontier_surfels_ros SYSTEM PUBLIC ${OCTOMAP_INCLUDE_DIRS})
target_link_libraries(frontier_surfels_ros PUBLIC frontier_surfels ${catkin_LIBRARIES} ${OCTOMAP_LIBRARIES} ${OpenCV_LIBS} Threads::Threads)

add_executable(mapper_node src/ros/mapper_node.cpp)
target_link_libraries(mapper_node PRIVATE frontier_surfels_ros)
