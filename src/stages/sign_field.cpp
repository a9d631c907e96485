#include "stages/sign_field.hpp"

#include <algorithm>

namespace frontier_surfels {
namespace {

constexpr const char* kStage = "sign_field";

std::size_t sign_field_tiles(const Grid& g) {
  const auto up = [](int size, int tile) { return static_cast<std::size_t>((size + tile - 1) / tile); };
  return up(g.size_i, TILE_I) * up(g.size_j, TILE_J) * g.words_k * (64 / TILE_K);
}

}  // namespace

ViewSurfels::ViewSurfels(Commands& commands, Lists& lists) : commands_(commands), lists_(lists), slots_(commands), surfels_(commands) {}

void ViewSurfels::place(const Frame& frame, const BitField& in_view, const SurfelMap& map) {
  const std::uint32_t count = lists_.list_bits(kStage, in_view, map.window_pages(), slots_);
  count_ = count;
  surfels_.resize(std::max<std::size_t>(count_, 1));  // the sign field is computed without surfels, too
  commands_.run(kStage, "to_slots", count_, kGroup, map.pages(), slots_(), count);
  commands_.run(kStage, "place_surfels", commands_.chunks(count_), kGroup, frame, map.page_block(), map.surfels(), slots_(), count,
                surfels_());
}

SignField::SignField(Commands& commands, Lists& lists)
    : commands_(commands), lists_(lists), tile_begin_(commands), tile_cursor_(commands), tile_surfels_(commands), events_(commands) {}

void SignField::compute(const Frame& frame, const NeededPaths& needed, const ViewSurfels& surfels) {
  const std::size_t tiles = sign_field_tiles(frame.grid), group = commands_.shape().heavy_group;
  events_.allocate(size(frame.grid));
  list_by_tiles(frame, surfels, tiles);
  commands_.run(kStage, "sign_field", tiles * group, group, frame, needed.lines()(), surfels.surfels()(), tile_begin_(), tile_surfels_(),
                events_());
}

void SignField::list_by_tiles(const Frame& frame, const ViewSurfels& surfels, std::size_t tiles) {
  const auto count = static_cast<cl_uint>(surfels.count());
  tile_begin_.resize(tiles + 1);
  tile_cursor_.resize(tiles + 1);
  tile_begin_.fill(kStage, 0, tiles + 1);
  commands_.run(kStage, "count_tiles", count, kGroup, frame, surfels.surfels()(), count, tile_begin_());
  tile_surfels_.resize(std::max<std::size_t>(lists_.scan(kStage, tile_begin_, tiles), 1));
  commands_.queue(Call::kCopy).enqueueCopyBuffer(tile_begin_(), tile_cursor_(), 0, 0, (tiles + 1) * sizeof(cl_uint));
  commands_.run(kStage, "fill_tiles", count, kGroup, frame, surfels.surfels()(), count, tile_cursor_(), tile_surfels_());
}

}  // namespace frontier_surfels
