/// Nearest surfel centre to a point.
#pragma once

#include <cmath>
#include <limits>
#include <nanoflann.hpp>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels::scoring {

/// A k-d tree over the finite ones among a cloud's centres. The cloud must outlive it.
class SurfelTree {
 public:
  struct Neighbour {
    const Surfel* surfel;  ///< null if there is none
    double distance;       ///< [m]; infinite if there is none
  };

  explicit SurfelTree(const std::vector<Surfel>& surfels) : centres_(finite(surfels)), tree_(3, centres_) { tree_.buildIndex(); }
  SurfelTree(const SurfelTree&) = delete;
  SurfelTree& operator=(const SurfelTree&) = delete;

  Neighbour nearest(const Eigen::Vector3d& p) const {
    if (!p.allFinite()) return {nullptr, std::numeric_limits<double>::infinity()};
    std::size_t index = 0;
    double squared_distance = 0;
    const bool found = tree_.knnSearch(p.data(), 1, &index, &squared_distance) > 0;
    if (!found) return {nullptr, std::numeric_limits<double>::infinity()};
    return {centres_.surfels[index], std::sqrt(squared_distance)};
  }

 private:
  /// What nanoflann asks of a cloud.
  struct Centres {
    std::vector<const Surfel*> surfels;
    std::size_t kdtree_get_point_count() const { return surfels.size(); }
    double kdtree_get_pt(std::size_t index, std::size_t axis) const { return surfels[index]->position[axis]; }
    template <typename Box>
    bool kdtree_get_bbox(Box&) const {
      return false;
    }
  };

  static Centres finite(const std::vector<Surfel>& surfels) {
    Centres centres;
    centres.surfels.reserve(surfels.size());
    for (const Surfel& surfel : surfels) {
      if (surfel.position.allFinite()) centres.surfels.push_back(&surfel);
    }
    return centres;
  }

  Centres centres_;
  nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Centres>, Centres, 3, std::size_t> tree_;
};

}  // namespace frontier_surfels::scoring
