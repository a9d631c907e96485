/// Surfels by their ids, which are slots of the mapper's: there may be few surfels and high ids.
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Whether there is a surfel in a slot.
inline bool exists(const Surfel& slot) { return slot.radius != 0; }

/// A slot for each id. Slots without a surfel have radius 0. Memory is taken by the thousand, where there are ids.
class SurfelSlots {
 public:
  /// Goes through all surfels, ordered by id.
  class Iterator {
   public:
    using iterator_category = std::forward_iterator_tag;
    using value_type = Surfel;
    using difference_type = std::ptrdiff_t;
    using pointer = const Surfel*;
    using reference = const Surfel&;

    Iterator(const SurfelSlots& slots, std::size_t id) : slots_(&slots), id_(id) { find(); }
    reference operator*() const { return slots_->chunks_[id_ / kChunk][id_ % kChunk]; }
    pointer operator->() const { return &**this; }
    Iterator& operator++() {
      ++id_;
      find();
      return *this;
    }
    Iterator operator++(int) {
      const Iterator before = *this;
      ++*this;
      return before;
    }
    bool operator==(const Iterator& other) const { return id_ == other.id_; }
    bool operator!=(const Iterator& other) const { return id_ != other.id_; }

   private:
    /// Goes on to the next surfel, if there is none here.
    void find() {
      while (id_ < slots_->end_id()) {
        if (slots_->chunks_[id_ / kChunk].empty())
          id_ = (id_ / kChunk + 1) * kChunk;
        else if (!exists(**this))
          ++id_;
        else
          return;
      }
    }

    const SurfelSlots* slots_;
    std::size_t id_;
  };

  Iterator begin() const { return {*this, 0}; }
  Iterator end() const { return {*this, end_id()}; }

  /// The surfel with this id; nullptr if there is none.
  const Surfel* find(std::uint32_t id) const {
    if (id >= end_id() || chunks_[id / kChunk].empty()) return nullptr;
    const Surfel& slot = chunks_[id / kChunk][id % kChunk];
    return exists(slot) ? &slot : nullptr;
  }
  Surfel* find(std::uint32_t id) { return const_cast<Surfel*>(static_cast<const SurfelSlots*>(this)->find(id)); }

  /// The slot of an id, made if missing.
  Surfel& at(std::uint32_t id) {
    if (id >= end_id()) chunks_.resize(id / kChunk + 1);
    std::vector<Surfel>& chunk = chunks_[id / kChunk];
    if (chunk.empty()) chunk.resize(kChunk);
    return chunk[id % kChunk];
  }

 private:
  static constexpr std::size_t kChunk = 4096;
  std::size_t end_id() const { return kChunk * chunks_.size(); }

  std::vector<std::vector<Surfel>> chunks_;  ///< kChunk slots each, or none
};

}  // namespace frontier_surfels
