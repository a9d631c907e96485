/// The map as gbplanner asks for it: the functions of its class MapManager, on a MapClient.
///
///     class SurfelMapManager : public MapManager {
///       double getResolution() const override { return map_.getResolution(); }                // and so on for all functions
///       frontier_surfels::MapClient client_;                                                   // follows ~states_update
///       frontier_surfels::adapters::GbplannerMap<MapManager::VoxelStatus> map_{client_};
///     };
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <unordered_set>
#include <utility>
#include <vector>

#include "frontier_surfels/planner/map_client.hpp"

namespace frontier_surfels::adapters {

enum GbplannerStatus { kUnknown = 0, kOccupied, kFree };

/// @tparam Status  MapManager::VoxelStatus, or anything with the same names
/// Places that are not finite, or more than 10 km from the origin, are unknown. What MapClient says of threads holds here as well.
template <typename Status = GbplannerStatus>
class GbplannerMap {
 public:
  using Point = Eigen::Vector3d;
  using Points = std::vector<Point>;

  /// @param client  must outlive this object. @param reach  how far tsdf_dist looks [m]
  explicit GbplannerMap(const MapClient& client, double reach = 0.5) : client_(client), reach_(static_cast<float>(reach)) {}

  double getResolution() const { return grid().resolution(); }
  bool getStatus() const { return grid().sequence() != 0; }

  Status getVoxelStatus(const Point& position) const { return is_place(position) ? status(cell_of(position)) : Status::kUnknown; }

  Status getRayStatus(const Point& from, const Point& to, bool stop_at_unknown) const {
    Point end;
    return cast(from, to, stop_at_unknown, end);
  }

  /// @param end_voxel  the centre of the voxel that stopped the ray, or the ray's end
  /// @param tsdf_dist  0 at an occupied voxel, minus the reach at an unknown one, else the room around the ray's end, at most the reach
  Status getRayStatus(const Point& from, const Point& to, bool stop_at_unknown, Point& end_voxel, double& tsdf_dist) const {
    const Status found = cast(from, to, stop_at_unknown, end_voxel);
    const Status there = found == Status::kFree ? getVoxelStatus(end_voxel) : found;
    tsdf_dist = there == Status::kOccupied ? 0 : there == Status::kUnknown ? -reach_ : grid().clearance(end_voxel.cast<float>(), reach_);
    return found;
  }

  /// Occupied if one of the voxels is that the box touches, else unknown if one is, else free, whatever stop_at_unknown is.
  Status getBoxStatus(const Point& center, const Point& size, bool /*stop_at_unknown*/) const {
    const Eigen::AlignedBox3d box(center - size / 2, center + size / 2);
    const SpaceState state = grid().box_state(box.cast<float>());
    if (state != SpaceState::kUnknown || freed_.empty() || !is_place(box.min()) || !is_place(box.max())) return to_status(state);
    bool unknown = false;
    for_cells(cell_of(box.min()), cell_of(box.max()), [&](const Cell& cell) { unknown = unknown || status(cell) == Status::kUnknown; });
    return unknown ? Status::kUnknown : Status::kFree;
  }

  /// Of a box that is moved along a line, in steps of half a voxel.
  Status getPathStatus(const Point& start, const Point& end, const Point& box_size, bool stop_at_unknown) const {
    if (!is_place(start) || !is_place(end)) return Status::kUnknown;
    const int steps = 1 + static_cast<int>(2 * (end - start).norm() / getResolution());
    for (int n = 0; n <= steps; ++n) {
      const Status here = getBoxStatus(start + (end - start) * n / steps, box_size, stop_at_unknown);
      if (here == Status::kOccupied || (here == Status::kUnknown && stop_at_unknown)) return here;
    }
    return Status::kFree;
  }

  /// From now on, voxels that the box touches count as free where the grid is unknown.
  /// @return false  there is no map yet, or it is no box; nothing was done
  bool augmentFreeBox(const Point& position, const Point& box_size) {
    const Point half = box_size / 2;
    if (!getStatus() || !(half.array() >= 0).all() || !is_place(position - half) || !is_place(position + half)) return false;
    if (freed_resolution_ != getResolution()) freed_.clear();  // they were voxels of another grid
    freed_resolution_ = getResolution();
    for_cells(cell_of(position - half), cell_of(position + half), [&](const Cell& cell) { freed_.insert(number(cell)); });
    return true;
  }

  /// Adds the voxels that rays meet up to their first occupied one, each once, however many rays cross it.
  /// @param gain_log  how many are unknown, free and occupied. @param sensor  not used: the end points have its range
  template <typename Sensor>
  void getScanStatus(const Point& pos, const Points& multiray_endpoints, std::tuple<int, int, int>& gain_log,
                     std::vector<std::pair<Point, Status>>& voxel_log, const Sensor& /*sensor*/) const {
    std::array<int, 3> count = {0, 0, 0};
    std::unordered_set<std::uint64_t> counted;
    for (const Point& end : multiray_endpoints)
      walk(pos, end, [&](const Cell& cell) {
        const Status here = status(cell);
        if (counted.insert(number(cell)).second) {
          ++count[static_cast<std::size_t>(here)];
          voxel_log.emplace_back(center_of(cell), here);
        }
        return here != Status::kOccupied;
      });
    gain_log = {count[Status::kUnknown], count[Status::kFree], count[Status::kOccupied]};
  }

  /// The mapper itself has freed what its camera sees.
  void augmentFreeFrustum() {}

  /// Centres of the known voxels in a box.
  void extractLocalMap(const Point& center, const Point& box_size, Points& occupied_voxels, Points& free_voxels) const {
    extractLocalMapAlongAxis(center, Point::UnitX(), box_size, occupied_voxels, free_voxels);
  }

  /// The same of a box that is turned so that its x axis has the direction of `axis`.
  void extractLocalMapAlongAxis(const Point& center, const Point& axis, const Point& box_size, Points& occupied_voxels,
                                Points& free_voxels) const {
    occupied_voxels.clear();
    free_voxels.clear();
    const Eigen::Matrix3d turn = Eigen::Quaterniond::FromTwoVectors(Point::UnitX(), axis).toRotationMatrix();
    const Point half = box_size / 2, around = turn.cwiseAbs() * half;
    if (!is_place(center - around) || !is_place(center + around)) return;
    for_cells(cell_of(center - around), cell_of(center + around), [&](const Cell& cell) {
      const Point voxel = center_of(cell);
      if (((turn.transpose() * (voxel - center)).array().abs() > half.array()).any()) return;
      const Status here = status(cell);
      if (here != Status::kUnknown) (here == Status::kFree ? free_voxels : occupied_voxels).push_back(voxel);
    });
  }

  /// Forgets the added boxes. The map is the mapper's: its service ~reset empties it.
  void resetMap() { freed_.clear(); }

 private:
  using Cell = Eigen::Array3i;

  const StateGrid& grid() const { return client_.grid(); }
  static bool is_place(const Point& p) { return (p.array().abs() < 10000).all(); }
  static Status to_status(SpaceState state) {
    return state == SpaceState::kFree ? Status::kFree : state == SpaceState::kOccupied ? Status::kOccupied : Status::kUnknown;
  }
  Eigen::Array3d scaled(const Point& p) const {  // rounded as the grid does
    const Eigen::Vector3f rounded = p.cast<float>();
    return Eigen::Array3d(rounded.x(), rounded.y(), rounded.z()) * (1 / getResolution());
  }
  Cell cell_of(const Point& p) const { return scaled(p).floor().template cast<int>(); }
  Point center_of(const Cell& cell) const { return (cell.cast<double>() + 0.5) * getResolution(); }
  static std::uint64_t number(const Cell& cell) {
    std::uint64_t number = 0;
    for (const int c : {cell.x(), cell.y(), cell.z()}) number = number << 21 | (static_cast<std::uint32_t>(c) & 0x1fffff);
    return number;
  }

  Status status(const Cell& cell) const {
    const SpaceState state = grid().state(center_of(cell).template cast<float>());
    if (state == SpaceState::kUnknown && freed_.count(number(cell)) != 0 && freed_resolution_ == getResolution()) return Status::kFree;
    return to_status(state);
  }

  template <typename Visit>
  static void for_cells(const Cell& low, const Cell& high, const Visit& visit) {
    for (int x = low.x(); x <= high.x(); ++x)
      for (int y = low.y(); y <= high.y(); ++y)
        for (int z = low.z(); z <= high.z(); ++z) visit(Cell(x, y, z));
  }

  /// Visits the voxels of a ray, the first one included, while `visit` says so.
  template <typename Visit>
  void walk(const Point& from, const Point& to, const Visit& visit) const {
    if (!is_place(from) || !is_place(to)) return;
    const Eigen::Array3d start = scaled(from), way = scaled(to) - start;
    const Cell end = cell_of(to);
    Cell cell = cell_of(from);
    const auto entry = [&](int axis) {  // share of the way to the next voxel along an axis
      return cell[axis] == end[axis] ? HUGE_VAL : (cell[axis] + (way[axis] > 0 ? 1 : 0) - start[axis]) / way[axis];
    };
    Eigen::Array3d next(entry(0), entry(1), entry(2));
    int axis = 0;
    while (visit(cell) && next.minCoeff(&axis) != HUGE_VAL) {
      cell[axis] += way[axis] > 0 ? 1 : -1;
      next[axis] = entry(axis);
    }
  }

  Status cast(const Point& from, const Point& to, bool stop_at_unknown, Point& end) const {
    Status found = is_place(from) && is_place(to) ? Status::kFree : Status::kUnknown;
    end = to;
    walk(from, to, [&](const Cell& cell) {
      const Status here = status(cell);
      if (here == Status::kFree || (here == Status::kUnknown && !stop_at_unknown)) return true;
      found = here;
      end = center_of(cell);
      return false;
    });
    return found;
  }

  const MapClient& client_;
  float reach_;
  double freed_resolution_ = 0;
  std::unordered_set<std::uint64_t> freed_;  ///< numbers of voxels that count as free where the grid is unknown
};

}  // namespace frontier_surfels::adapters
