/// The map as mav_active_3d_planning asks for it: the functions of its classes Map and OccupancyMap, on a MapClient.
///
///     class SurfelMap : public active_3d_planning::map::OccupancyMap {
///       bool isObserved(const Eigen::Vector3d& point) override { return map_->isObserved(point); }  // and so on for all functions
///       frontier_surfels::MapClient client_;                                                        // follows ~states_update
///       std::unique_ptr<frontier_surfels::adapters::Active3dPlanningMap> map_;
///     };
#pragma once

#include <Eigen/Geometry>

#include "frontier_surfels/planner/map_client.hpp"

namespace frontier_surfels::adapters {

/// What MapClient says of threads holds here as well.
class Active3dPlanningMap {
 public:
  static constexpr unsigned char OCCUPIED = 0, FREE = 1, UNKNOWN = 2;

  /// @param client  must outlive this object. @param collision_radius  of the robot [m]: getSystemConstraints().collision_radius
  Active3dPlanningMap(const MapClient& client, double collision_radius)
      : client_(client), collision_radius_(static_cast<float>(collision_radius)) {}

  /// Is there nothing but free space within the collision radius? The orientation makes no difference to a ball.
  bool isTraversable(const Eigen::Vector3d& position, const Eigen::Quaterniond& /*orientation*/ = Eigen::Quaterniond::Identity()) const {
    const float most = collision_radius_ + static_cast<float>(getVoxelSize());
    return client_.grid().clearance(position.cast<float>(), most) > collision_radius_;
  }

  bool isObserved(const Eigen::Vector3d& point) const { return getVoxelState(point) != UNKNOWN; }

  unsigned char getVoxelState(const Eigen::Vector3d& point) const {
    const SpaceState state = client_.grid().state(point.cast<float>());
    return state == SpaceState::kOccupied ? OCCUPIED : state == SpaceState::kFree ? FREE : UNKNOWN;
  }

  double getVoxelSize() const { return client_.grid().resolution(); }

  /// @return false  the point is not finite, and nothing was done
  bool getVoxelCenter(Eigen::Vector3d* center, const Eigen::Vector3d& point) const {
    if (!point.allFinite()) return false;
    *center = ((point.cast<float>().cast<double>().array() * (1 / getVoxelSize())).floor() + 0.5) * getVoxelSize();
    return true;
  }

 private:
  const MapClient& client_;
  float collision_radius_;
};

}  // namespace frontier_surfels::adapters
