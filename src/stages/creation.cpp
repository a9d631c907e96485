#include "stages/creation.hpp"

namespace frontier_surfels {
namespace {

constexpr const char* kStage = "creation";

}  // namespace

Creation::Creation(Commands& commands, Lists& lists)
    : commands_(commands), lists_(lists), kept_(commands), chosen_(commands), new_(commands) {}

void Creation::filter(const Frame& frame, const CandidateList& list, const Candidates& candidates, const BitField* known) {
  const std::size_t words = (list.voxels().room() + 63) / 64;
  kept_.resize(words + 1);
  const BitField& known_or_any = known != nullptr ? *known : candidates.bits();  // a kernel takes no missing buffer
  if (commands_.lanes() == 1) kept_.fill(kStage, 0, words);                      // work items share words then
  commands_.run(kStage, "filter_candidates", 64 / commands_.lanes() * words, commands_.shape().heavy_group, frame, list.voxels()(),
                list.voxels().length(), static_cast<cl_int>(words), list.directions()(), candidates.bits()(),
                static_cast<cl_int>(known != nullptr), known_or_any(), kept_());
  lists_.list_bits(kStage, kept_, words, chosen_);
}

void Creation::create(const Frame& frame, const Camera& camera, const RecentViews& views, const SeenPoints& seen, const SeenPoints& taken,
                      const ViewSettling& settling, const CandidateList& list, const BitField& leaving, SurfelMap& map) {
  const std::size_t chunks = commands_.chunks(chosen_.room()), team = commands_.shape().team(chunks);
  new_.resize(chosen_.room());
  commands_.run(kStage, "create_surfels", chunks * team, commands_.shape().heavy_group, frame, views.views(), settling.tile_views()(),
                static_cast<cl_int>(views.view_groups()), views.depths(), camera.layer_depth()(), seen.slots(), seen.tables(),
                seen.brick_words(), taken.slots(), taken.tables(), taken.brick_words(), settling.tile_seen()(), chosen_(), chosen_.length(),
                list.voxels()(), list.around()(), list.directions()(), static_cast<cl_int>(team), new_.surfels(), new_.cells());
  is_sorted_ = map.sort_early(kStage, {new_.cells, chosen_.length(), chosen_.room(), chosen_.count()}, leaving);
}

void Creation::insert(SurfelMap& map) const {
  if (map.is_ahead())
    map.insert_ahead(kStage, new_.surfels);
  else if (is_sorted_)
    map.insert_sorted(kStage, new_.surfels, chosen_.count());
  else
    map.insert(kStage, new_.surfels, new_.cells, chosen_.count());
}

}  // namespace frontier_surfels
