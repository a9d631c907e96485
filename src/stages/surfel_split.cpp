#include "stages/surfel_split.hpp"

namespace frontier_surfels {

SurfelSplit::SurfelSplit(Commands& commands, Lists& lists)
    : commands_(commands), lists_(lists), parents_(commands), offsets_(commands), children_(commands) {}

std::size_t SurfelSplit::split(const Frame& frame, const BitField& large, SurfelMap& map) {
  const char* stage = "split";
  const std::uint32_t parents = lists_.list_bits(stage, large, map.window_pages(), parents_);
  commands_.run(stage, "to_slots", parents, kGroup, map.pages(), parents_(), parents);
  offsets_.resize(parents + 1);
  commands_.run(stage, "count_children", commands_.chunks(parents), kGroup, frame, map.page_block(), map.surfels(), parents_(), parents,
                offsets_());
  const std::uint32_t children = lists_.scan(stage, offsets_, parents);
  map.reserve(children);
  children_.resize(children);
  map.back_up(stage, large, parents);
  commands_.run(stage, "split", commands_.chunks(parents), kGroup, frame, map.page_block(), map.surfels(), parents_(), parents, offsets_(),
                children_.surfels(), children_.cells(), map.alive(), map.changed());
  map.removed(parents);
  map.insert(stage, children_.surfels, children_.cells, children);
  return children - parents;
}

}  // namespace frontier_surfels
