/// Surfels that a map has left in places where an object stood.
#pragma once

#include <vector>

#include "frontier_surfels/scoring/object_test.hpp"
#include "scoring/exact_test_view.hpp"

namespace frontier_surfels::scoring {

/// A frame since the first departure of an object, at the true pose.
struct LaterView {
  std::size_t index = 0;  ///< of the frame in the recording
  ExactView view;
};

class LeftPlaces {
 public:
  explicit LeftPlaces(const SceneObject& object);

  /// Whether the object has left a place before this frame.
  bool any_before(std::size_t frame) const { return !places_.empty() && places_.front().last < frame; }

  /// Counts the surfels of a map that are left in a frame.
  /// @param views  all frames since the first departure, up to this one
  LeftSurfels count(std::size_t frame, const std::vector<LaterView>& views, const ObjectTest::SurfelsIn& surfels_in) const;

 private:
  /// A stand, grown by kLeftDistance.
  struct Place {
    std::size_t first, last;
    std::vector<OrientedBox> boxes;  ///< world
    Eigen::AlignedBox3d bounds;
  };

  /// The last place before `frame` that contains the point; null if there is none, or if the object stands there in this frame.
  const Place* left_place(const Eigen::Vector3d& p_world, std::size_t frame) const;

  std::vector<Place> places_;  ///< in the order of their frames
};

}  // namespace frontier_surfels::scoring
