/// The faces of an object during a stand: which of their points frames have seen, and which a map has.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "frontier_surfels/scoring/object_test.hpp"
#include "scoring/decimated_depth.hpp"

namespace frontier_surfels::scoring {

/// A point of a face; the normal has unit length and points out of the object.
struct FacePoint {
  Eigen::Vector3d position, normal;
};

/// Points about 1 cm apart on all faces of the boxes, without those that lie in another box.
std::vector<FacePoint> face_points(const std::vector<OrientedBox>& boxes);

/// Cosine of the angle between the ray to a point and its normal; 0 if the frame does not see the point: because it faces away, lies
/// outside of the image or of the depth range, or behind something.
double seen_cosine(const FacePoint& point_world, const DepthFrame& frame, const DepthReading& reading);

class StandRecord {
 public:
  StandRecord(const SceneObject& object, const Stand& stand);

  const Stand& stand() const { return stand_; }

  /// Adds a frame of the stand, after the mapper has taken it.
  void add(std::size_t index, const DepthFrame& ideal, const DepthReading& reading, const ObjectTest::SurfelsIn& surfels_in);

  /// @param surfels_in  if not empty: the map after the last frame of the stand
  StandScore score(const ObjectTest::SurfelsIn& surfels_in) const;

 private:
  static constexpr std::size_t kCosines = std::size(ObjectTest::kCosines);

  using AllCovered = std::array<FacesCovered, kCosines>;

  bool counts(std::size_t point, std::size_t cosine) const { return views_[point][cosine] >= ObjectTest::kFewestViews; }
  AllCovered covered(const ObjectTest::SurfelsIn& surfels_in) const;

  Stand stand_;
  std::vector<FacePoint> points_;                           ///< world
  Eigen::AlignedBox3d near_;                                ///< contains all surfels that can cover a point
  std::vector<std::array<std::uint32_t, kCosines>> views_;  ///< of each point, the frames that have seen it above each cosine
  std::optional<std::size_t> first_seen_;                   ///< index of a frame
  std::size_t frames_since_ = 0;                            ///< frames after that one
  std::optional<AllCovered> early_, latest_;
};

}  // namespace frontier_surfels::scoring
