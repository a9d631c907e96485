/// Access to single slots and pages of the map's buffers.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <set>
#include <vector>

#include "map/surfel_map.hpp"

namespace frontier_surfels {

class MapAccess {
 public:
  MapAccess(Commands& commands, SurfelMap& map) : commands_(commands), map_(map) {}

  /// Removes surfels from the map, as an earlier frame would have done.
  void kill(const std::vector<std::uint32_t>& slots) {
    for (const std::uint32_t slot : slots) {
      const auto word = peek<cl_ulong>(map_.alive(), slot / PAGE_SLOTS);
      poke(map_.alive(), slot / PAGE_SLOTS, word & ~(cl_ulong{1} << slot % PAGE_SLOTS));
    }
    map_.removed(slots.size());
  }

  /// Marks all slots of the window as changed, as if all surfels were new.
  void change_all() {
    for (const std::uint32_t page : window_pages()) poke(map_.changed(), page, ~cl_ulong{0});
  }

  void make_ragged(const std::vector<std::uint32_t>& slots) {
    for (const std::uint32_t slot : slots) poke(map_.surfels(), 4 * std::size_t{slot} + 3, cl_uint{attributes(slot) | SURFEL_RAGGED});
  }

  /// All slots of the first pages, and the blocks of the first pages.
  std::vector<cl_uint4> packed_of(std::size_t pages) const { return peek_all<cl_uint4>(map_.surfels(), PAGE_SLOTS * pages); }
  std::vector<cl_int4> blocks_of(std::size_t pages) const { return peek_all<cl_int4>(map_.page_block(), pages); }

  cl_uint4 packed(std::uint32_t slot) const { return peek<cl_uint4>(map_.surfels(), slot); }
  std::uint32_t attributes(std::uint32_t slot) const { return packed(slot).s[3]; }
  std::uint64_t alive_word(std::uint32_t page) const { return peek<cl_ulong>(map_.alive(), page); }
  bool is_alive(std::uint32_t slot) const { return alive_word(slot / PAGE_SLOTS) >> slot % PAGE_SLOTS & 1; }
  BlockKey block_of_slot(std::uint32_t slot) const {
    const auto block = peek<cl_int4>(map_.page_block(), slot / PAGE_SLOTS);
    return {block.s[0], block.s[1], block.s[2]};
  }

  /// The window's pages in the order in which kernels number them.
  std::vector<std::uint32_t> window_pages() const { return peek_all<cl_uint>(map_.pages(), map_.window_pages()); }

  /// One word for each page of the window, one bit for each slot.
  std::vector<std::uint64_t> words(const DeviceArray<cl_ulong>& bits) const { return bits.read(map_.window_pages()); }

  /// Slots whose bits are set in such words, page after page.
  std::vector<std::uint32_t> slots(const std::vector<std::uint64_t>& words) const {
    std::vector<std::uint32_t> slots;
    const std::vector<std::uint32_t> pages = window_pages();
    for (std::size_t n = 0; n < words.size(); ++n)
      for (std::uint32_t bit = 0; bit < PAGE_SLOTS; ++bit)
        if (words[n] >> bit & 1) slots.push_back(PAGE_SLOTS * pages[n] + bit);
    return slots;
  }
  std::vector<std::uint32_t> slots(const DeviceArray<cl_ulong>& bits) const { return slots(words(bits)); }

  /// Finds the slots of surfels. Expects that the map's slots, without those in `except`, hold exactly these surfels, each once.
  std::vector<std::uint32_t> find_slots(const std::vector<cl_uint4>& surfels, const std::vector<cl_uint>& cells,
                                        const std::set<std::uint32_t>& except) const {
    std::map<std::array<std::int64_t, 7>, std::uint32_t> slots;
    const auto key = [](const cl_uint4& p, const BlockKey& b) {
      return std::array<std::int64_t, 7>{p.s[0], p.s[1], p.s[2], p.s[3], b.x, b.y, b.z};
    };
    const std::vector<Surfel> all = map_.download();
    const std::size_t pages = all.empty() ? 0 : all.back().id / PAGE_SLOTS + 1;
    const std::vector<cl_uint4> packed_slots = packed_of(pages);
    const std::vector<cl_int4> blocks = blocks_of(pages);
    for (const Surfel& surfel : all) {
      if (except.count(surfel.id) != 0) continue;
      const cl_int4& block = blocks[surfel.id / PAGE_SLOTS];
      EXPECT_TRUE(slots.emplace(key(packed_slots[surfel.id], {block.s[0], block.s[1], block.s[2]}), surfel.id).second)
          << "two surfels are the same";
    }
    EXPECT_EQ(slots.size(), surfels.size()) << "number of new surfels";
    std::vector<std::uint32_t> found;
    for (std::size_t n = 0; n < surfels.size(); ++n) {
      const auto at = slots.find(key(surfels[n], map_.window().block(static_cast<int>(cells[n]))));
      EXPECT_TRUE(at != slots.end()) << "surfel " << n << " is not in its block";
      found.push_back(at == slots.end() ? 0 : at->second);
    }
    return found;
  }

 private:
  template <typename T>
  T peek(const cl::Buffer& buffer, std::size_t index) const {
    T value;
    commands_.queue().enqueueReadBuffer(buffer, CL_TRUE, index * sizeof(T), sizeof(T), &value);
    return value;
  }
  template <typename T>
  std::vector<T> peek_all(const cl::Buffer& buffer, std::size_t count) const {
    std::vector<T> values(count);
    if (count > 0) commands_.queue().enqueueReadBuffer(buffer, CL_TRUE, 0, count * sizeof(T), values.data());
    return values;
  }
  template <typename T>
  void poke(const cl::Buffer& buffer, std::size_t index, const T& value) {
    commands_.queue().enqueueWriteBuffer(buffer, CL_TRUE, index * sizeof(T), sizeof(T), &value);
  }

  Commands& commands_;
  SurfelMap& map_;
};

}  // namespace frontier_surfels
