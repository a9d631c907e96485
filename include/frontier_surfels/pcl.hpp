/// Surfels as PCL's clouds of pcl::PointSurfel. Only this header needs PCL; the library does not.
///
/// With CMake: find_package(frontier_surfels REQUIRED COMPONENTS pcl), and link frontier_surfels::pcl. Programs that link PCL already need
/// only include this header.
#pragma once

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "frontier_surfels/cloud_color.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Position, normal and radius stay as they are. `rgba` is the surfel's colour, or where it has none blue (frontier) or grey (occupied):
/// see cloud_color.hpp. `curvature` is 0. The id does not fit into the point and is lost.
/// @param confident  surfels of this label get `confidence` 1, the others 0; as the mapper node's parameter cloud_confidence
inline pcl::PointSurfel to_pcl(const Surfel& surfel, Label confident = Label::kFrontier) {
  pcl::PointSurfel point;
  point.getVector3fMap() = surfel.position;
  point.getNormalVector3fMap() = surfel.normal;
  point.rgba = to_cloud_color(surfel);
  point.radius = surfel.radius;
  point.confidence = surfel.label == confident ? 1.f : 0.f;
  point.curvature = 0;
  return point;
}

/// The same for all surfels, in their order. The cloud's header is left empty: frame and stamp are the caller's.
inline pcl::PointCloud<pcl::PointSurfel> to_pcl(const std::vector<Surfel>& surfels, Label confident = Label::kFrontier) {
  pcl::PointCloud<pcl::PointSurfel> cloud;
  cloud.reserve(surfels.size());
  for (const Surfel& surfel : surfels) cloud.push_back(to_pcl(surfel, confident));
  return cloud;
}

/// The inverse of to_pcl, but for the id. The label comes from `confidence`; the colour of a label becomes (0, 0, 0) again.
/// @param confident  label of the points whose `confidence` is above 0.5
inline Surfel from_pcl(const pcl::PointSurfel& point, std::uint32_t id = 0, Label confident = Label::kFrontier) {
  const Label other = confident == Label::kFrontier ? Label::kOccupied : Label::kFrontier;
  Surfel surfel;
  surfel.position = point.getVector3fMap();
  surfel.normal = point.getNormalVector3fMap();
  surfel.radius = point.radius;
  surfel.label = point.confidence > 0.5f ? confident : other;
  surfel.rgb = from_cloud_color(point.rgba);
  surfel.id = id;
  return surfel;
}

/// The same for all points. Ids are counted from 0.
/// @throws Error  a point has a position, normal or radius that is not finite, or no radius
inline std::vector<Surfel> from_pcl(const pcl::PointCloud<pcl::PointSurfel>& cloud, Label confident = Label::kFrontier) {
  std::vector<Surfel> surfels;
  surfels.reserve(cloud.size());
  for (const pcl::PointSurfel& point : cloud) {
    const Surfel surfel = from_pcl(point, static_cast<std::uint32_t>(surfels.size()), confident);
    if (!surfel.position.allFinite() || !surfel.normal.allFinite() || !std::isfinite(surfel.radius) || surfel.radius <= 0)
      throw Error("Point " + std::to_string(surfels.size()) + " of the cloud has a value that is not finite, or no radius: remove it.");
    surfels.push_back(surfel);
  }
  return surfels;
}

}  // namespace frontier_surfels
