/// Surfels gathered in cells, from which clusters are made.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "map/block_key.hpp"

namespace frontier_surfels {

/// Sums are whole numbers of small units, so that they do not depend on the order in which surfels came and went. What surfels change lies
/// together, because most of the time goes into fetching cells from memory.
struct alignas(64) ClusterCell {
  BlockKey key;                                      ///< the cell's lowest corner is this times its edge
  std::int64_t area = 0;                             ///< of the boundary that frontier surfels stand for [kAreaUnit]
  std::array<std::int64_t, 3> position = {0, 0, 0};  ///< sum of frontier surfels' distances from the cell's lowest corner [kLengthUnit]
  std::array<std::int64_t, 3> normal = {0, 0, 0};    ///< sum of frontier surfels' normals [kNormalUnit]
  std::uint32_t frontier = 0;                        ///< surfels
  std::uint32_t occupied = 0;                        ///< surfels
  std::uint32_t cluster = 0;                         ///< id; 0: none
  std::uint32_t mark = 0;                            ///< of the search that is under way
  std::uint32_t number = 0;                          ///< in the lattice; never 0
  bool changed = false;                              ///< since take_changed()
  bool was_occupied = false;                         ///< at the last take_changed()
  /// Cells with surfels that touch this one; null where there is none. Opposite ones have places that add up to 25.
  std::array<ClusterCell*, 26> neighbours = {};
};

constexpr double kAreaUnit = 1.0 / (std::int64_t{1} << 36);    // [m2]
constexpr double kLengthUnit = 1.0 / (std::int64_t{1} << 32);  // [m]
constexpr double kNormalUnit = 1.0 / (std::int64_t{1} << 30);

class ClusterLattice {
 public:
  explicit ClusterLattice(double cell) : cell_(cell), per_metre_(1 / cell) {}

  /// @throws Error  a surfel cannot be used; nothing has changed
  void apply(const Changes& changes);

  /// Cells that differ from those at the last call, in no certain order. All are to be given to forget_empty().
  std::vector<ClusterCell*> take_changed();
  void forget_empty(const std::vector<ClusterCell*>& cells);

  /// Calls visit(cell) for the up to 26 cells with surfels that touch this one, by key.
  template <typename Visit>
  static void for_neighbours(const ClusterCell& cell, Visit&& visit) {
    for (ClusterCell* other : cell.neighbours)
      if (other != nullptr) visit(*other);
  }

  double cell() const { return cell_; }

  /// Of a cell's frontier surfels, world frame [m].
  Eigen::Vector3d mean_position(const ClusterCell& cell) const {
    const Eigen::Vector3d corner = Eigen::Vector3d(cell.key.x, cell.key.y, cell.key.z) * cell_;
    const Eigen::Vector3d sum(cell.position[0], cell.position[1], cell.position[2]);
    return corner + sum * (kLengthUnit / std::max(1U, cell.frontier));
  }

 private:
  /// What is kept of a surfel, to tell what changes.
  struct Kept {
    std::array<float, 3> position, normal;
    float signed_radius;  ///< [m] negative for occupied surfels
    std::uint32_t cell;   ///< number of the cell that counts it

    bool is_frontier() const { return signed_radius > 0; }
    bool looks_like(const Kept& other) const {
      return signed_radius == other.signed_radius && position == other.position && normal == other.normal;
    }
  };
  static constexpr std::size_t kPage = 64;
  struct alignas(64) Page {
    Page() {}  // filling the surfels would take longer than all that is done with them
    std::array<Kept, kPage> surfels;
    std::uint64_t exists = 0;  ///< a bit for each surfel that there is; the others are not filled in
  };

  /// Numbers of 8^3 cells, 0 where there is none; most questions after neighbours end in the same cube.
  struct Cube {
    std::array<std::uint32_t, 512> cells = {};
    int count = 0;
  };
  static constexpr std::size_t kBatch = 64;   ///< surfels that are put at a time
  static constexpr std::size_t kRecent = 64;  ///< a power of two

  static constexpr std::uint32_t kChunk = 256;
  using Chunk = std::array<ClusterCell, kChunk>;
  static BlockKey cube_of(const BlockKey& key) { return {key.x >> 3, key.y >> 3, key.z >> 3}; }
  static std::size_t place_of(const BlockKey& key) { return (key.x & 7) << 6 | (key.y & 7) << 3 | (key.z & 7); }
  Cube* find_cube(const BlockKey& cube);

  void check(const Changes& changes) const;
  Page* page_of(std::uint32_t id);
  static Kept* kept(Page* page, std::uint32_t id);
  void remove(const std::vector<std::uint32_t>& ids);
  void put(const Surfel* surfels, std::size_t count);
  void change(const Kept& before, const Kept& now, ClusterCell& cell);
  void count(ClusterCell& cell, const Kept& surfel, std::int64_t sign);
  ClusterCell& cell(std::uint32_t number) { return (*chunks_[number / kChunk])[number % kChunk]; }
  ClusterCell& cell_at(const BlockKey& key);
  ClusterCell* find(const BlockKey& key);
  std::uint32_t take_number();
  void forget(ClusterCell& cell);
  void link(ClusterCell& cell);
  BlockKey key_of(const Eigen::Vector3f& position) const;

  double cell_;       ///< [m]
  double per_metre_;  ///< [cell/m]
  std::vector<std::unique_ptr<Page>> pages_;
  std::unordered_map<BlockKey, Cube> cubes_;
  std::array<std::pair<BlockKey, Cube*>, kRecent> recent_cubes_ = {};  ///< of find_cube(), by hash; null: none
  std::vector<std::unique_ptr<Chunk>> chunks_;                         ///< cells by number
  std::vector<std::uint32_t> unused_;                                  ///< numbers of cells, descending at first
  std::vector<ClusterCell*> changed_;
  std::array<BlockKey, kBatch> keys_;  ///< of put(); here, as filling them anew each time would take longer than what is done with them
};

}  // namespace frontier_surfels
