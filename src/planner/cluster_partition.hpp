/// Which cells form which cluster. Cells stay where they are, so that clusters keep their ids while the map changes.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "planner/cluster_lattice.hpp"

namespace frontier_surfels {

/// A box of cells, both ends included.
struct CellBox {
  BlockKey low, high;

  explicit CellBox(const BlockKey& key) : low(key), high(key) {}
  void extend(const CellBox& other);
  int longest_edge() const;  ///< [cell]
};

class ClusterPartition {
 public:
  using Cells = std::vector<ClusterCell*>;

  struct Group {
    Cells cells;            ///< by key; never none
    std::int64_t area = 0;  ///< [kAreaUnit]
    CellBox box;
  };

  /// @param max_extent  longest edge of a cluster's box [cell]. @param min_area  below it, clusters join others [kAreaUnit]
  ClusterPartition(int max_extent, std::int64_t min_area) : max_extent_(max_extent), min_area_(min_area) {}

  /// Follows changes of cells, in any order. @return ids of clusters that are new, or have changed in any way; some may be gone
  std::set<std::uint32_t> update(const Cells& changed);

  /// To be called when the lattice forgets all cells. Ids are not given again.
  void clear() { groups_.clear(); }

  const std::map<std::uint32_t, Group>& groups() const { return groups_; }
  std::size_t visited() const { return visited_; }  ///< cells that the last update looked at

 private:
  /// Neighbours of a cluster or cell with the number of pairs of cells that touch, those with most of them first.
  using Contacts = std::vector<std::pair<std::uint32_t, int>>;

  Cells sort_changes(const Cells& changed);
  using Owner = std::pair<const std::uint32_t, Group>;  ///< a group with its id
  Cells join(Cells fresh);
  Owner* neighbour_with_room(const ClusterCell& cell);
  Cells next_ring(const std::vector<std::pair<ClusterCell*, Owner*>>& ring);
  void divide(std::uint32_t id);
  void found(const Cells& cells);
  void merge_small();
  std::uint32_t merge(std::uint32_t a, std::uint32_t b);

  void count(std::uint32_t id);
  Contacts contacts(const Group& group);
  std::vector<Cells> components(const Cells& cells);
  void divide_to_extent(const Cells& cells, std::vector<Cells>& parts);
  Group group_of(Cells cells);

  int max_extent_;
  std::int64_t min_area_;
  std::map<std::uint32_t, Group> groups_;
  std::uint32_t next_id_ = 1;
  std::uint32_t mark_ = 0;
  std::size_t visited_ = 0;
  Contacts cell_contacts_;
  std::set<std::uint32_t> touched_;  ///< groups that have changed in this update
  std::set<std::uint32_t> shrunk_;   ///< groups that have lost cells in this update
  std::set<std::uint32_t> torn_;     ///< those of them that may have fallen apart
};

}  // namespace frontier_surfels
