/// Things that do not stand in the same place all the time, made of boxes: what the truth of a changing scene says of them.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <string>
#include <vector>

namespace frontier_surfels::scoring {

struct OrientedBox {
  Eigen::Isometry3d T_frame_box = Eigen::Isometry3d::Identity();  ///< pose of the box's centre in the frame that it is given in
  Eigen::Vector3d half_size = Eigen::Vector3d::Zero();            ///< [m]

  /// Whether the point lies in the box, or at most `margin` [m] outside of one of its faces.
  bool contains(const Eigen::Vector3d& p, double margin = 0) const { return ((in_box(p).cwiseAbs() - half_size).array() <= margin).all(); }

  /// [m]; 0 inside.
  double distance(const Eigen::Vector3d& p) const { return (in_box(p).cwiseAbs() - half_size).cwiseMax(0).norm(); }

  /// The smallest box with edges along the axes of the frame that contains this one.
  Eigen::AlignedBox3d bounds() const {
    const Eigen::Vector3d reach = T_frame_box.linear().cwiseAbs() * half_size;
    return {T_frame_box.translation() - reach, T_frame_box.translation() + reach};
  }

  /// The point in the box's own frame.
  Eigen::Vector3d in_box(const Eigen::Vector3d& p) const { return T_frame_box.linear().transpose() * (p - T_frame_box.translation()); }
};

/// Where an object stands in the frames `first` to `last` of a recording, counted from 0.
struct Stand {
  std::size_t first = 0, last = 0;
  Eigen::Isometry3d T_world_object = Eigen::Isometry3d::Identity();

  bool includes(std::size_t frame) const { return first <= frame && frame <= last; }
};

struct SceneObject {
  std::string name;
  std::vector<OrientedBox> parts;  ///< in the object's frame
  std::vector<Stand> stands;       ///< in the order of their frames, none overlapping another; in other frames the object is not there

  /// Null if the object is not there in this frame.
  const Stand* stand_at(std::size_t frame) const {
    for (const Stand& stand : stands)
      if (stand.includes(frame)) return &stand;
    return nullptr;
  }

  /// The parts in the world frame.
  std::vector<OrientedBox> placed(const Stand& stand) const {
    std::vector<OrientedBox> boxes;
    for (const OrientedBox& part : parts) boxes.push_back({stand.T_world_object * part.T_frame_box, part.half_size});
    return boxes;
  }
};

}  // namespace frontier_surfels::scoring
