/// The map as markers for rviz: oriented squares of the surfels' radius, a marker a block, bounded in number.
#pragma once

#include <ros/time.h>
#include <visualization_msgs/MarkerArray.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "ros/output/marker_shapes.hpp"
#include "ros/output/surfel_mirror.hpp"

namespace frontier_surfels {

/// Makes the messages; keeps track of which blocks have markers out there. No publisher in it.
///
/// Blocks are cubes of 0.5 m with at most two markers each, in namespaces "occupied" and "frontier". Where there are more surfels than the
/// limit, those of a small cube, one label and one of six directions are merged to one square, and the cubes' size is doubled until it
/// fits. Cubes are made of cells of a lattice, and a surfel's cell is a Morton number, so that every size of cube is a prefix of it: how
/// many squares there would be is counted for all sizes at once.
class SurfelMarkers {
 public:
  /// @param limit  squares in all blocks together
  SurfelMarkers(std::string world_frame, std::size_t limit) : world_frame_(std::move(world_frame)), limit_(limit) {}

  /// A surfel comes or goes: its block must be sent again. For SurfelMirror::apply; does nothing before the first update().
  void touch(const Surfel& surfel, bool comes);

  /// Nobody looks: gives all memory back. The next update() is one of everything.
  void forget();

  /// The markers of all blocks that have been touched since the last update, deletions of those that have become empty, the view pyramid
  /// (namespace "camera") and a text with the counts ("counts"). `all`, and the first time: everything, after a DELETEALL.
  visualization_msgs::MarkerArray update(const SurfelMirror& map, const std::optional<CameraView>& camera, const ros::Time& stamp,
                                         bool all);

  std::size_t squares() const;  ///< out there, after update()
  double cell() const;          ///< edge of the cubes that are merged [m]; 0: all surfels are shown

 private:
  static constexpr int kBlockShift = 7;  ///< a block is 2^7 cells wide, and wider only where a cube would not fit in
  static constexpr int kMostShift = 20;
  static constexpr int kLevels = kMostShift + 2;  ///< 0: surfels; n: cubes of 2^(n - 1) cells

  using Key = std::uint64_t;
  struct Block {
    int number = 0;                                ///< id of its markers
    bool touched = false;                          ///< ids and squares are to be brought up to date
    std::array<bool, 2> shown = {};                ///< by label: whether there is a marker out there
    std::vector<std::uint32_t> ids;                ///< of its surfels, by cell; while touched: of more, and in any order
    std::vector<std::uint8_t> begins;              ///< for each of them the last level on which it begins a new square
    std::array<std::uint32_t, kLevels> squares{};  ///< on every level
  };

  Key block_key(const Surfel& surfel) const;
  Key cell_key(const Surfel& surfel) const;
  Block& touched_block(Key key);
  void index(const std::vector<Surfel>& slots);
  void refresh(Key key, Block& block, const std::vector<Surfel>& slots);
  std::size_t total(int level) const;
  int fitting_level() const;
  bool settle_level(const std::vector<Surfel>& slots);
  std::array<MarkerSquares, 2> squares_of(const Block& block, const std::vector<Surfel>& slots) const;
  void send(Block& block, const std::vector<Surfel>& slots, const std_msgs::Header& header, visualization_msgs::MarkerArray& message);

  std::string world_frame_;
  std::size_t limit_;
  bool indexed_ = false;
  int level_ = 0;
  int shift_ = kBlockShift;  ///< of the blocks
  int next_number_ = 0;
  bool camera_shown_ = false;
  std::unordered_map<Key, Block> blocks_;
  std::vector<Key> touched_;
  std::vector<std::pair<Key, std::uint32_t>> scratch_;
};

}  // namespace frontier_surfels
