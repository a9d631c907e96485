/// Nearest surfel centre to a point.
#pragma once

#include <pcl/kdtree/kdtree_flann.h>
#include <pcl/point_types.h>

#include <limits>
#include <memory>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels::scoring {

/// A k-d tree of a cloud's finite centres. The cloud must outlive it. Several threads may ask it at once.
class SurfelTree {
 public:
  struct Neighbour {
    const Surfel* surfel;  ///< null if there is none
    double distance;       ///< [m]; infinite if there is none
  };

  explicit SurfelTree(const std::vector<Surfel>& surfels) {
    const auto centres = std::make_shared<pcl::PointCloud<pcl::PointXYZ>>();
    for (const Surfel& surfel : surfels) {
      if (!surfel.position.allFinite()) continue;
      surfels_.push_back(&surfel);
      centres->push_back({surfel.position.x(), surfel.position.y(), surfel.position.z()});
    }
    if (!surfels_.empty()) tree_.setInputCloud(centres);  // PCL reports an empty cloud as an error
  }
  SurfelTree(const SurfelTree&) = delete;
  SurfelTree& operator=(const SurfelTree&) = delete;

  Neighbour nearest(const Eigen::Vector3d& p) const {
    pcl::Indices index(1);
    std::vector<float> squared_distance(1);
    const Eigen::Vector3f q = p.cast<float>();
    if (surfels_.empty() || !q.allFinite() || tree_.nearestKSearch({q.x(), q.y(), q.z()}, 1, index, squared_distance) == 0)
      return {nullptr, std::numeric_limits<double>::infinity()};
    const Surfel* surfel = surfels_[index.front()];
    return {surfel, (surfel->position.cast<double>() - p).norm()};  // PCL's distance has the precision of a float
  }

 private:
  std::vector<const Surfel*> surfels_;  ///< by their numbers in the tree
  pcl::KdTreeFLANN<pcl::PointXYZ> tree_;
};

}  // namespace frontier_surfels::scoring
