/// Clusters of frontier surfels, for planners: where the known world can be extended, and from where to look there.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Config of FrontierClusters.
struct ClusterConfig {
  double cell = 0.05;          ///< [m] edge of the cells that surfels are gathered in; touching cells are connected. 0.01 to 1
  double min_area = 0.05;      ///< [m2] smaller clusters join a neighbour, or are not reported. 0 to 1000
  double max_extent = 1.0;     ///< [m] longest edge of a cluster's box. Two cells to 1000
  double view_distance = 1.2;  ///< [m] from a viewpoint to the cluster's centroid; 0.75 and 1.4 times this are tried as well. 0.1 to 100
  double clearance = 0.3;      ///< [m] from a viewpoint to the next point that is not known to be free. 0 to 10

  /// Everything that is wrong with the values, in sentences. Empty: the configuration can be used.
  std::vector<std::string> problems() const;
};

/// A pose from which a camera sees much of a cluster.
struct ClusterViewpoint {
  /// Optical frame: z forward, x right, y down. It looks at the cluster's centroid, without roll; the world's z is up.
  Eigen::Isometry3f T_world_camera = Eigen::Isometry3f::Identity();
  float value = 0;      ///< [m2] of the cluster, seen from there by a camera of 58 x 45 degrees
  float clearance = 0;  ///< [m] of free space around it, counted up to twice ClusterConfig::clearance
};

struct ClusterPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< world frame [m]
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();   ///< unit, points INTO known space, world frame
};

/// Connected frontier surfels.
struct Cluster {
  std::uint32_t id = 0;                                ///< from 1; stays while the cluster lives on, and is never given again
  Eigen::Vector3f centroid = Eigen::Vector3f::Zero();  ///< world frame [m]
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();   ///< mean of the normals, unit, points INTO known space, world frame
  float area = 0;                                      ///< [m2]
  Eigen::AlignedBox3f box;                             ///< of its cells, so that all centres are within; world frame [m]
  std::size_t surfels = 0;
  std::vector<ClusterPoint> points;          ///< spread over the cluster, at most 64; each stands for the same share of the area
  bool touches_occupied = false;             ///< an occupied surfel lies in or next to one of its cells
  std::vector<ClusterViewpoint> viewpoints;  ///< at most 3, 0.3 m apart or more, those that see most first
};

/// First remove, then update.
struct ClusterChanges {
  std::uint64_t sequence = 0;          ///< number of the map whose clusters these are
  std::vector<Cluster> updated;        ///< new or changed clusters, by id
  std::vector<std::uint32_t> removed;  ///< ids of clusters that are gone or below ClusterConfig::min_area, ascending
};

/// What is known of the space that viewpoints are sought in.
class Space {
 public:
  virtual ~Space() = default;
  virtual bool is_free(const Eigen::Vector3f& p_world) const = 0;
  /// Distance [m] from a point to the next one that is not free, or `most` [m] where that is further.
  virtual float clearance(const Eigen::Vector3f& p_world, float most) const = 0;
  /// Is there nothing but free space on the way?
  virtual bool sees(const Eigen::Vector3f& from_world, const Eigen::Vector3f& to_world) const = 0;
};

/// Follows a map by its changes, with work only where the map has changed. Needs no Mapper, and may run on another thread than it.
class FrontierClusters {
 public:
  /// @throws Error  the configuration has problems; the message lists all of them
  explicit FrontierClusters(const ClusterConfig& config = {});
  ~FrontierClusters();
  FrontierClusters(FrontierClusters&&) noexcept;
  FrontierClusters& operator=(FrontierClusters&&) noexcept;

  /// Takes in changes of the map, as from Mapper::changes(sequence()). Those of a whole map end all clusters: it gets new ones. Changes
  /// that lead to no later map than the one that is known are ignored.
  /// @throws Error  a surfel is not finite or too far away, or changes are missing between the last ones and these; nothing has changed
  void apply(const Changes& changes);

  /// Brings the clusters up to date with all changes that were applied, and with the space that their viewpoints stand in.
  ClusterChanges update(const Space& space);

  /// All clusters of at least min_area, by id, as of the last update.
  std::vector<Cluster> clusters() const;

  std::uint64_t sequence() const;     ///< of the last changes that were applied; 0: none
  std::size_t visited_cells() const;  ///< looked at by the last update, a measure of its work: 0 where nothing had changed
  const ClusterConfig& config() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace frontier_surfels
