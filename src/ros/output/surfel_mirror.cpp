#include "ros/output/surfel_mirror.hpp"

#include <algorithm>
#include <iterator>
#include <string>

namespace frontier_surfels {
namespace {

bool by_id(const Surfel& a, const Surfel& b) { return a.id < b.id; }

template <typename Wanted>
std::vector<Surfel> pick(const SurfelSlots& slots, std::size_t most, Wanted wanted) {
  std::vector<Surfel> surfels;
  surfels.reserve(most);
  std::copy_if(slots.begin(), slots.end(), std::back_inserter(surfels), wanted);
  return surfels;
}

/// Orders surfels by id. Of several surfels with the same id, only the last one is kept.
void order(std::vector<Surfel>& surfels) {
  if (!std::is_sorted(surfels.begin(), surfels.end(), by_id)) std::stable_sort(surfels.begin(), surfels.end(), by_id);
  const auto same = [](const Surfel& a, const Surfel& b) { return a.id == b.id; };
  surfels.erase(surfels.begin(), std::unique(surfels.rbegin(), surfels.rend(), same).base());
}

void order(std::vector<std::uint32_t>& ids) {
  if (!std::is_sorted(ids.begin(), ids.end())) std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
}

/// The surfels whose ids are not in `ids`. Both must be ordered by id.
std::vector<Surfel> without(const std::vector<Surfel>& surfels, const std::vector<std::uint32_t>& ids) {
  std::vector<Surfel> left;
  left.reserve(surfels.size());
  auto id = ids.begin();
  for (const Surfel& surfel : surfels) {
    while (id != ids.end() && *id < surfel.id) ++id;
    if (id == ids.end() || *id != surfel.id) left.push_back(surfel);
  }
  return left;
}

}  // namespace

Eigen::AlignedBox3f SurfelMirror::apply(const Changes& changes, std::uint64_t since, const Visit& visit) {
  if (since != 0 && since != sequence_)
    throw Error("The changes begin at number " + std::to_string(since) + ", but the copy of the map is of number " +
                std::to_string(sequence_) + ": ask for the whole map.");
  for (const Surfel& surfel : changes.updated) slots_.at(surfel.id);  // memory may run out: before anything changes
  Eigen::AlignedBox3f box;
  const auto remove = [&](Surfel& slot) {
    if (!exists(slot)) return;
    box.extend(slot.position);
    if (visit) visit(slot, false);
    --size_;
    occupied_ -= slot.label == Label::kOccupied;
    slot.radius = 0;
  };
  if (since == 0) {
    for (const Surfel& surfel : slots_) remove(*slots_.find(surfel.id));
  }
  for (const std::uint32_t id : changes.removed)
    if (Surfel* slot = slots_.find(id)) remove(*slot);
  for (const Surfel& surfel : changes.updated) {
    Surfel& slot = slots_.at(surfel.id);
    remove(slot);
    if (!exists(surfel)) continue;
    slot = surfel;
    ++size_;
    occupied_ += surfel.label == Label::kOccupied;
    box.extend(surfel.position);
    if (visit) visit(surfel, true);
  }
  sequence_ = changes.sequence;
  return box;
}

std::vector<Surfel> SurfelMirror::surfels() const {
  return pick(slots_, size_, [](const Surfel&) { return true; });
}

std::vector<Surfel> SurfelMirror::surfels(Label label) const {
  return pick(slots_, label == Label::kOccupied ? occupied_ : size_ - occupied_, [label](const Surfel& s) { return s.label == label; });
}

std::vector<Surfel> SurfelMirror::surfels(const Eigen::AlignedBox3f& box_world) const {
  return pick(slots_, 0, [&](const Surfel& s) { return box_world.contains(s.position); });
}

Changes merge(Changes earlier, Changes later) {
  for (Changes* changes : {&earlier, &later}) {
    order(changes->updated);
    order(changes->removed);
  }
  Changes merged;
  merged.sequence = later.sequence;

  // If both have a surfel of one id, set_union takes the one of its first argument.
  const std::vector<Surfel> kept = without(earlier.updated, later.removed);
  merged.updated.reserve(kept.size() + later.updated.size());
  std::set_union(later.updated.begin(), later.updated.end(), kept.begin(), kept.end(), std::back_inserter(merged.updated), by_id);

  merged.removed.reserve(earlier.removed.size() + later.removed.size());
  std::set_union(earlier.removed.begin(), earlier.removed.end(), later.removed.begin(), later.removed.end(),
                 std::back_inserter(merged.removed));
  return merged;
}

}  // namespace frontier_surfels
