#include "planner/cluster_partition.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cstdlib>
#include <iterator>
#include <utility>

#include "planner/cell_bits.hpp"

namespace frontier_surfels {
namespace {

constexpr auto by_key = [](const ClusterCell* a, const ClusterCell* b) { return a->key < b->key; };  // not a function: it is inlined

CellBox box_of(const ClusterPartition::Cells& cells) {
  CellBox box(cells.front()->key);
  for (const ClusterCell* cell : cells) box.extend(CellBox(cell->key));
  return box;
}

std::int64_t area_of(const ClusterPartition::Cells& cells) {
  std::int64_t area = 0;
  for (const ClusterCell* cell : cells) area += cell->area;
  return area;
}

void add_contact(std::uint32_t id, std::vector<std::pair<std::uint32_t, int>>& contacts) {
  for (auto& [other, pairs] : contacts) {
    if (other != id) continue;
    ++pairs;
    return;
  }
  contacts.emplace_back(id, 1);
}

bool more_contact(const std::pair<std::uint32_t, int>& a, const std::pair<std::uint32_t, int>& b) {
  return a.second != b.second ? a.second > b.second : a.first < b.first;
}

/// For each place of a neighbour, a bit for each place next to it.
std::array<std::uint32_t, 26> places_next_to_each() {
  const auto along = [](int n, int divisor) { return (n < 13 ? n : n + 1) / divisor % 3; };
  std::array<std::uint32_t, 26> next = {};
  for (int a = 0; a < 26; ++a)
    for (int b = 0; b < 26; ++b) {
      bool touch = true;
      for (const int divisor : {9, 3, 1}) touch = touch && std::abs(along(a, divisor) - along(b, divisor)) <= 1;
      if (touch) next[a] |= 1U << b;
    }
  return next;
}

/// Do the cells of its cluster around this one touch each other without it? Then the cluster does not fall apart if it goes.
bool can_be_spared(const ClusterCell& cell) {
  static const std::array<std::uint32_t, 26> kNext = places_next_to_each();
  std::uint32_t around = 0;
  for (int n = 0; n < 26; ++n)
    if (cell.neighbours[n] != nullptr && cell.neighbours[n]->cluster == cell.cluster) around |= 1U << n;
  std::uint32_t reached = around & (~around + 1), open = reached;  // the lowest bit
  while (open != 0) {
    const std::uint32_t more = kNext[__builtin_ctz(open)] & around & ~reached;
    open = (open & (open - 1)) | more;
    reached |= more;
  }
  return reached == around;
}

/// Two halves, on both sides of the plane through the mean of the cells across their longest axis.
std::pair<ClusterPartition::Cells, ClusterPartition::Cells> halves(const ClusterPartition::Cells& cells) {
  const auto centre = [](const ClusterCell* cell) { return Eigen::Vector3d(cell->key.x, cell->key.y, cell->key.z); };
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const ClusterCell* cell : cells) mean += centre(cell);
  mean /= static_cast<double>(cells.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const ClusterCell* cell : cells) spread += (centre(cell) - mean) * (centre(cell) - mean).transpose();
  const Eigen::Vector3d axis = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(2);

  std::pair<ClusterPartition::Cells, ClusterPartition::Cells> sides;
  for (ClusterCell* cell : cells) (axis.dot(centre(cell) - mean) > 0 ? sides.second : sides.first).push_back(cell);
  return sides;
}

}  // namespace

void CellBox::extend(const CellBox& other) {
  low = {std::min(low.x, other.low.x), std::min(low.y, other.low.y), std::min(low.z, other.low.z)};
  high = {std::max(high.x, other.high.x), std::max(high.y, other.high.y), std::max(high.z, other.high.z)};
}

int CellBox::longest_edge() const { return 1 + std::max({high.x - low.x, high.y - low.y, high.z - low.z}); }

std::set<std::uint32_t> ClusterPartition::update(const Cells& changed) {
  visited_ = 0;
  touched_.clear();
  shrunk_.clear();
  torn_.clear();

  const Cells fresh = sort_changes(changed);
  for (const std::uint32_t id : std::set<std::uint32_t>(shrunk_)) count(id);

  const Cells alone = join(fresh);
  for (const std::uint32_t id : torn_)
    if (shrunk_.count(id) > 0) divide(id);
  found(alone);

  merge_small();
  return touched_;
}

/// Takes cells that have no frontier any more out of their clusters. @return cells that have one, but no cluster yet, by key
ClusterPartition::Cells ClusterPartition::sort_changes(const Cells& changed) {
  Cells fresh;
  std::uint32_t last = 0;
  const auto touch = [&](std::uint32_t id) {  // mostly, cells that follow each other are of the same cluster
    if (id != 0 && id != last) touched_.insert(id);
    if (id != 0) last = id;
  };
  for (ClusterCell* cell : changed) {
    ++visited_;
    if ((cell->occupied > 0) != cell->was_occupied)
      ClusterLattice::for_neighbours(*cell, [&](const ClusterCell& other) { touch(other.cluster); });
    touch(cell->cluster);
    if (cell->frontier > 0 && cell->cluster == 0) fresh.push_back(cell);
    if (cell->frontier == 0 && cell->cluster != 0) {
      shrunk_.insert(cell->cluster);
      if (!can_be_spared(*cell)) torn_.insert(cell->cluster);
      cell->cluster = 0;
    }
  }
  for (const std::uint32_t id : shrunk_) {
    Cells& cells = groups_.at(id).cells;
    cells.erase(std::remove_if(cells.begin(), cells.end(), [](const ClusterCell* cell) { return cell->cluster == 0; }), cells.end());
  }
  std::sort(fresh.begin(), fresh.end(), by_key);
  return fresh;
}

/// Brings a group's box up to date after it has lost cells; merge_small() sums up its area. Without cells, it ends.
void ClusterPartition::count(std::uint32_t id) {
  const auto at = groups_.find(id);
  if (at->second.cells.empty()) {
    groups_.erase(at);
    shrunk_.erase(id);
  } else {
    at->second.box = box_of(at->second.cells);
    visited_ += at->second.cells.size();
  }
}

/// Gives new cells to clusters next to them, ring by ring. @return those that no cluster has room for
ClusterPartition::Cells ClusterPartition::join(Cells fresh) {
  std::map<std::uint32_t, std::size_t> grown;  // numbers of cells before, by cluster
  for (Cells open = fresh; !open.empty();) {
    std::vector<std::pair<ClusterCell*, Owner*>> ring;
    for (ClusterCell* cell : open) {
      ++visited_;
      Owner* owner = neighbour_with_room(*cell);
      if (owner == nullptr) continue;
      owner->second.box.extend(CellBox(cell->key));
      ring.emplace_back(cell, owner);
    }
    // Cells of a ring do not see each other: else those with larger keys would be reached first.
    for (const auto& [cell, owner] : ring) {
      cell->cluster = owner->first;
      Cells& cells = owner->second.cells;
      grown.try_emplace(owner->first, cells.size());
      cells.push_back(cell);
    }
    open = next_ring(ring);
  }
  for (const auto& [id, before] : grown) {
    Cells& cells = groups_.at(id).cells;
    const auto added = cells.begin() + static_cast<std::ptrdiff_t>(before);
    std::sort(added, cells.end(), by_key);
    std::inplace_merge(cells.begin(), added, cells.end(), by_key);
    touched_.insert(id);
  }
  fresh.erase(std::remove_if(fresh.begin(), fresh.end(), [](const ClusterCell* cell) { return cell->cluster != 0; }), fresh.end());
  return fresh;
}

/// Cells without a cluster next to those that have just got one, by key. Others had no room near by and have none now, since clusters grow.
ClusterPartition::Cells ClusterPartition::next_ring(const std::vector<std::pair<ClusterCell*, Owner*>>& ring) {
  const std::uint32_t mark = ++mark_;
  Cells next;
  for (const auto& [cell, owner] : ring)
    ClusterLattice::for_neighbours(*cell, [&](ClusterCell& other) {
      if (other.frontier == 0 || other.cluster != 0 || other.mark == mark) return;
      other.mark = mark;
      next.push_back(&other);
    });
  std::sort(next.begin(), next.end(), by_key);
  return next;
}

/// The cluster with most cells next to this one, of those that it does not make too large; null: none.
ClusterPartition::Owner* ClusterPartition::neighbour_with_room(const ClusterCell& cell) {
  Contacts& contacts = cell_contacts_;  // kept for its memory
  contacts.clear();
  ClusterLattice::for_neighbours(cell, [&](const ClusterCell& other) {
    if (other.cluster != 0) add_contact(other.cluster, contacts);
  });
  if (contacts.size() > 1) std::sort(contacts.begin(), contacts.end(), more_contact);
  for (const auto& [id, pairs] : contacts) {
    Owner& owner = *groups_.find(id);
    CellBox box = owner.second.box;
    box.extend(CellBox(cell.key));
    if (box.longest_edge() <= max_extent_) return &owner;
  }
  return nullptr;
}

/// Makes several clusters of one that has fallen apart. The part of the largest area keeps the id.
void ClusterPartition::divide(std::uint32_t id) {
  const Group& whole = groups_.at(id);
  if (CellBits::fits(whole.box) && CellBits(whole.cells, whole.box).are_connected()) {
    visited_ += whole.cells.size();
    return;
  }
  std::vector<Cells> parts = components(whole.cells);
  if (parts.size() == 1) return;
  const auto area_less = [](const Group& a, const Group& b) { return a.area < b.area; };
  std::vector<Group> groups;
  for (Cells& part : parts) groups.push_back(group_of(std::move(part)));
  const auto largest = std::max_element(groups.begin(), groups.end(), area_less);
  for (auto group = groups.begin(); group != groups.end(); ++group) {
    const std::uint32_t own = group == largest ? id : next_id_++;
    for (ClusterCell* cell : group->cells) cell->cluster = own;
    touched_.insert(own);
    groups_.insert_or_assign(own, std::move(*group));
  }
}

/// New clusters of cells that are in none.
void ClusterPartition::found(const Cells& cells) {
  std::vector<Cells> parts;
  for (const Cells& component : components(cells)) divide_to_extent(component, parts);
  for (Cells& part : parts) {
    const std::uint32_t id = next_id_++;
    for (ClusterCell* cell : part) cell->cluster = id;
    touched_.insert(id);
    groups_.emplace(id, group_of(std::move(part)));
  }
}

void ClusterPartition::divide_to_extent(const Cells& cells, std::vector<Cells>& parts) {
  if (box_of(cells).longest_edge() <= max_extent_) {
    parts.push_back(cells);
    return;
  }
  const auto [lower, upper] = halves(cells);
  for (const Cells* half : {&lower, &upper})
    for (const Cells& component : components(*half)) divide_to_extent(component, parts);
}

/// Lets small clusters join their neighbours.
void ClusterPartition::merge_small() {
  for (const std::uint32_t id : std::set<std::uint32_t>(touched_)) {
    const auto at = groups_.find(id);
    if (at == groups_.end()) continue;
    at->second.area = area_of(at->second.cells);
    visited_ += at->second.cells.size();
  }
  // Those next to a cluster that has changed may have room now. Small ones are few, so all of them try.
  std::set<std::uint32_t> open;
  if (!touched_.empty())
    for (const auto& [id, group] : groups_)
      if (group.area < min_area_) open.insert(id);
  while (!open.empty()) {
    const std::uint32_t id = *open.begin();
    open.erase(open.begin());
    const auto at = groups_.find(id);
    if (at == groups_.end()) continue;
    if (at->second.area >= min_area_) continue;
    for (const auto& [other, pairs] : contacts(at->second)) {
      CellBox box = at->second.box;
      box.extend(groups_.at(other).box);
      if (box.longest_edge() > max_extent_) continue;
      open.insert(merge(id, other));
      break;
    }
  }
}

/// @return the id that stays, that of the larger one
std::uint32_t ClusterPartition::merge(std::uint32_t a, std::uint32_t b) {
  const std::int64_t area_a = groups_.at(a).area, area_b = groups_.at(b).area;
  const std::uint32_t stays = area_a > area_b || (area_a == area_b && a < b) ? a : b, goes = stays == a ? b : a;
  Group& group = groups_.at(stays);
  const Group other = std::move(groups_.at(goes));
  groups_.erase(goes);
  for (ClusterCell* cell : other.cells) cell->cluster = stays;

  Cells all;
  std::merge(group.cells.begin(), group.cells.end(), other.cells.begin(), other.cells.end(), std::back_inserter(all), by_key);
  group.cells = std::move(all);
  group.area += other.area;
  group.box.extend(other.box);
  touched_.insert(stays);
  touched_.insert(goes);
  return stays;
}

ClusterPartition::Contacts ClusterPartition::contacts(const Group& group) {
  Contacts contacts;
  visited_ += group.cells.size();
  for (const ClusterCell* cell : group.cells)
    ClusterLattice::for_neighbours(*cell, [&](const ClusterCell& other) {
      if (other.cluster != 0 && other.cluster != cell->cluster) add_contact(other.cluster, contacts);
    });
  std::sort(contacts.begin(), contacts.end(), more_contact);
  return contacts;
}

/// The connected parts of cells that are given by key, in the order of their first cells. Each is ordered by key.
std::vector<ClusterPartition::Cells> ClusterPartition::components(const Cells& cells) {
  const std::uint32_t open = ++mark_;
  for (ClusterCell* cell : cells) cell->mark = open;
  visited_ += cells.size();
  Cells reached;
  reached.reserve(cells.size());
  for (ClusterCell* first : cells) {
    if (first->mark != open) continue;
    const std::uint32_t own = ++mark_;
    const auto reach = [&](ClusterCell& cell) {
      cell.mark = own;
      reached.push_back(&cell);
    };
    std::size_t next = reached.size();
    reach(*first);
    for (; next < reached.size() && reached.size() < cells.size(); ++next)
      ClusterLattice::for_neighbours(*reached[next], [&](ClusterCell& other) {
        if (other.mark == open) reach(other);
      });
  }
  if (mark_ == open + 1) return {cells};  // all are connected
  std::vector<Cells> parts(mark_ - open);
  for (ClusterCell* cell : cells) parts[cell->mark - open - 1].push_back(cell);
  return parts;
}

ClusterPartition::Group ClusterPartition::group_of(Cells cells) {
  const CellBox box = box_of(cells);
  const std::int64_t area = area_of(cells);
  visited_ += cells.size();
  return {std::move(cells), area, box};
}

}  // namespace frontier_surfels
