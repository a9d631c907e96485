/// The part of the map that is far from the camera, on disk: memory stays bounded, and the map outlives the process.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <exception>
#include <optional>
#include <set>
#include <unordered_map>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "map/surfel_map.hpp"
#include "storage/map_folder.hpp"

namespace frontier_surfels {

/// Blocks come and go whole, once the camera has moved by half a block. All that has changed since the last time is written in one
/// transaction every so many frames, and before a block of it leaves memory: the folder always holds the map as it was after some frame.
class MapArchive {
 public:
  /// @throws FileError  config.map_folder cannot be used
  MapArchive(const Config& config, SurfelMap& map);
  ~MapArchive();  ///< as flush(), but nobody is told if it fails

  /// Are there blocks of an earlier map?
  bool empty() const { return folder_.size() == 0; }

  /// Brings blocks near the camera into memory, and takes far ones out. @param reach  distance along an axis within which the frame needs
  /// them [m], be it more than config.eviction_radius. @param frame  number that they get. @return whether it did
  /// @throws FileError  a block could not be read, or the last save failed; the map is as it was, but for whole blocks that have come or
  /// gone. What cannot be written stays in memory.
  bool follow(const Eigen::Vector3d& camera, double reach, std::uint32_t frame);

  /// Notes blocks that have lost surfels, which no page that is left may tell.
  void note_shrunk(const std::vector<BlockKey>& blocks) { shrunk_.insert(blocks.begin(), blocks.end()); }

  /// Writes the blocks that have changed since the last time, if it is time to. A fault waits for the next frame's follow().
  void save_some(std::uint32_t frame);

  /// Writes all that has changed, and waits for it. @param frame  the last one in the map
  /// @throws FileError  it could not be written; it stays in memory
  void flush(std::uint32_t frame);

  /// Why the last save could not be written; empty if all is well. From any thread.
  std::string fault() const { return folder_.fault(); }

  /// The surfels on disk only. @throws FileError
  std::vector<Surfel> stored() const;

  /// Number of surfels on disk only, which costs nothing.
  std::size_t stored_size() const;

  /// Forgets everything on disk.
  void clear();

 private:
  using Blocks = std::vector<BlockKey>;
  void note_stored(const BlockKey& block);
  Blocks stored_near(const Eigen::Vector3d& camera, double radius) const;
  bool fetch(const Eigen::Vector3d& camera, double radius, std::uint32_t frame);
  bool evict(const Eigen::Vector3d& camera, double radius, std::uint32_t frame);
  Blocks unsaved() const;
  bool save(const Blocks& blocks, std::uint32_t mapped, std::uint32_t frame);

  SurfelMap& map_;
  const double radius_;  ///< [m]
  MapFolder folder_;
  std::unordered_map<BlockKey, Blocks> stored_;  ///< on disk only, by region: cubes of kRegion blocks
  std::size_t stored_bytes_ = 0;                 ///< of these blocks
  std::optional<Eigen::Vector3d> followed_;      ///< where the camera was when blocks last came and went
  double followed_radius_ = 0;                   ///< and how far around it they are in memory [m]
  std::set<BlockKey> shrunk_;                    ///< since the last save
  std::exception_ptr fault_;                     ///< of a save that failed
  std::uint32_t saved_ = 0;                      ///< frame of the last save
  std::uint32_t next_try_ = 0;                   ///< frame that may save again
};

}  // namespace frontier_surfels
