/// The grid of states as an octree of OctoMap, for planners that read nothing else.
#pragma once

#include <octomap/octomap.h>

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "frontier_surfels/planner/state_grid.hpp"

namespace frontier_surfels {

/// Free and occupied cells become leaves with the sensor model's lowest and highest probability; unknown cells are not in the tree.
class OctomapBridge {
 public:
  explicit OctomapBridge(double resolution);

  /// Takes blocks over; since = 0: they are the whole grid.
  void apply(const StateChanges& changes);

  std::uint64_t sequence() const { return sequence_; }  ///< of what was applied last
  bool empty() const { return tree_->getRoot() == nullptr; }

  /// Like OcTree::writeBinary(). Equal neighbours are one leaf.
  void write(std::ostream& stream);

  /// The content of an octomap_msgs/Octomap message that is not binary: the tree with its probabilities, without a header. Not to be called
  /// for an empty tree: OctoMap 1.9 reads anything from a message without content.
  std::string full_data();

  /// Writes a .bt file: first to a temporary file, which is then renamed. @throws FileError
  void save(const std::string& path);

 private:
  void set_block(const StateBlock& block);
  void remove(const octomap::OcTreeKey& key);
  bool remove_below(octomap::OcTreeNode* node, unsigned depth, const octomap::OcTreeKey& key);

  std::unique_ptr<octomap::OcTree> tree_;
  std::map<std::array<std::int32_t, 3>, StateBlock> blocks_;  ///< as they are in the tree
  std::uint64_t sequence_ = 0;
};

}  // namespace frontier_surfels
