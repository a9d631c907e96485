#include "ros/output/octomap_bridge.hpp"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {
namespace {

constexpr int kMiddle = 1 << 15;  // an octree's key of the cell that begins at 0
constexpr int kBlock = StateBlock::kEdge;

/// The octree has 2^16 cells along each axis; cells beyond them are left out.
bool fits(const std::array<std::int32_t, 3>& block) {
  for (const std::int32_t b : block)
    if (b < -kMiddle / kBlock || b >= kMiddle / kBlock) return false;
  return true;
}

}  // namespace

OctomapBridge::OctomapBridge(double resolution) : tree_(std::make_unique<octomap::OcTree>(resolution)) {}

void OctomapBridge::apply(const StateChanges& changes) {
  if (changes.since == 0) {
    tree_->clear();
    blocks_.clear();
  }
  for (const StateBlock& block : changes.blocks)
    if (fits(block.block)) set_block(block);
  tree_->updateInnerOccupancy();
  sequence_ = changes.sequence;
}

/// Changes only the cells whose state is another one: the neighbours of a change are mostly the same.
void OctomapBridge::set_block(const StateBlock& block) {
  const float free = tree_->getClampingThresMinLog(), occupied = tree_->getClampingThresMaxLog();
  StateBlock& old =
      blocks_.try_emplace(block.block, StateBlock{block.block, {static_cast<std::uint8_t>(SpaceState::kUnknown)}}).first->second;
  for (int k = 0, n = 0; k < kBlock; ++k)
    for (int j = 0; j < kBlock; ++j)
      for (int i = 0; i < kBlock; ++i, ++n) {
        const SpaceState state = block.state(n);
        if (state == old.state(n)) continue;
        const octomap::OcTreeKey key(static_cast<octomap::key_type>(block.block[0] * kBlock + i + kMiddle),
                                     static_cast<octomap::key_type>(block.block[1] * kBlock + j + kMiddle),
                                     static_cast<octomap::key_type>(block.block[2] * kBlock + k + kMiddle));
        if (state == SpaceState::kUnknown)
          remove(key);
        else
          tree_->setNodeValue(key, state == SpaceState::kFree ? free : occupied, true);
      }
  old.cells = block.cells;
}

/// OcTree::deleteNode() ends the process where a node loses its last child, or leaks memory, as OctoMap was compiled (1.9).
void OctomapBridge::remove(const octomap::OcTreeKey& key) {
  if (!empty() && remove_below(tree_->getRoot(), 0, key)) tree_->clear();
}

/// @return whether nothing is left below the node, which then has to go as well
bool OctomapBridge::remove_below(octomap::OcTreeNode* node, unsigned depth, const octomap::OcTreeKey& key) {
  const unsigned child = octomap::computeChildIdx(key, static_cast<int>(tree_->getTreeDepth() - 1 - depth));
  if (!tree_->nodeHasChildren(node)) tree_->expandNode(node);  // a leaf that stands for several cells
  if (!tree_->nodeChildExists(node, child)) return false;
  if (depth + 1 < tree_->getTreeDepth() && !remove_below(tree_->getNodeChild(node, child), depth + 1, key)) return false;
  tree_->deleteNodeChild(node, child);
  if (tree_->nodeHasChildren(node)) return false;
  tree_->expandNode(node);  // the only way to the node's list of children is with children
  tree_->pruneNode(node);
  return true;
}

void OctomapBridge::write(std::ostream& stream) {
  tree_->prune();
  tree_->writeBinaryConst(stream);
}

std::string OctomapBridge::full_data() {
  tree_->prune();
  std::ostringstream stream;
  tree_->writeData(stream);
  return stream.str();
}

void OctomapBridge::save(const std::string& path) {
  const std::string temporary = path + ".tmp";
  std::ofstream file(temporary, std::ios::binary);
  if (file) write(file);
  file.close();
  std::error_code fault;
  if (file) std::filesystem::rename(temporary, path, fault);
  if (file && !fault) return;
  const std::string reason = fault ? fault.message() : "is the folder there and writable, and is there room on the disk?";
  std::filesystem::remove(temporary, fault);
  throw FileError("The octree could not be written to " + path + ": " + reason);
}

}  // namespace frontier_surfels
