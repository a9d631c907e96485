/// A made-up map of surfels that changes, for the tests of clusters.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "frontier_surfels/planner/clusters.hpp"

namespace frontier_surfels {

constexpr float kSpacing = 0.02F;  // [m] between surfels, which are of voxels of this size

struct AllFree : Space {
  bool is_free(const Eigen::Vector3f&) const override { return true; }
  float clearance(const Eigen::Vector3f&, float most) const override { return most; }
  bool sees(const Eigen::Vector3f&, const Eigen::Vector3f&) const override { return true; }
};

inline Surfel frontier(std::uint32_t id, const Eigen::Vector3f& position) {
  Surfel surfel;
  surfel.id = id;
  surfel.position = position;
  surfel.normal = {0, -1, 0};
  surfel.radius = static_cast<float>(kNewRadius) * kSpacing;
  return surfel;
}

/// Gives changes as a mapper does, and reuses ids.
class World {
 public:
  void add(const std::vector<Eigen::Vector3f>& points, Label label = Label::kFrontier) {
    for (const Eigen::Vector3f& point : points) {
      std::uint32_t id = next_;
      if (free_.empty()) {
        ++next_;
      } else {
        id = free_.back();
        free_.pop_back();
      }
      Surfel surfel = frontier(id, point);
      surfel.label = label;
      surfels_[id] = surfel;
      changes_.updated.push_back(surfel);
    }
  }

  void remove_if(const std::function<bool(const Surfel&)>& is_gone) {
    for (auto at = surfels_.begin(); at != surfels_.end();) {
      if (!is_gone(at->second)) {
        ++at;
        continue;
      }
      changes_.removed.push_back(at->first);
      freed_.push_back(at->first);
      at = surfels_.erase(at);
    }
  }

  /// Changes since the last call.
  Changes take() {
    auto& updated = changes_.updated;  // without those that came and went
    updated.erase(std::remove_if(updated.begin(), updated.end(), [this](const Surfel& s) { return surfels_.count(s.id) == 0; }),
                  updated.end());
    changes_.since = sequence_;
    changes_.sequence = ++sequence_;
    free_.insert(free_.end(), freed_.begin(), freed_.end());
    freed_.clear();
    Changes changes;
    std::swap(changes, changes_);
    return changes;
  }

  /// The whole map; the next changes begin here.
  Changes whole() {
    take();
    Changes changes;
    changes.sequence = sequence_;
    changes.updated = surfels();
    return changes;
  }

  std::vector<Surfel> surfels() const {
    std::vector<Surfel> all;
    for (const auto& [id, surfel] : surfels_) all.push_back(surfel);
    return all;
  }
  std::size_t size() const { return surfels_.size(); }

 private:
  std::map<std::uint32_t, Surfel> surfels_;
  std::vector<std::uint32_t> free_, freed_;  ///< ids of surfels that are gone; the latter since the last changes were taken
  std::uint32_t next_ = 0;
  std::uint64_t sequence_ = 0;
  Changes changes_;
};

/// All that clusters are, to the last bit.
inline std::string text(const std::vector<Cluster>& clusters) {
  std::string all;
  const auto add = [&all](float value) {
    char digits[40];
    std::snprintf(digits, sizeof digits, "%a ", static_cast<double>(value));
    all += digits;
  };
  const auto add_vector = [&add](const Eigen::Vector3f& v) {
    for (int axis = 0; axis < 3; ++axis) add(v[axis]);
  };
  for (const Cluster& cluster : clusters) {
    all += "\n" + std::to_string(cluster.id) + " " + std::to_string(cluster.surfels) + (cluster.touches_occupied ? " touches " : " ");
    add(cluster.area);
    for (const Eigen::Vector3f& v :
         {cluster.centroid, cluster.normal, Eigen::Vector3f(cluster.box.min()), Eigen::Vector3f(cluster.box.max())})
      add_vector(v);
    for (const ClusterPoint& point : cluster.points) {
      add_vector(point.position);
      add_vector(point.normal);
    }
    for (const ClusterViewpoint& view : cluster.viewpoints) {
      for (int column = 0; column < 4; ++column) add_vector(view.T_world_camera.matrix().col(column).head<3>());
      add(view.value);
      add(view.clearance);
    }
  }
  return all;
}

}  // namespace frontier_surfels
