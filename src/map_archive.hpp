/// The part of the map that is far from the camera, on disk: memory stays bounded, and the map outlives the process.
#pragma once

#include <Eigen/Geometry>
#include <exception>
#include <optional>
#include <unordered_map>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "map_folder.hpp"
#include "surfel_map.hpp"

namespace frontier_surfels {

/// Blocks come and go whole, once the camera has moved by half a block. What is in memory is written, too, every so many frames.
class MapArchive {
 public:
  /// @throws FileError  config.map_folder cannot be used
  MapArchive(const Config& config, SurfelMap& map);
  ~MapArchive();  ///< writes what is in memory

  /// Are there blocks of an earlier map?
  bool empty() const { return folder_.size() == 0; }

  /// Brings blocks near the camera into memory, and takes far ones out. @param frame  number that they get. @return whether it did
  /// @throws FileError  a block could not be read or written; the map is as it was, but for whole blocks
  bool follow(const Eigen::Vector3d& camera, std::uint32_t frame);

  /// Writes the blocks that have changed since the last time, if it is time to. A fault waits for the next frame's follow().
  /// @param emptied  blocks that this frame has left without surfels
  void save_some(const std::vector<BlockKey>& emptied, std::uint32_t frame);

  /// The surfels on disk only.
  std::vector<Surfel> stored() const;

  /// Forgets everything on disk.
  void clear();

 private:
  using Blocks = std::vector<BlockKey>;
  void note_stored(const BlockKey& block);
  Blocks stored_near(const Eigen::Vector3d& camera) const;
  bool fetch(const Eigen::Vector3d& camera, std::uint32_t frame);
  bool evict(const Eigen::Vector3d& camera, std::uint32_t frame);
  void save(std::uint32_t frame);
  void write(const Blocks& blocks);

  SurfelMap& map_;
  const double radius_;  ///< [m]
  MapFolder folder_;
  std::unordered_map<BlockKey, Blocks> stored_;  ///< on disk only, by region: cubes of kRegion blocks
  std::optional<Eigen::Vector3d> followed_;      ///< where the camera was when blocks last came and went
  Blocks emptied_;                               ///< since the last save
  std::exception_ptr fault_;                     ///< of a save that failed
  std::uint32_t saved_ = 0;                      ///< frame of the last save
};

}  // namespace frontier_surfels
