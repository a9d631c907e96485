/// Access to the fields and lists between the stages, so that each one can be tested alone.
#pragma once

#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "frame/recent_views.hpp"
#include "map/surfel_map.hpp"
#include "opencl/commands.hpp"
#include "random_input.hpp"
#include "reference_field.hpp"
#include "stages/stages.hpp"

namespace frontier_surfels {

/// The OpenCL platform to test on, part of its name; empty: the first.
inline std::string test_platform() {
  const char* platform = std::getenv("FRONTIER_SURFELS_TEST_PLATFORM");
  return platform == nullptr ? "" : platform;
}

/// Which device to test on, and at which width: FRONTIER_SURFELS_TEST_LANES is 16 or 1; without it the width is the device's own.
inline Config test_config() {
  Config config;
  config.platform = test_platform();
  const char* lanes = std::getenv("FRONTIER_SURFELS_TEST_LANES");
  if (lanes != nullptr) set_field(config, "lanes", lanes);
  return config;
}

inline Device test_device() { return choose_device(test_config()); }

/// Built once a program: compiling the kernels takes longer than most tests. Never destroyed: at the program's end a driver may be gone
/// before it.
inline Commands& test_commands() {
  static auto* const commands = new Commands(test_device());
  return *commands;
}

/// The same with one thread; null where the device cannot be limited to that.
inline std::unique_ptr<Commands> one_thread_commands() {
  const auto parts = test_commands().device().device.getInfo<CL_DEVICE_PARTITION_PROPERTIES>();
  if (std::find(parts.begin(), parts.end(), CL_DEVICE_PARTITION_BY_COUNTS) == parts.end()) return nullptr;
  Config one = test_config();
  one.threads = 1;
  return std::make_unique<Commands>(choose_device(one));
}

/// The stages with one camera and everything that they work on.
class StagesProbe {
 public:
  explicit StagesProbe(const Config& config, Commands& commands = test_commands())
      : commands_(commands),
        lists_(commands),
        map_(commands, lists_, config),
        views_(commands, config),
        stages_(commands, lists_, config, map_, views_) {
    views_.clear(false);  // as if views had been forgotten: the known space must be computed
  }

  Stages& stages() { return stages_; }
  Lists& lists() { return lists_; }
  SurfelMap& map() { return map_; }
  const SurfelMap& map() const { return map_; }
  RecentViews& views() { return views_; }
  Commands& commands() { return commands_; }

  const Grid& grid() const { return stages_.grid_; }
  const Limits& limits() const { return stages_.limits_; }
  std::vector<float> layer_depth() const { return stages_.layer_depth_.read(grid().size_k); }

  using Bits = reference::Field<char>;
  Bits observed() const { return read_bits(stages_.observed_); }
  Bits known() const { return read_bits(stages_.known_); }
  Bits filtered() const { return read_bits(stages_.filtered_); }
  Bits candidates() const { return by_rows(stages_.candidates_.read(stages_.candidate_words())); }
  void set_observed(const Bits& bits) { stages_.observed_.write(reference::pack(bits)); }
  void set_known(const Bits& bits) { stages_.known_.write(reference::pack(bits)); }
  void set_filtered(const Bits& bits) { stages_.filtered_.write(reference::pack(bits)); }
  void set_candidates(const Bits& bits) {
    const std::vector<std::uint64_t> rows = reference::pack(bits);
    std::vector<std::uint64_t> words(stages_.candidate_words(), 0);
    for_each_candidate_word([&](std::size_t word, std::size_t tile_word) { words[tile_word] = rows[word]; });
    stages_.candidates_.write(words);
  }

  /// @param family  0, 1, 2: paths along i, j, k; @param event  EVENT_ENTER_FORWARD and so on
  Bits event(int family, int event) const { return read_bits(stages_.events_, (family * EVENT_PLANES + event) * stages_.words()); }
  void set_event(int family, int event, const Bits& bits) {
    stages_.events_.write(reference::pack(bits), (family * EVENT_PLANES + event) * stages_.words());
  }

  /// States of the paths that enter through a face: [size_j][1][size_k] of the i faces, [size_i][1][size_k] of the j faces, and
  /// [size_j][1][size_i] of the k faces.
  std::vector<Bits> hull() const {
    const int i = grid().size_i, j = grid().size_j, k = grid().size_k;
    std::vector<Bits> faces;
    std::size_t at = 0;
    for (int face = FACE_I_LOW; face <= FACE_K_HIGH; ++face) {
      const bool along_k = face >= FACE_K_LOW;
      const int rows = face == FACE_J_LOW || face == FACE_J_HIGH ? i : j, columns = along_k ? i : k;
      const std::size_t words = along_k ? columns : grid().words_k;
      faces.push_back(unpack_face(stages_.hull_.read(rows * words, at), rows, columns, along_k));
      at += rows * words;
    }
    return faces;
  }

  void set_hull(const std::vector<Bits>& faces) {
    std::vector<std::uint64_t> hull;
    for (int face = FACE_I_LOW; face <= FACE_K_HIGH; ++face) {
      const Bits& bits = faces[face];
      const std::size_t words = face >= FACE_K_LOW ? bits.size_k : (bits.size_k + 63) / 64;
      for (int row = 0; row < bits.size_i; ++row) {
        std::vector<std::uint64_t> line(words, 0);
        for (int column = 0; column < bits.size_k; ++column) {
          if (!bits(row, 0, column)) continue;
          line[face >= FACE_K_LOW ? column : column / 64] |= face >= FACE_K_LOW ? 1 : std::uint64_t{1} << (column % 64);
        }
        hull.insert(hull.end(), line.begin(), line.end());
      }
    }
    stages_.hull_.write(hull);
  }

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

  /// Of the first pages: all slots, and the block of each page.
  std::vector<cl_uint4> packed_of(std::size_t pages) const { return peek_all<cl_uint4>(map_.surfels(), PAGE_SLOTS * pages); }
  std::vector<cl_int4> blocks_of(std::size_t pages) const { return peek_all<cl_int4>(map_.page_block(), pages); }

  cl_uint4 packed(std::uint32_t slot) const { return peek<cl_uint4>(map_.surfels(), slot); }
  std::uint32_t attributes(std::uint32_t slot) const { return packed(slot).s[3]; }
  bool is_alive(std::uint32_t slot) const { return peek<cl_ulong>(map_.alive(), slot / PAGE_SLOTS) >> slot % PAGE_SLOTS & 1; }
  BlockKey block_of_slot(std::uint32_t slot) const {
    const auto block = peek<cl_int4>(map_.page_block(), slot / PAGE_SLOTS);
    return {block.s[0], block.s[1], block.s[2]};
  }

  void make_ragged(const std::vector<std::uint32_t>& slots) {
    for (const std::uint32_t slot : slots) poke(map_.surfels(), 4 * std::size_t{slot} + 3, cl_uint{attributes(slot) | SURFEL_RAGGED});
  }

  /// Lets section 4 work on all paths through the voxels around these candidates, no more. Replaces the candidates.
  void need_paths_around(const Bits& candidates) {
    set_candidates(candidates);
    stages_.settle_by_recent_views();
  }
  void need_all_paths() { need_paths_around(Bits(grid(), 1)); }

  /// Paths to be walked: along i [size_j][1][size_k], along j [size_i][1][size_k], along k [size_j][1][size_i].
  std::vector<Bits> needed_paths() const {
    const int i = grid().size_i, j = grid().size_j, k = grid().size_k;
    const std::vector<std::uint32_t> lines = stages_.lines_.read(stages_.line_numbers());
    std::vector<Bits> paths = {Bits(j, 1, k, 0), Bits(i, 1, k, 0), Bits(j, 1, i, 0)};
    auto next = lines.begin();
    for (Bits* along : {&paths[0], &paths[1]})
      for (int row = 0; row < along->size_i; ++row)
        for (int half = 0; half < 2 * grid().words_k; ++half, ++next)
          for (int bit = 0; bit < 32 && 32 * half + bit < k; ++bit) (*along)(row, 0, 32 * half + bit) = *next >> bit & 1;
    for (char& path : paths[2].values) path = *next++ != 0;
    return paths;
  }

  /// The window's pages, as the kernels that go through them number them; and a word for each, a bit a slot.
  std::vector<std::uint32_t> window_pages() const {
    std::vector<std::uint32_t> pages(map_.window_pages());
    if (!pages.empty()) commands_.queue().enqueueReadBuffer(map_.pages(), CL_TRUE, 0, pages.size() * sizeof(cl_uint), pages.data());
    return pages;
  }
  std::vector<std::uint64_t> in_view_words() const { return stages_.in_view_bits_.read(map_.window_pages()); }
  std::vector<std::uint64_t> large_words() const { return stages_.large_bits_.read(map_.window_pages()); }
  std::vector<std::uint64_t> removed_words() const { return stages_.removed_bits_.read(map_.window_pages()); }
  void set_removed_words(const std::vector<std::uint64_t>& words) {
    stages_.removed_bits_.resize(words.size() + 1);
    stages_.removed_bits_.write(words);
    stages_.removed_ = 0;
    for (const std::uint64_t word : words) stages_.removed_ += __builtin_popcountll(word);
  }
  std::uint64_t alive_word(std::uint32_t page) const { return peek<cl_ulong>(map_.alive(), page); }

  /// Slots that such words say, page after page.
  std::vector<std::uint32_t> slots_of(const std::vector<std::uint64_t>& words) const {
    std::vector<std::uint32_t> slots;
    const std::vector<std::uint32_t> pages = window_pages();
    for (std::size_t n = 0; n < words.size(); ++n)
      for (std::uint32_t bit = 0; bit < PAGE_SLOTS; ++bit)
        if (words[n] >> bit & 1) slots.push_back(PAGE_SLOTS * pages[n] + bit);
    return slots;
  }
  std::vector<std::uint32_t> in_view_slots() const { return slots_of(in_view_words()); }
  std::vector<std::uint32_t> large_slots() const { return slots_of(large_words()); }

  /// Surfels in view as the grid sees them, in the order of in_view_slots().
  std::vector<ViewSurfel> place_surfels() {
    stages_.place_surfels();
    return view_surfels();
  }
  std::vector<ViewSurfel> view_surfels() const { return stages_.view_surfels_.read(stages_.in_view_); }

  /// What was last put into the map, in its order, and the cell of the window for each.
  std::vector<cl_uint4> new_surfels(std::size_t count) const { return stages_.new_surfels_.read(count); }
  std::vector<cl_uint> new_cells(std::size_t count) const { return stages_.new_cells_.read(count); }

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

  void list_candidates() { stages_.list_candidates(); }
  /// Voxels of the new surfels, 64 word + bit each.
  std::vector<std::uint32_t> created_voxels() const {
    const std::vector<std::uint32_t> listed = stages_.listed_voxels_.read(stages_.listed_count_);
    std::vector<std::uint32_t> voxels;
    for (const int number : stages_.created_.read(stages_.created_count_)) voxels.push_back(listed[number]);
    return voxels;
  }
  Bits created() const {
    std::vector<std::uint64_t> words(stages_.candidate_words(), 0);
    for (const std::uint32_t voxel : created_voxels()) words[voxel / 64] |= std::uint64_t{1} << voxel % 64;
    return by_rows(words);
  }

  /// @return prefix sums, the total behind them
  std::vector<std::uint32_t> scan(const std::vector<std::uint32_t>& values, std::uint32_t* total) {
    DeviceArray<cl_uint> array(commands_);
    array.resize(values.size() + 1);
    array.write(values);
    *total = lists_.scan("test", array, values.size());
    return array.read(values.empty() ? 0 : values.size() + 1);
  }

  std::vector<std::uint32_t> list_bits(const std::vector<std::uint64_t>& words) {
    DeviceArray<cl_ulong> bits(commands_);
    DeviceArray<cl_uint> list(commands_);
    bits.write(words);
    return list.read(lists_.list_bits("test", bits, words.size(), list));
  }

 private:
  Bits read_bits(const DeviceArray<cl_ulong>& array, std::size_t offset = 0) const {
    return reference::unpack(array.read(stages_.words(), offset), grid().size_i, grid().size_j, grid().size_k);
  }

  /// Calls visit(number of a word in the order of the other bit fields, its number among the candidates', tile by tile).
  template <typename Visit>
  void for_each_candidate_word(Visit visit) const {
    const int tiles_i = (grid().size_i + VIEW_TILE - 1) / VIEW_TILE;
    std::size_t word = 0;
    for (int j = 0; j < grid().size_j; ++j)
      for (int w = 0; w < grid().words_k; ++w)
        for (int i = 0; i < grid().size_i; ++i, ++word)
          visit(word,
                (((j / VIEW_TILE * grid().words_k + w) * tiles_i + i / VIEW_TILE) * VIEW_TILE + j % VIEW_TILE) * VIEW_TILE + i % VIEW_TILE);
  }

  /// Candidates; there are none beyond the grid.
  Bits by_rows(const std::vector<std::uint64_t>& tile_words) const {
    std::vector<std::uint64_t> words(stages_.words(), 0);
    std::size_t bits = 0, bits_inside = 0;
    for (const std::uint64_t word : tile_words) bits += __builtin_popcountll(word);
    for_each_candidate_word([&](std::size_t word, std::size_t tile_word) {
      words[word] = tile_words[tile_word];
      bits_inside += __builtin_popcountll(words[word]);
    });
    EXPECT_EQ(bits_inside, bits) << "candidates beyond the grid";
    return reference::unpack(words, grid().size_i, grid().size_j, grid().size_k);
  }

  static Bits unpack_face(const std::vector<std::uint64_t>& words, int rows, int columns, bool word_each) {
    const std::size_t words_row = words.size() / rows;
    Bits bits(rows, 1, columns, 0);
    for (int row = 0; row < rows; ++row)
      for (int column = 0; column < columns; ++column)
        bits(row, 0, column) = word_each ? words[row * words_row + column] != 0 : words[row * words_row + column / 64] >> (column % 64) & 1;
    return bits;
  }

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
  Lists lists_;
  SurfelMap map_;
  RecentViews views_;
  Stages stages_;
};

}  // namespace frontier_surfels
