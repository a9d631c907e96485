# rostests start a roscore and mappers and send real messages. ctest runs them like all others; in a workspace `run_tests` does, too.

if(DEFINED CATKIN_ENABLE_TESTING AND NOT CATKIN_ENABLE_TESTING)
  return()
endif()
find_package(rostest REQUIRED)

file(GLOB ROSTESTS CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/test/ros/*.test)
find_program(RVIZ rviz PATHS /usr/lib/rviz NO_CACHE)
if(NOT RVIZ)
  list(FILTER ROSTESTS EXCLUDE REGEX "/rviz\\.test$")
  message(WARNING "frontier_surfels: rviz was not found, so its test is LEFT OUT. Run scripts/install_dependencies --test.")
endif()

foreach(file ${ROSTESTS})
  get_filename_component(name ${file} NAME)
  # The tests find nodelets and programs only when they run, so the dependencies must be named here.
  add_rostest(test/ros/${name} DEPENDENCIES frontier_surfels_ros mapper_node ${PROGRAMS})
  set_tests_properties(_ctest_${PROJECT_NAME}_rostest_test_ros_${name} PROPERTIES TIMEOUT 600
    ENVIRONMENT "POCL_CACHE_DIR=${POCL_CACHE};PYTHONDONTWRITEBYTECODE=1;ROSCONSOLE_STDOUT_LINE_BUFFERED=1;ROS_HOSTNAME=localhost;\
ROS_HOME=${CMAKE_CURRENT_BINARY_DIR}/ros_home")
endforeach()
