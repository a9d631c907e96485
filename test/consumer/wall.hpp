// One frame of a wall at 1.5 m.
#pragma once

#include <frontier_surfels/types.hpp>
#include <vector>

struct Wall {
  Wall() {
    frame.intrinsics = {131.25, 131.25, 79.5, 59.5, 160, 120};
    frame.depth.width = 160;
    frame.depth.height = 120;
    frame.depth.step = 160 * sizeof(std::uint16_t);
    frame.depth.data = depth.data();
    frame.T_world_camera = Eigen::Isometry3d::Identity();
  }

  const std::vector<std::uint16_t> depth = std::vector<std::uint16_t>(160 * 120, 1500);  // [mm]
  frontier_surfels::DepthFrame frame;
};
