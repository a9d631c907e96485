#include "stages/creation.hpp"

namespace frontier_surfels {

Creation::Creation(Commands& commands, Lists& lists)
    : commands_(commands), lists_(lists), kept_(commands), chosen_(commands), new_(commands) {}

std::size_t Creation::filter(const Frame& frame, const CandidateList& list, const Candidates& candidates, const BitField* known) {
  const char* stage = "creation";
  const std::size_t words = (list.count() + 63) / 64;
  kept_.resize(words + 1);
  const BitField& known_or_any = known != nullptr ? *known : candidates.bits();  // a kernel takes no missing buffer
  if (commands_.lanes() == 1) kept_.fill(stage, 0, words);                       // work items share words then
  commands_.run(stage, "filter_candidates", 64 / commands_.lanes() * words, commands_.shape().heavy_group, frame, list.voxels()(),
                static_cast<cl_int>(list.count()), list.directions()(), candidates.bits()(), static_cast<cl_int>(known != nullptr),
                known_or_any(), kept_());
  count_ = lists_.list_bits(stage, kept_, words, chosen_);
  new_.resize(count_);
  return count_;
}

void Creation::create(const Frame& frame, const Camera& camera, const RecentViews& views, const SeenPoints& seen, const SeenPoints& taken,
                      const ViewSettling& settling, const CandidateList& list, SurfelMap& map) {
  const char* stage = "creation";
  commands_.run(stage, "create_surfels", commands_.chunks(count_), commands_.shape().heavy_group, frame, views.views(),
                settling.tile_views()(), static_cast<cl_int>(views.view_groups()), views.depths(), camera.layer_depth()(), seen.slots(),
                seen.tables(), seen.brick_words(), taken.slots(), taken.tables(), taken.brick_words(), settling.tile_seen()(), chosen_(),
                static_cast<cl_int>(count_), list.voxels()(), list.around()(), list.directions()(), new_.surfels(), new_.cells());
  map.insert(stage, new_.surfels, new_.cells, count_);
}

}  // namespace frontier_surfels
