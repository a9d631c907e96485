#include <algorithm>
#include <cmath>
#include <utility>

#include "config/checked.hpp"
#include "config/config_text.hpp"
#include "frontier_surfels/planner/clusters.hpp"
#include "planner/cluster_lattice.hpp"
#include "planner/cluster_partition.hpp"
#include "planner/cluster_summary.hpp"
#include "planner/cluster_viewpoints.hpp"

namespace frontier_surfels {
namespace {

constexpr double kAnew = 0.1;  // share of its area by which a cluster must differ for new viewpoints

}  // namespace

std::vector<std::string> ClusterConfig::problems() const {
  std::vector<std::string> faults;
  const auto check = [&](const char* name, double value, double lowest, double highest, const char* unit) {
    if (value >= lowest && value <= highest) return;  // false for NaN
    faults.push_back(std::string(name) + " is " + to_text(value) + " " + unit + ": it must be from " + to_text(lowest) + " to " +
                     to_text(highest) + " " + unit + ".");
  };
  check("cell", cell, 0.01, 1, "m");
  check("min_area", min_area, 0, 1000, "m2");
  check("max_extent", max_extent, 2 * (cell >= 0.01 && cell <= 1 ? cell : 0.01), 1000, "m");
  check("view_distance", view_distance, 0.1, 100, "m");
  check("clearance", clearance, 0, 10, "m");
  return faults;
}

struct FrontierClusters::Impl {
  explicit Impl(const ClusterConfig& c)
      : config(c),
        lattice(c.cell),
        // A little more than 20 cells of 5 cm must be 20 cells.
        partition(static_cast<int>(std::floor(c.max_extent / c.cell + 1e-6)), std::llround(c.min_area / kAreaUnit)) {}

  /// A cluster as it was told, and as it was when its viewpoints were sought.
  struct Told {
    Cluster now;
    float area_then = 0;
    Eigen::Vector3f centroid_then = Eigen::Vector3f::Zero();
  };

  bool differs_much(const Told& told) const {
    return std::abs(told.now.area - told.area_then) > kAnew * told.area_then ||
           (told.now.centroid - told.centroid_then).norm() > static_cast<float>(config.cell);
  }
  bool look(Told& told, const Space& space) const;

  ClusterConfig config;
  ClusterLattice lattice;
  ClusterPartition partition;
  std::map<std::uint32_t, Told> told;
  std::uint64_t sequence = 0;
  std::size_t visited = 0;
};

/// Sees to it that viewpoints are right. Something may have come into their view although the cluster is as it was. @return whether they
/// are others than before
bool FrontierClusters::Impl::look(Told& told, const Space& space) const {
  const std::vector<ClusterViewpoint> before = told.now.viewpoints;
  told.now.viewpoints = still_clear(told.now, config, space);
  told.now.viewpoints = valued(told.now, config, space);
  // A cluster that had none may have got room for one.
  if (told.now.viewpoints.empty() || differs_much(told)) {
    told.now.viewpoints = find_viewpoints(told.now, config, space);
    told.area_then = told.now.area;
    told.centroid_then = told.now.centroid;
  }
  const auto alike = [](const ClusterViewpoint& a, const ClusterViewpoint& b) {
    return a.value == b.value && a.clearance == b.clearance && a.T_world_camera.matrix() == b.T_world_camera.matrix();
  };
  return !std::equal(before.begin(), before.end(), told.now.viewpoints.begin(), told.now.viewpoints.end(), alike);
}

FrontierClusters::FrontierClusters(const ClusterConfig& config) {
  refuse(config.problems());
  impl_ = std::make_unique<Impl>(config);
}
FrontierClusters::~FrontierClusters() = default;
FrontierClusters::FrontierClusters(FrontierClusters&&) noexcept = default;
FrontierClusters& FrontierClusters::operator=(FrontierClusters&&) noexcept = default;

void FrontierClusters::apply(const Changes& changes) {
  if (changes.since > impl_->sequence)
    throw Error("The changes begin with map " + std::to_string(changes.since) + ", but the clusters are those of map " +
                std::to_string(impl_->sequence) + ": ask for all changes since then.");
  if (changes.since > 0 && changes.sequence <= impl_->sequence) return;  // old: what they say may no longer hold
  impl_->lattice.apply(changes);
  if (changes.since == 0) impl_->partition.clear();
  impl_->sequence = changes.sequence;
}

ClusterChanges FrontierClusters::update(const Space& space) {
  Impl& self = *impl_;
  ClusterChanges result;
  result.sequence = self.sequence;

  const ClusterPartition::Cells cells = self.lattice.take_changed();
  const std::set<std::uint32_t> changed = self.partition.update(cells);
  self.lattice.forget_empty(cells);
  self.visited = self.partition.visited();

  const auto& groups = self.partition.groups();
  const std::int64_t min_area = std::llround(self.config.min_area / kAreaUnit);
  const auto reported = [&](std::uint32_t id) { return groups.count(id) > 0 && groups.at(id).area >= min_area; };
  for (auto at = self.told.begin(); at != self.told.end();) {
    if (reported(at->first)) {
      ++at;
    } else {
      result.removed.push_back(at->first);
      at = self.told.erase(at);
    }
  }
  for (const std::uint32_t id : changed) {
    if (!reported(id)) continue;
    Cluster& now = self.told[id].now;
    std::vector<ClusterViewpoint> viewpoints = std::move(now.viewpoints);
    self.visited += groups.at(id).cells.size();
    now = summary(id, groups.at(id), self.lattice);
    now.viewpoints = std::move(viewpoints);
  }
  for (auto& [id, told] : self.told) {
    const bool looks_different = self.look(told, space);
    if (looks_different || changed.count(id) > 0) result.updated.push_back(told.now);
  }
  return result;
}

std::vector<Cluster> FrontierClusters::clusters() const {
  std::vector<Cluster> all;
  for (const auto& [id, told] : impl_->told) all.push_back(told.now);
  return all;
}

std::uint64_t FrontierClusters::sequence() const { return impl_->sequence; }
std::size_t FrontierClusters::visited_cells() const { return impl_->visited; }
const ClusterConfig& FrontierClusters::config() const { return impl_->config; }

}  // namespace frontier_surfels
