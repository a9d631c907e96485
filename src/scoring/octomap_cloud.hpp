/// A frame as OctoMap takes it.
#pragma once

#include <octomap/Pointcloud.h>

#include "scoring/decimated_depth.hpp"

namespace frontier_surfels::scoring {

/// What the pixels of a frame have met, in the world [m].
struct OctomapClouds {
  octomap::Pointcloud surface;     ///< measured points
  octomap::Pointcloud free_space;  ///< ends of the rays that have met nothing
};

inline OctomapClouds to_octomap_clouds(const DepthFrame& frame, const DepthReading& reading) {
  const DecimatedDepth decimated = decimate(frame, reading);
  const Intrinsics& camera = decimated.intrinsics;
  OctomapClouds clouds;
  for (int t = 0; t < camera.height; ++t) {
    for (int s = 0; s < camera.width; ++s) {
      const double d = decimated.depth[static_cast<std::size_t>(t) * camera.width + s], z = std::abs(d);
      if (d == 0) continue;
      const Eigen::Vector3d p = frame.T_world_camera * Eigen::Vector3d((s - camera.cx) * z / camera.fx, (t - camera.cy) * z / camera.fy, z);
      (d > 0 ? clouds.surface : clouds.free_space)
          .push_back(static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()));
    }
  }
  return clouds;
}

/// Where its rays begin, in the world [m].
inline octomap::point3d octomap_origin(const DepthFrame& frame) {
  const Eigen::Vector3f origin = frame.T_world_camera.translation().cast<float>();
  return {origin.x(), origin.y(), origin.z()};
}

}  // namespace frontier_surfels::scoring
