/// What a frame has before its stages run: a camera, a map and kept views. Tests make the stages they need themselves.
#pragma once

#include <limits>

#include "frame/camera.hpp"
#include "frame/limits.hpp"
#include "frame/recent_views.hpp"
#include "map_access.hpp"
#include "opencl/lists.hpp"
#include "random_input.hpp"
#include "reference_field.hpp"
#include "stages/candidates.hpp"
#include "stages/frame.hpp"
#include "test_device.hpp"

namespace frontier_surfels {

class FrameFixture {
 public:
  explicit FrameFixture(const Config& config, Commands& commands = test_commands())
      : commands_(commands),
        limits_(make_limits(config)),
        lists_(commands),
        map_(commands, lists_, config),
        seen_(commands, map_.block_size()),
        taken_(commands, map_.block_size()),
        views_(commands, config),
        cameras_(commands, config),
        access_(commands, map_) {
    views_.clear(false);  // as if views had been forgotten, so that known space must be computed
  }

  /// Begins a frame, as Mapper does.
  const Frame& begin(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera) {
    camera_ = &cameras_.find(image.intrinsics);
    map_.log_changes({std::numeric_limits<std::uint64_t>::max()}, 0);  // of this frame alone
    map_.open_window(camera_->grid(), T_world_camera);
    seen_.open_window(map_.window());
    taken_.open_window(map_.window());
    camera_->set_image(std::make_shared<const WorkingImage>(image));
    views_.set_current(image, T_world_camera);
    frame_ = make_frame(*camera_, map_.window(), views_, &seen_, limits_);
    return frame_;
  }

  const Frame& frame() const { return frame_; }
  const Camera& camera() const { return *camera_; }
  const Grid& grid() const { return frame_.grid; }
  const Limits& limits() const { return limits_; }
  Commands& commands() { return commands_; }
  Lists& lists() { return lists_; }
  SurfelMap& map() { return map_; }
  const SurfelMap& map() const { return map_; }
  SeenPoints& seen() { return seen_; }
  SeenPoints& taken() { return taken_; }  ///< empty, unless a test fills it

  /// Ends the frame. @return what it has changed
  Changes finish(std::uint32_t frame) {
    map_.finish_frame("test", frame);
    commands_.wait();
    map_.commit(frame);
    return map_.changes(frame - 1);
  }

  /// Makes lists until all entries have room. @param make  makes them. @return number of times that this took
  template <typename Make>
  int list_all(Make make, const std::vector<DeviceList*>& lists) {
    for (int times = 1;; ++times) {
      make();
      for (DeviceList* list : lists) list->read_length_later();
      commands_.wait();
      bool whole = true;
      for (DeviceList* list : lists) {
        whole = list->is_whole() && whole;
        list->note_length();
      }
      if (whole) return times;
    }
  }

  RecentViews& views() { return views_; }
  MapAccess& access() { return access_; }
  const MapAccess& access() const { return access_; }
  std::vector<float> layer_depth() const { return camera_->layer_depth().read(grid().size_k); }

  using Bits = reference::Field<char>;

  /// @param offset  number of words before the field
  Bits read(const BitField& field, std::size_t offset = 0) const {
    return reference::unpack(field.read(words(grid()), offset), grid().size_i, grid().size_j, grid().size_k);
  }
  void write(BitField& field, const Bits& bits, std::size_t offset = 0) const {
    field.grow(offset + words(grid()) + SPARE_WORDS, offset);
    field.write(reference::pack(bits), offset);
  }

  Bits read(const Candidates& candidates) const { return read_tile_words(candidates.bits().read(Candidates::words(grid()))); }
  void write(Candidates& candidates, const Bits& bits) const {
    const std::vector<std::uint64_t> rows = reference::pack(bits);
    std::vector<std::uint64_t> words(Candidates::words(grid()), 0);
    for_each_candidate_word([&](std::size_t word, std::size_t tile_word) { words[tile_word] = rows[word]; });
    candidates.bits().write(words);
  }

  /// Bits of candidate words, which are ordered tile by tile. Expects no candidate beyond the grid.
  Bits read_tile_words(const std::vector<std::uint64_t>& tile_words) const {
    std::vector<std::uint64_t> words(frontier_surfels::words(grid()), 0);
    std::size_t bits = 0, bits_inside = 0;
    for (const std::uint64_t word : tile_words) bits += __builtin_popcountll(word);
    for_each_candidate_word([&](std::size_t word, std::size_t tile_word) {
      words[word] = tile_words[tile_word];
      bits_inside += __builtin_popcountll(words[word]);
    });
    EXPECT_EQ(bits_inside, bits) << "candidates beyond the grid";
    return reference::unpack(words, grid().size_i, grid().size_j, grid().size_k);
  }

 private:
  /// Calls visit(index, tile_index) for every word: its index in ordinary bit fields, and in the candidates' order, tile by tile.
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

  Commands& commands_;
  const Limits limits_;
  Lists lists_;
  SurfelMap map_;
  SeenPoints seen_, taken_;
  RecentViews views_;
  Cameras cameras_;
  MapAccess access_;
  Camera* camera_ = nullptr;
  Frame frame_ = {};
};

}  // namespace frontier_surfels
