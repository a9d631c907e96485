/// The part of the map that is far from the camera, on disk: memory stays bounded, and the map outlives the process.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <exception>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "frame/recent_views.hpp"
#include "frontier_surfels/config.hpp"
#include "map/seen_points.hpp"
#include "map/surfel_map.hpp"
#include "storage/map_folder.hpp"
#include "storage/stored_block.hpp"

namespace frontier_surfels {

/// Blocks come and go whole, once the camera has moved by half a block. All that has changed since the last time is written in one
/// transaction, surfels together with what has been seen and with the kept views, every so many frames, and before a block of it leaves
/// memory: the folder always holds the map as it was after some frame.
///
/// Views are kept longer than the blocks that they have seen. When such a view is forgotten, memory gets seen points of blocks that are on
/// disk: they are added to those on disk by the next save, or when the block comes back.
class MapArchive {
 public:
  /// @param complete  ends what the last frame has left to do; called before anything is written. It returns the blocks that it has changed
  /// @throws FileError  config.map_folder cannot be used
  MapArchive(const Config& config, SurfelMap& map, SeenPoints& seen, const RecentViews& views,
             std::function<std::vector<BlockKey>()> complete);
  ~MapArchive();  ///< as flush(), but nobody is told if it fails

  /// Are there blocks of an earlier map?
  bool empty() const { return folder_.size() == 0; }

  /// Brings blocks near the camera into memory, and takes far ones out. @param reach  distance along an axis within which the frame needs
  /// them [m], be it more than config.eviction_radius. @param frame  number that they get. @return whether it did
  /// @throws FileError  a block could not be read, or the last save failed; the map is as it was, but for whole blocks that have come or
  /// gone. What cannot be written stays in memory.
  bool follow(const Eigen::Vector3d& camera, double reach, std::uint32_t frame);

  /// Notes blocks that have lost surfels, which no page that is left may tell, or in which more has been seen.
  void note_changed(const std::vector<BlockKey>& blocks) { noted_.insert(blocks.begin(), blocks.end()); }

  /// Forgets the seen points in a box of the world [m], in memory and, with the next save, on disk. Kept views still know what they have
  /// seen there. @throws cl::Error, FileError  only a part is forgotten, in memory: call it again
  void forget(const Eigen::AlignedBox3d& box);

  /// Writes what has changed since the last time, if it is time to. A fault waits for the next frame's follow().
  void save_some(std::uint32_t frame);

  /// The kept views of an earlier map, oldest first. Those that cannot be read are left out. @param warnings  gets a sentence about these
  std::vector<SavedView> stored_views(std::vector<std::string>* warnings) const;

  /// From now on, the kept views take the place of those of the earlier map.
  void store_views() { stores_views_ = true; }

  /// Adds what is on disk only. @throws FileError
  void add_stored(SavedMap& map) const;

  /// Writes all that has changed, and waits for it. @param frame  the last one in the map
  /// @throws FileError  it could not be written; it stays in memory
  void flush(std::uint32_t frame);

  /// Why the last save could not be written; empty if all is well. From any thread.
  std::string fault() const { return folder_.fault(); }

  /// Number of surfels on disk only, which costs nothing.
  std::size_t stored_size() const { return stored_surfels_; }

  /// Forgets everything on disk.
  void clear();

 private:
  using Blocks = std::vector<BlockKey>;
  void choose_lattice();
  bool is_stored(const BlockKey& block) const;
  void note_stored(const BlockKey& block);
  void forget_stored(const BlockKey& block);
  Blocks stored_near(const Eigen::Vector3d& camera, double radius) const;
  bool fetch(const Eigen::Vector3d& camera, double radius, std::uint32_t frame);
  bool evict(const Eigen::Vector3d& camera, double radius, std::uint32_t frame);
  Blocks unsaved() const;
  Blocks in_memory() const;
  std::vector<StoredBlock> read(const Blocks& blocks) const;
  std::vector<std::uint8_t> united(const std::vector<std::uint8_t>& seen_a, const std::vector<std::uint8_t>& seen_b) const;
  void add_views(std::vector<StoredBlock>& stored) const;
  StoredParts stored_parts(const BlockKey& block) const;
  void write(const Blocks& blocks);
  bool save(const Blocks& blocks, std::uint32_t mapped, std::uint32_t frame);

  SurfelMap& map_;
  SeenPoints& seen_;
  const RecentViews& views_;
  const std::function<Blocks()> complete_;
  bool stores_views_ = false;  ///< else those in the folder stay there
  const double radius_;        ///< [m]
  const std::string path_;     ///< of folder_
  MapFolder folder_;
  std::unordered_map<BlockKey, Blocks> stored_;  ///< on disk only, by region: cubes of kRegion blocks
  std::size_t stored_surfels_ = 0;               ///< in these blocks
  std::optional<Eigen::Vector3d> followed_;      ///< where the camera was when blocks last came and went
  double followed_radius_ = 0;                   ///< and how far around it they are in memory [m]
  std::set<std::uint64_t> saved_views_;          ///< numbers of the views on disk
  std::set<std::uint64_t> old_views_;            ///< of those on disk that an earlier process has kept
  std::vector<Eigen::AlignedBox3d> forgotten_;   ///< boxes whose points are still on disk [m]
  std::set<BlockKey> noted_;                     ///< since the last save
  std::exception_ptr fault_;                     ///< of a save that failed
  std::uint32_t saved_ = 0;                      ///< frame of the last save
  std::uint32_t next_try_ = 0;                   ///< frame that may save again
};

}  // namespace frontier_surfels
