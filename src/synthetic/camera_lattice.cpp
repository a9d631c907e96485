#include "synthetic/camera_lattice.hpp"

#include "config/config_text.hpp"

namespace frontier_surfels::replay {

using Eigen::Array3i;
using Eigen::Vector3d;

CameraLattice::CameraLattice(const World& world, const Eigen::AlignedBox3d& box, const Vector3d& start, double step, double clearance)
    : step_(step) {
  if (!start.allFinite() || !box.contains(start) || !(world.distance(start) >= clearance)) {
    throw Error("The start of the camera, " + to_text(start.x()) + ", " + to_text(start.y()) + ", " + to_text(start.z()) +
                " m, must lie within its bounds and have " + to_text(clearance) + " m of free space around it.");
  }
  const Array3i below = ((start - box.min()) / step).array().floor().cast<int>();
  const Array3i above = ((box.max() - start) / step).array().floor().cast<int>();
  origin_ = start - step * below.cast<double>().matrix();
  size_ = below + above + 1;
  reached_.assign(static_cast<std::size_t>(size_.prod()), 0);

  std::vector<Array3i> to_visit = {below};
  reached_[index(below)] = 1;
  while (!to_visit.empty()) {
    const Array3i place = to_visit.back();
    to_visit.pop_back();
    for (int direction = 0; direction < 6; ++direction) {
      Array3i next = place;
      next[direction / 2] += direction % 2 == 0 ? 1 : -1;
      if ((next < 0).any() || (next >= size_).any() || reached_[index(next)]) continue;
      if (world.free_length(position(place), position(next), clearance) < (position(next) - position(place)).norm()) continue;
      reached_[index(next)] = 1;
      to_visit.push_back(next);
    }
  }
}

std::vector<Vector3d> CameraLattice::positions() const {
  std::vector<Vector3d> positions;
  for (int z = 0; z < size_.z(); ++z) {
    for (int y = 0; y < size_.y(); ++y) {
      for (int x = 0; x < size_.x(); ++x) {
        if (reached_[index({x, y, z})]) positions.push_back(position({x, y, z}));
      }
    }
  }
  return positions;
}

}  // namespace frontier_surfels::replay
