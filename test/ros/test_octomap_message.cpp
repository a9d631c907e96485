/// ~octomap_full, read by OctoMap itself: whoever listens has the states of the grid, cell by cell.
#include <gtest/gtest.h>
#include <ros/callback_queue.h>

#include <memory>
#include <optional>
#include <random>
#include <sstream>

#include "ros/master_input.hpp"
#include "ros/output/planner_publisher.hpp"

#ifdef FRONTIER_SURFELS_OCTOMAP_MSGS
#include <octomap_msgs/Octomap.h>
#endif

namespace frontier_surfels {
namespace {

#ifndef FRONTIER_SURFELS_OCTOMAP_MSGS

TEST(OctomapMessage, IsReadByOctomap) { GTEST_SKIP() << "~octomap_full is not built, because octomap_msgs was not found"; }

#else

constexpr double kResolution = 0.05;
constexpr int kEdge = StateBlock::kEdge;

/// Blocks on both sides of the origin; a third of them in one state, so that the tree has large leaves.
std::vector<StateBlock> random_blocks(std::mt19937& random, int count) {
  std::vector<StateBlock> blocks;
  std::uniform_int_distribution<int> where(-3, 2), state(0, 2), uniform(0, 2), byte(0, 255);
  std::map<std::array<std::int32_t, 3>, bool> taken;
  while (static_cast<int>(blocks.size()) < count) {
    StateBlock block = {{where(random), where(random), where(random)}, {static_cast<std::uint8_t>(state(random))}};
    if (std::exchange(taken[block.block], true)) continue;
    if (uniform(random) != 0) {
      block.cells.resize(StateBlock::kBytes);
      for (std::size_t n = 0; n < StateBlock::kBytes / 2; ++n) {
        const int free = byte(random);
        block.cells[n] = static_cast<std::uint8_t>(free);
        block.cells[StateBlock::kBytes / 2 + n] = static_cast<std::uint8_t>(byte(random) & ~free);
      }
    }
    blocks.push_back(std::move(block));
  }
  return blocks;
}

std::unique_ptr<octomap::OcTree> read_tree(const octomap_msgs::Octomap& message) {
  std::unique_ptr<octomap::AbstractOcTree> made(octomap::AbstractOcTree::createTree(message.id, message.resolution));
  std::unique_ptr<octomap::OcTree> tree(dynamic_cast<octomap::OcTree*>(made.get()));
  if (!tree) return nullptr;
  made.release();
  std::istringstream stream(std::string(message.data.begin(), message.data.end()));
  tree->readData(stream);
  return tree;
}

/// Cells of the tree that have another state than those of the grid.
int wrong_cells(const octomap::OcTree& tree, const StateGrid& grid) {
  int wrong = 0;
  for (int k = -4 * kEdge; k < 4 * kEdge; ++k)
    for (int j = -4 * kEdge; j < 4 * kEdge; ++j)
      for (int i = -4 * kEdge; i < 4 * kEdge; ++i) {
        const Eigen::Vector3d centre = kResolution * (Eigen::Vector3d(i, j, k).array() + 0.5);
        const octomap::OcTreeNode* node = tree.search(centre.x(), centre.y(), centre.z());
        const SpaceState state = !node ? SpaceState::kUnknown : tree.isNodeOccupied(node) ? SpaceState::kOccupied : SpaceState::kFree;
        wrong += state != grid.state(centre.cast<float>());
      }
  return wrong;
}

class OctomapMessage : public testing::Test {
 protected:
  static NodeConfig config() {
    NodeConfig config;
    config.planner_resolution = kResolution;
    config.planner_period = 0.01;
    config.world_frame = "map";
    return config;
  }

  OctomapMessage() { nh_.setCallbackQueue(&queue_); }

  void listen() {
    got_.reset();
    subscriber_ = nh_.subscribe<octomap_msgs::Octomap>("octomap_full", 10, [this](const octomap_msgs::OctomapConstPtr& m) { got_ = *m; });
  }

  /// As the mapping thread does, except that it pushes whether somebody listens or not.
  void push(std::vector<StateBlock> blocks, bool whole = false) {
    const StateChanges changes = {grid_.sequence() + 1, whole ? 0 : grid_.sequence(), kResolution, std::move(blocks)};
    ASSERT_TRUE(grid_.apply(changes));
    publisher_.push(changes, std::nullopt, ros::Time(static_cast<double>(changes.sequence)));
  }

  /// Changes that leave nothing known.
  std::vector<StateBlock> all_unknown() const {
    std::vector<StateBlock> blocks = grid_.whole().blocks;
    for (StateBlock& block : blocks) block.cells = {static_cast<std::uint8_t>(SpaceState::kUnknown)};
    return blocks;
  }

  /// Waits for the message of the grid as it is now.
  void check_tree() {
    const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(30);
    while (!(got_ && got_->header.stamp.sec == grid_.sequence())) {
      ASSERT_LT(ros::WallTime::now(), deadline) << "no octree of map " << grid_.sequence();
      queue_.callAvailable(ros::WallDuration(0.02));
    }
    EXPECT_EQ(got_->header.frame_id, "map");
    EXPECT_FALSE(got_->binary);
    EXPECT_EQ(got_->resolution, kResolution);
    const std::unique_ptr<octomap::OcTree> tree = read_tree(*got_);
    ASSERT_TRUE(tree) << "a tree of class " << got_->id;
    EXPECT_EQ(wrong_cells(*tree, grid_), 0);
  }

  ros::CallbackQueue queue_;
  ros::NodeHandle nh_{"~"};
  ros::Subscriber subscriber_;
  std::optional<octomap_msgs::Octomap> got_;
  StateGrid grid_{kResolution};
  PlannerPublisher publisher_{nh_, config(), [] {}};
};

TEST_F(OctomapMessage, FollowsTheGrid) {
  std::mt19937 random(1);
  listen();
  push(random_blocks(random, 60), true);
  check_tree();
  for (int change = 0; change < 10; ++change) {
    push(random_blocks(random, 10));
    check_tree();
  }
  push({}, true);  // a reset: there is no tree to be told of
  push(random_blocks(random, 20));
  check_tree();
  push(all_unknown());  // neither is here
  push(random_blocks(random, 20));
  check_tree();
}

TEST_F(OctomapMessage, IsWholeForWhoeverComesLate) {
  std::mt19937 random(2);
  push(random_blocks(random, 60), true);
  push(random_blocks(random, 10));
  listen();
  check_tree();
  subscriber_.shutdown();
  push(random_blocks(random, 10));  // heard by nobody
  push(random_blocks(random, 10));
  listen();
  check_tree();
}

TEST_F(OctomapMessage, LeavesOutWhatIsBeyondAnOctree) {
  listen();
  push({{{0, 0, 0}, {1}}, {{2048, 0, 0}, {1}}, {{0, -2049, 0}, {2}}}, true);
  check_tree();
}

#endif

}  // namespace
}  // namespace frontier_surfels

int main(int argc, char** argv) { return frontier_surfels::run_tests_with_master(argc, argv, "test_octomap_message"); }
