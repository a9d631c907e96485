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

  /// Takes surfels out of the map, as an earlier frame would have.
  void kill(const std::vector<std::uint32_t>& slots) {
    for (const std::uint32_t slot : slots) {
      const auto word = peek<cl_ulong>(map_.alive(), slot / PAGE_SLOTS);
      poke(map_.alive(), slot / PAGE_SLOTS, word & ~(cl_ulong{1} << slot % PAGE_SLOTS));
    }
    map_.removed(slots.size());
  }

  /// As if all surfels of the window were new.
  void change_all() {
    for (const std::uint32_t page : window_pages()) poke(map_.changed(), page, ~cl_ulong{0});
  }

  void make_ragged(const std::vector<std::uint32_t>& slots) {
    for (const std::uint32_t slot : slots) poke(map_.surfels(), 4 * std::size_t{slot} + 3, cl_uint{attributes(slot) | SURFEL_RAGGED});
  }

  /// Of the first pages: all slots, and the block of each page.
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

  /// The window's pages, as the kernels that go through them number them.
  std::vector<std::uint32_t> window_pages() const { return peek_all<cl_uint>(map_.pages(), map_.window_pages()); }

  /// A word for each of them, a bit a slot.
  std::vector<std::uint64_t> words(const DeviceArray<cl_ulong>& bits) const { return bits.read(map_.window_pages()); }

  /// Slots that such words say, page after page.
  std::vector<std::uint32_t> slots(const std::vector<std::uint64_t>& words) const {
    std::vector<std::uint32_t> slots;
    const std::vector<std::uint32_t> pages = window_pages();
    for (std::size_t n = 0; n < words.size(); ++n)
      for (std::uint32_t bit = 0; bit < PAGE_SLOTS; ++bit)
        if (words[n] >> bit & 1) slots.push_back(PAGE_SLOTS * pages[n] + bit);
    return slots;
  }
  std::vector<std::uint32_t> slots(const DeviceArray<cl_ulong>& bits) const { return slots(words(bits)); }

  /// Where surfels stand in the map, or in the part of it that is in none of the slots `but`. Each must be there once.
  std::vector<std::uint32_t> find_slots(const std::vector<cl_uint4>& surfels, const std::vector<cl_uint>& cells,
                                        const std::set<std::uint32_t>& but) const {
    std::map<std::array<std::int64_t, 7>, std::uint32_t> slots;
    const auto key = [](const cl_uint4& p, const BlockKey& b) {
      return std::array<std::int64_t, 7>{p.s[0], p.s[1], p.s[2], p.s[3], b.x, b.y, b.z};
    };
    const std::vector<Surfel> all = map_.download();
    const std::size_t pages = all.empty() ? 0 : all.back().id / PAGE_SLOTS + 1;
    const std::vector<cl_uint4> packed_slots = packed_of(pages);
    const std::vector<cl_int4> blocks = blocks_of(pages);
    for (const Surfel& surfel : all) {
      if (but.count(surfel.id) != 0) continue;
      const cl_int4& block = blocks[surfel.id / PAGE_SLOTS];
      EXPECT_TRUE(slots.emplace(key(packed_slots[surfel.id], {block.s[0], block.s[1], block.s[2]}), surfel.id).second)
          << "two surfels are the same";
    }
    EXPECT_EQ(slots.size(), surfels.size()) << "so many are new";
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
