# Finds ROS 1 if it is wanted and installed. Sets FRONTIER_SURFELS_WITH_ROS, and INSTALL_..._TO: where things are installed.

set(FRONTIER_SURFELS_WITH_ROS OFF)
if(FRONTIER_SURFELS_ROS)
  # catkin and pluginlib need modules that only the system's Python has, even where another Python comes first on PATH.
  foreach(variable PYTHON_EXECUTABLE Python3_EXECUTABLE)
    if(NOT ${variable} AND EXISTS /usr/bin/python3)
      set(${variable} /usr/bin/python3 CACHE FILEPATH "interpreter with the modules of ROS")
    endif()
  endforeach()
  # catkin writes setup.bash and more to the prefix that was configured, whatever `cmake --install --prefix` says. The guard runs first
  # and refuses another prefix.
  set(guard ${CMAKE_CURRENT_BINARY_DIR}/check_prefix.cmake)
  file(WRITE ${guard} "")
  install(CODE "include(\"${guard}\")")

  # find_package(catkin) records the environment for tests and leaves out folders that do not exist yet.
  if(CMAKE_SOURCE_DIR STREQUAL PROJECT_SOURCE_DIR)
    file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/devel/lib/python3/dist-packages)
  endif()

  find_package(catkin QUIET)
  if(catkin_FOUND)
    set(FRONTIER_SURFELS_WITH_ROS ON)
  else()
    message(STATUS "frontier_surfels: catkin was not found, so the nodelet and everything about bags are left out.")
  endif()
else()
  message(STATUS "frontier_surfels: FRONTIER_SURFELS_ROS is OFF, so the nodelet and everything about bags are left out.")
endif()

if(FRONTIER_SURFELS_WITH_ROS)
  if(CATKIN_INSTALL_INTO_PREFIX_ROOT)
    file(WRITE ${guard} "
if(NOT CMAKE_INSTALL_PREFIX STREQUAL \"${CMAKE_INSTALL_PREFIX}\")
  message(FATAL_ERROR \"With ROS the prefix must be known when configuring: run cmake again with -DCMAKE_INSTALL_PREFIX=\${CMAKE_INSTALL_PREFIX}\")
endif()
")
  endif()
  set(tools_need)
  set(exported_libraries frontier_surfels)
  if(FRONTIER_SURFELS_TOOLS)
    set(tools_need rosbag_storage)
    list(APPEND exported_libraries frontier_surfels_scoring)
  endif()
  find_package(catkin REQUIRED COMPONENTS cv_bridge diagnostic_updater geometry_msgs image_geometry image_transport message_generation
    nav_msgs nodelet roscpp rosgraph_msgs sensor_msgs std_msgs std_srvs tf2 tf2_msgs visualization_msgs ${tools_need})
  add_message_files(FILES Coverage.msg FrameReport.msg FrontierCluster.msg FrontierClusterArray.msg StatesUpdate.msg
    SurfelUpdate.msg ViewResult.msg Viewpoint.msg)
  add_service_files(FILES CastRays.srv EvaluateViews.srv GetStateGrid.srv GetStates.srv GetSurfels.srv MapFile.srv MoveCamera.srv)
  generate_messages(DEPENDENCIES geometry_msgs sensor_msgs std_msgs)
  catkin_package(
    INCLUDE_DIRS include
    LIBRARIES ${exported_libraries}
    CATKIN_DEPENDS geometry_msgs message_runtime sensor_msgs std_msgs
    CFG_EXTRAS frontier_surfels-extras.cmake)
  set(INSTALL_PROGRAMS_TO ${CATKIN_PACKAGE_BIN_DESTINATION})
  set(INSTALL_LIBRARIES_TO ${CATKIN_PACKAGE_LIB_DESTINATION})
  set(INSTALL_INCLUDES_TO ${CATKIN_PACKAGE_INCLUDE_DESTINATION})
  set(INSTALL_SHARE_TO ${CATKIN_PACKAGE_SHARE_DESTINATION})
else()
  # This is catkin's layout, except that programs go to bin, where a shell finds them.
  set(INSTALL_PROGRAMS_TO bin)
  set(INSTALL_LIBRARIES_TO lib)
  set(INSTALL_INCLUDES_TO include/frontier_surfels)
  set(INSTALL_SHARE_TO share/frontier_surfels)
  set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/bin)
  set(CMAKE_LIBRARY_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/lib)
endif()
