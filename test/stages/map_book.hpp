/// A simple book of all slots of a map, for tests of its pages.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <vector>

#include "stages/frame_fixture.hpp"
#include "stages/reference_surfels.hpp"
#include "stages/removal.hpp"

namespace frontier_surfels::reference {

using Packed = std::array<std::uint32_t, 4>;

inline Packed to_array(const cl_uint4& packed) { return {packed.s[0], packed.s[1], packed.s[2], packed.s[3]}; }

/// Expected content of the map: every surfel's slot and packed form, and every page's block.
struct Book {
  std::map<std::uint32_t, Packed> surfels;
  std::map<std::uint32_t, BlockKey> pages;

  /// Free slots of a page, lowest first.
  std::vector<std::uint32_t> free_slots(std::uint32_t page) const {
    std::vector<std::uint32_t> free;
    for (std::uint32_t slot = PAGE_SLOTS * page; slot < PAGE_SLOTS * (page + 1); ++slot)
      if (surfels.count(slot) == 0) free.push_back(slot);
    return free;
  }
};

/// What the device has found in a frame when it decides whether to go on.
struct Finding {
  cl_uint evidence = 0, large = 0, labelled = 0;  ///< pixels, surfels
  cl_uint unlisted = 0, unchosen = 0;             ///< entries without room
  bool asks = true;                               ///< whether the evidence matters
  bool fails = false;                             ///< the frame is undone after that
};

/// A map with the window of a view, and the book of its expected content.
class Pages {
 public:
  explicit Pages(unsigned seed, Commands& commands = test_commands()) : random_(seed), fixture_(camera_.config, commands) {}

  FrameFixture& fixture() { return fixture_; }
  SurfelMap& map() { return fixture_.map(); }
  const Book& book() const { return book_; }

  /// Replaces the map by surfels in and around the next window.
  void fill(int count) {
    const Nuvg grid(camera_.intrinsics, camera_.config);
    const std::vector<Surfel> surfels = random_surfels(grid, pose_, count, 4, 2, random_);
    const std::vector<std::uint32_t> slots = map().replace(surfels, 1);
    book_ = {};
    for (const std::uint32_t slot : slots) note(slot, to_array(fixture_.access().packed(slot)));
    EXPECT_EQ(book_.surfels.size(), surfels.size()) << "a slot is used twice";
    for (std::size_t n = 0; n < surfels.size(); ++n) {
      const BlockKey block = block_of(surfels[n].position, kBlock);
      EXPECT_EQ(to_array(fixture_.access().packed(slots[n])), to_array(frontier_surfels::pack(surfels[n], block, kBlock)));
      EXPECT_TRUE(fixture_.access().block_of_slot(slots[n]) == block);
    }
  }

  void open_window(std::uint32_t frame) {
    frame_ = frame;
    fixture_.begin(random_image(camera_, Content::all_invalid, random_), pose_);
    cells_.clear();
    const MapWindow& window = map().window();
    for (int cell = 0; cell < window.cells(); ++cell)
      if (window.meets_grid(window.block(cell))) cells_.push_back(static_cast<cl_uint>(cell));
  }

  /// Inserts random surfels into a few cells of the window.
  /// @param leave  share of the surfels that leave the map, unless it is negative: after the new ones have been sorted early
  /// @param found  if not null, the frame goes ahead. @return whether the device has gone on
  bool insert(int count, int cells, double leave = -1, const Finding* found = nullptr) {
    std::vector<cl_uint> some;
    for (int n = 0; n < cells; ++n) some.push_back(cells_[random_.whole(0, static_cast<int>(cells_.size()) - 1)]);
    std::vector<cl_uint4> surfels;
    std::vector<cl_uint> where;
    for (int n = 0; n < count; ++n) {
      surfels.push_back({{random_.bits(), random_.bits(), random_.bits(), random_.bits()}});
      where.push_back(some[random_.whole(0, cells - 1)]);
    }
    Commands& commands = fixture_.commands();
    DeviceArray<cl_uint4> new_surfels(commands);
    DeviceArray<cl_uint> new_cells(commands);
    new_surfels.write(surfels);
    new_cells.write(where);
    bool goes_on = false;
    if (leave < 0) {
      map().reserve(count);
      map().insert("test", new_surfels, new_cells, count);
    } else {
      goes_on = insert_while_others_leave(new_surfels, new_cells, count, leave, found);
    }
    if (found != nullptr && found->fails) return goes_on;
    std::set<std::uint32_t> before;
    for (const auto& [slot, surfel] : book_.surfels) before.insert(slot);
    check_insertion(surfels, where, fixture_.access().find_slots(surfels, where, before));
    check_window();
    return goes_on;
  }

  /// Expects that the window lists every page of each cell that may be in the grid, once, in any order.
  void check_window() const {
    std::vector<std::uint32_t> expected;
    for (const cl_uint cell : cells_) {
      const BlockIndex::Pages* pages = fixture_.map().index().find(fixture_.map().window().block(static_cast<int>(cell)));
      if (pages != nullptr) expected.insert(expected.end(), pages->begin(), pages->end());
    }
    std::vector<std::uint32_t> actual = fixture_.access().window_pages();
    std::sort(actual.begin(), actual.end());
    std::sort(expected.begin(), expected.end());
    EXPECT_TRUE(actual == expected);
    std::size_t in_window = 0;
    for (const auto& [page, block] : book_.pages) in_window += std::count(expected.begin(), expected.end(), page);
    EXPECT_EQ(in_window, expected.size()) << "the window lists pages without surfels";
  }

  /// Removes each surfel of the map with a probability. @return slots of the removed surfels
  std::set<std::uint32_t> remove(double share) {
    std::vector<std::uint32_t> slots;
    for (const auto& [slot, surfel] : book_.surfels)
      if (random_.chance(share)) slots.push_back(slot);
    fixture_.access().kill(slots);
    for (const std::uint32_t slot : slots) book_.surfels.erase(slot);
    return {slots.begin(), slots.end()};
  }

  void finish() {
    map().finish_frame("test", frame_);
    fixture_.commands().wait();
    map().commit(frame_);
    if (!book_.pages.empty()) last_page_ = std::max(last_page_, book_.pages.rbegin()->first);
    std::set<std::uint32_t> full;
    for (const auto& [slot, surfel] : book_.surfels) full.insert(slot / PAGE_SLOTS);
    for (auto page = book_.pages.begin(); page != book_.pages.end();)
      page = full.count(page->first) ? std::next(page) : book_.pages.erase(page);
  }

  /// Expects that every slot of the map is as in the book.
  void expect_as_in_book() {
    const std::vector<Surfel> all = map().download();
    EXPECT_EQ(map().size(), book_.surfels.size());
    ASSERT_EQ(all.size(), book_.surfels.size());
    const std::size_t pages = all.empty() ? 0 : all.back().id / PAGE_SLOTS + 1;
    const std::vector<cl_uint4> packed_slots = fixture_.access().packed_of(pages);
    const std::vector<cl_int4> page_blocks = fixture_.access().blocks_of(pages);
    auto expected = book_.surfels.begin();
    for (std::size_t n = 0; n < all.size(); ++n, ++expected) {
      ASSERT_EQ(all[n].id, expected->first) << "the surfels are not ordered by slot";
      const cl_uint4& packed = packed_slots[all[n].id];
      ASSERT_EQ(to_array(packed), expected->second);
      const BlockKey block = book_.pages.at(all[n].id / PAGE_SLOTS);
      const cl_int4& at = page_blocks[all[n].id / PAGE_SLOTS];
      ASSERT_TRUE((BlockKey{at.s[0], at.s[1], at.s[2]} == block));
      Surfel surfel = frontier_surfels::unpack(packed, block, kBlock);
      surfel.id = all[n].id;
      EXPECT_TRUE(surfel.position == all[n].position && surfel.label == all[n].label && surfel.rgb == all[n].rgb);
    }
  }

  Random& random() { return random_; }
  std::uint32_t last_page() const { return last_page_; }  ///< highest page that was ever in use

 private:
  static constexpr double kBlock = 0.5;

  bool insert_while_others_leave(const DeviceArray<cl_uint4>& new_surfels, const DeviceArray<cl_uint>& new_cells, std::size_t count,
                                 double share, const Finding* found) {
    const std::vector<std::uint32_t> pages = fixture_.access().window_pages();
    std::vector<cl_ulong> words(pages.size() + 1, 0);
    std::vector<std::uint32_t> leaving;
    for (std::size_t n = 0; n < pages.size(); ++n)
      for (std::uint32_t bit = 0; bit < PAGE_SLOTS; ++bit)
        if (book_.surfels.count(PAGE_SLOTS * pages[n] + bit) != 0 && random_.chance(share)) {
          words[n] |= cl_ulong{1} << bit;
          leaving.push_back(PAGE_SLOTS * pages[n] + bit);
        }
    DeviceArray<cl_ulong> bits(fixture_.commands());
    bits.write(words);
    DeviceArray<cl_uint> length(fixture_.commands());
    length.write({static_cast<cl_uint>(count)});
    EXPECT_TRUE(map().sort_early("test", {new_cells, length(), count + 1, count}, bits));
    const bool goes_on = found != nullptr && go_ahead(*found, new_surfels, count, bits, leaving.size());
    if (found != nullptr && found->fails) {
      map().roll_back();
      return goes_on;
    }
    if (!goes_on) {
      fixture_.commands().wait();
      expect_as_in_book();
      map().reserve(count);
      remove_surfels(fixture_.commands(), bits, leaving.size(), map());
      map().insert_sorted("test", new_surfels, count);
    }
    for (const std::uint32_t slot : leaving) book_.surfels.erase(slot);
    return goes_on;
  }

  bool go_ahead(const Finding& found, const DeviceArray<cl_uint4>& new_surfels, std::size_t count, const DeviceArray<cl_ulong>& leaving,
                std::size_t leave) {
    Commands& commands = fixture_.commands();
    DeviceArray<cl_uint> evidence(commands), listed(commands), chosen(commands), counts(commands);
    evidence.write({found.evidence});
    listed.write({7, 7 + found.unlisted});
    chosen.write({static_cast<cl_uint>(count), static_cast<cl_uint>(count) + found.unchosen});
    counts.write({0, found.large, static_cast<cl_uint>(leave), found.labelled, 0});
    const bool is_ahead = map().go_ahead("test", {found.asks ? &evidence() : nullptr, listed(), chosen(), counts()});
    EXPECT_NE(is_ahead, commands.shape().is_near);
    if (!is_ahead) return false;
    remove_surfels(commands, leaving, 0, map());
    map().insert_ahead("test", new_surfels);
    commands.wait();
    const bool goes_on = counts.read_one(COUNT_GOES_ON) != 0;
    if (found.fails) return goes_on;  // before the host has told the map
    if (goes_on)
      map().went_on(leave, count);
    else
      map().stayed();
    return goes_on;
  }

  void note(std::uint32_t slot, const Packed& surfel) {
    EXPECT_TRUE(book_.surfels.emplace(slot, surfel).second) << "slot " << slot << " was not free";
    book_.pages[slot / PAGE_SLOTS] = fixture_.access().block_of_slot(slot);
  }

  /// Expects that each block's new surfels take, in order, the free slots of its pages, lowest first, and then the slots of new pages.
  void check_insertion(const std::vector<cl_uint4>& surfels, const std::vector<cl_uint>& where, const std::vector<cl_uint>& slots) {
    std::map<cl_uint, std::vector<std::size_t>> by_cell;
    for (std::size_t n = 0; n < where.size(); ++n) by_cell[where[n]].push_back(n);
    Book after = book_;
    for (const auto& [cell, numbers] : by_cell) {
      const BlockKey block = map().window().block(static_cast<int>(cell));
      std::size_t free = 0, fresh = 0;
      for (const auto& [page, of] : book_.pages)
        if (of == block) free += book_.free_slots(page).size();
      std::uint32_t page = ~0U;
      std::vector<std::uint32_t> left;
      for (const std::size_t n : numbers) {
        if (left.empty() || slots[n] / PAGE_SLOTS != page) {
          EXPECT_TRUE(left.empty()) << "free slots are left in page " << page;
          page = slots[n] / PAGE_SLOTS;
          const auto known = book_.pages.find(page);
          if (known == book_.pages.end()) {
            fresh += PAGE_SLOTS;
            EXPECT_TRUE(after.pages.emplace(page, block).second) << "page " << page << " is used twice";
          } else {
            EXPECT_EQ(fresh, 0u) << "new pages come last";
            EXPECT_TRUE(known->second == block) << "page " << page << " is another block's";
          }
          left = book_.free_slots(page);
        }
        ASSERT_FALSE(left.empty());
        EXPECT_EQ(slots[n], left.front());
        left.erase(left.begin());
        after.surfels[slots[n]] = to_array(surfels[n]);
      }
      const std::size_t missing = numbers.size() > free ? numbers.size() - free : 0;
      EXPECT_EQ(fresh, (missing + PAGE_SLOTS - 1) / PAGE_SLOTS * PAGE_SLOTS);
    }
    EXPECT_EQ(after.surfels.size(), book_.surfels.size() + surfels.size());
    book_ = after;
  }

  CameraSetup camera_ = make_camera(33, 17, 22.7, 20.1, 64);
  Random random_;
  Eigen::Isometry3d pose_ = Random(9).pose(2, 3);
  FrameFixture fixture_;
  Book book_;
  std::vector<cl_uint> cells_;  ///< cells whose surfels may be in the grid
  std::uint32_t frame_ = 0, last_page_ = 0;
};

}  // namespace frontier_surfels::reference
