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
  if (changes.since == 0) tree_->clear();
  for (const StateBlock& block : changes.blocks)
    if (fits(block.block)) set_block(block);
  tree_->updateInnerOccupancy();
  sequence_ = changes.sequence;
}

void OctomapBridge::set_block(const StateBlock& block) {
  const float free = tree_->getClampingThresMinLog(), occupied = tree_->getClampingThresMaxLog();
  for (int k = 0, n = 0; k < kBlock; ++k)
    for (int j = 0; j < kBlock; ++j)
      for (int i = 0; i < kBlock; ++i, ++n) {
        const octomap::OcTreeKey key(static_cast<octomap::key_type>(block.block[0] * kBlock + i + kMiddle),
                                     static_cast<octomap::key_type>(block.block[1] * kBlock + j + kMiddle),
                                     static_cast<octomap::key_type>(block.block[2] * kBlock + k + kMiddle));
        switch (block.state(n)) {
          case SpaceState::kUnknown:
            tree_->deleteNode(key);
            break;
          case SpaceState::kFree:
            tree_->setNodeValue(key, free, true);
            break;
          case SpaceState::kOccupied:
            tree_->setNodeValue(key, occupied, true);
            break;
        }
      }
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
