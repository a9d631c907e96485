/// The map as markers for rviz: oriented squares, one marker for each block and label, of a limited number in all.
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

/// Makes the messages, and keeps track of which blocks have markers that are shown. It publishes nothing itself.
///
/// Blocks are cubes of 0.5 m with at most two markers each, in the namespaces "occupied" and "frontier". If there are more surfels than the
/// limit, all surfels in a small cube that have the same label and nearly the same direction (one of six) are merged to one square. The
/// size of these cubes is doubled until the squares are few enough. Cubes consist of cells of a lattice, and the number of a surfel's cell
/// is a Morton number, so that a prefix of it is the number of a larger cube. The squares of all sizes are thus counted at once.
class SurfelMarkers {
 public:
  /// @param limit  maximum number of squares in all blocks together
  SurfelMarkers(std::string world_frame, std::size_t limit) : world_frame_(std::move(world_frame)), limit_(limit) {}

  /// A surfel comes or goes, so that its block must be sent again. To be given to SurfelMirror::apply. Does nothing before the first
  /// update().
  void touch(const Surfel& surfel, bool comes);

  /// Frees all memory, because there are no subscribers. The next update() contains everything.
  void forget();

  /// The markers of all blocks that have been touched since the last update, deletions of blocks that have become empty, the view pyramid
  /// (namespace "camera") and a text with the numbers of surfels ("counts").
  /// @param all  the message begins with a DELETEALL and contains all blocks, as the first one always does
  visualization_msgs::MarkerArray update(const SurfelMirror& map, const std::optional<CameraView>& camera, const ros::Time& stamp,
                                         bool all);

  std::size_t squares() const;  ///< number of squares that are shown after update()
  double cell() const;          ///< edge of the cubes in which surfels are merged [m]; 0 if every surfel is shown

 private:
  static constexpr int kBlockShift = 7;  ///< a block is 2^7 cells wide, unless the cubes are larger
  static constexpr int kMostShift = 20;
  static constexpr int kLevels = kMostShift + 2;  ///< level 0: every surfel; level n: cubes 2^(n - 1) cells wide

  using Key = std::uint64_t;
  struct Block {
    int number = 0;                                ///< id of its markers
    bool touched = false;                          ///< ids and squares must be brought up to date
    std::array<bool, 2> shown = {};                ///< whether a marker is shown, for each label
    std::vector<std::uint32_t> ids;                ///< its surfels, ordered by cell; while touched, unordered and with surfels too many
    std::vector<std::uint8_t> begins;              ///< for each surfel the coarsest level on which it begins a new square
    std::array<std::uint32_t, kLevels> squares{};  ///< number of squares on each level
  };

  Key block_key(const Surfel& surfel) const;
  Key cell_key(const Surfel& surfel) const;
  Block& touched_block(Key key);
  void index(const SurfelSlots& slots);
  void refresh(Key key, Block& block, const SurfelSlots& slots);
  std::size_t total(int level) const;
  int fitting_level() const;
  bool settle_level(const SurfelSlots& slots);
  std::array<MarkerSquares, 2> squares_of(const Block& block, const SurfelSlots& slots) const;
  void send(Block& block, const SurfelSlots& slots, const std_msgs::Header& header, visualization_msgs::MarkerArray& message);

  std::string world_frame_;
  std::size_t limit_;
  bool indexed_ = false;
  int level_ = 0;
  int shift_ = kBlockShift;  ///< blocks are 2^shift_ cells wide
  int next_number_ = 0;
  bool camera_shown_ = false;
  std::unordered_map<Key, Block> blocks_;
  std::vector<Key> touched_;
  std::vector<std::pair<Key, std::uint32_t>> scratch_;
};

}  // namespace frontier_surfels
