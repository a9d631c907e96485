/// A frame as OctoMap takes it.
#pragma once

#include <octomap/Pointcloud.h>

#include "scoring/decimated_depth.hpp"

namespace frontier_surfels::scoring {

/// The measured pixels of a frame, in the world [m].
inline octomap::Pointcloud to_octomap_cloud(const DepthFrame& frame, const DepthRange& range) {
  const DecimatedDepth decimated = decimate(frame, range);
  const Intrinsics& camera = decimated.intrinsics;
  octomap::Pointcloud cloud;
  for (int t = 0; t < camera.height; ++t) {
    for (int s = 0; s < camera.width; ++s) {
      const double z = decimated.depth[static_cast<std::size_t>(t) * camera.width + s];
      if (!(z > 0)) continue;
      const Eigen::Vector3d p = frame.T_world_camera * Eigen::Vector3d((s - camera.cx) * z / camera.fx, (t - camera.cy) * z / camera.fy, z);
      cloud.push_back(static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()));
    }
  }
  return cloud;
}

/// Where its rays begin, in the world [m].
inline octomap::point3d octomap_origin(const DepthFrame& frame) {
  const Eigen::Vector3f origin = frame.T_world_camera.translation().cast<float>();
  return {origin.x(), origin.y(), origin.z()};
}

}  // namespace frontier_surfels::scoring
