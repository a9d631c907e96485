# Installs libraries, headers, programs and data, and what find_package(frontier_surfels) needs, with and without ROS.

# RPATHs are relative, so that programs find the libraries wherever the prefix is moved to.
file(RELATIVE_PATH to_libraries /${INSTALL_PROGRAMS_TO} /${INSTALL_LIBRARIES_TO})
set_target_properties(${LIBRARIES} PROPERTIES INSTALL_RPATH "$ORIGIN")
install(TARGETS ${LIBRARIES} EXPORT frontier_surfelsTargets LIBRARY DESTINATION ${INSTALL_LIBRARIES_TO})
install(DIRECTORY include/frontier_surfels/ DESTINATION ${INSTALL_INCLUDES_TO}
  PATTERN scoring EXCLUDE)
install(DIRECTORY config DESTINATION ${INSTALL_SHARE_TO})
if(FRONTIER_SURFELS_TOOLS)
  set_target_properties(${PROGRAMS} PROPERTIES INSTALL_RPATH "$ORIGIN/${to_libraries}")
  install(TARGETS ${PROGRAMS} RUNTIME DESTINATION ${INSTALL_PROGRAMS_TO})
  install(DIRECTORY include/frontier_surfels/scoring DESTINATION ${INSTALL_INCLUDES_TO})
  install(DIRECTORY share/ DESTINATION ${INSTALL_SHARE_TO})  # templates of the pages
  file(GLOB PYTHON_SCRIPTS CONFIGURE_DEPENDS scripts/*.py)
  install(PROGRAMS ${PYTHON_SCRIPTS} DESTINATION ${INSTALL_PROGRAMS_TO})  # replay_score looks for them beside itself
endif()
if(FRONTIER_SURFELS_WITH_ROS)
  set_target_properties(mapper_node PROPERTIES INSTALL_RPATH "$ORIGIN/${to_libraries}")
  set_target_properties(frontier_surfels_ros PROPERTIES INSTALL_RPATH "$ORIGIN")
  install(TARGETS frontier_surfels_ros LIBRARY DESTINATION ${INSTALL_LIBRARIES_TO})
  install(TARGETS mapper_node RUNTIME DESTINATION ${INSTALL_PROGRAMS_TO})
  install(FILES nodelet_plugins.xml DESTINATION ${INSTALL_SHARE_TO})
  install(DIRECTORY launch rviz DESTINATION ${INSTALL_SHARE_TO})
endif()

# With catkin, find_package reads catkin's own config file, which includes frontier_surfels-extras.cmake; without catkin,
# frontier_surfels-extras.cmake itself is the config file. It includes the targets.
if(FRONTIER_SURFELS_WITH_ROS)
  set(package_dir ${INSTALL_SHARE_TO}/cmake)
  if(CMAKE_INSTALL_PREFIX STREQUAL "/usr")
    set(package_dir ${INSTALL_LIBRARIES_TO}/cmake/frontier_surfels)  # where catkin then puts its config file
  endif()
  export(EXPORT frontier_surfelsTargets NAMESPACE frontier_surfels::
    FILE ${CATKIN_DEVEL_PREFIX}/share/frontier_surfels/cmake/frontier_surfelsTargets.cmake)
else()
  set(package_dir ${INSTALL_LIBRARIES_TO}/cmake/frontier_surfels)
  include(CMakePackageConfigHelpers)
  write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/frontier_surfelsConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  configure_file(cmake/frontier_surfels-extras.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/frontier_surfelsConfig.cmake COPYONLY)
  #catkin_lint: ignore_once missing_file
  install(FILES ${CMAKE_CURRENT_BINARY_DIR}/frontier_surfelsConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/frontier_surfelsConfigVersion.cmake
    DESTINATION ${package_dir})
endif()
install(EXPORT frontier_surfelsTargets NAMESPACE frontier_surfels:: DESTINATION ${package_dir})
