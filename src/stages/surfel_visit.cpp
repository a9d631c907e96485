#include "stages/surfel_visit.hpp"

namespace frontier_surfels {

SurfelVisit::SurfelVisit(Commands& commands) : commands_(commands), in_view_(commands), large_(commands), removed_(commands) {}

void SurfelVisit::visit(const Frame& frame, const Camera& camera, const BitField& observed, const DeviceArray<cl_int>& column_end,
                        const RecentViews& views, const SeenPoints& taken, const SurfelMap& map, Candidates& candidates) {
  const std::size_t pages = map.window_pages();
  for (BitField* bits : {&in_view_, &large_, &removed_}) bits->resize(pages + 1);
  commands_.run("in_view", "visit_surfels", PAGE_SLOTS / commands_.lanes() * pages, PAGE_GROUP, frame, views.depths(), camera.depth()(),
                column_end(), map.pages(), static_cast<cl_uint>(pages), map.alive(), map.page_block(), map.surfels(), observed(),
                taken.slots(), taken.tables(), taken.brick_words(), candidates.bits()(), map.changed(), in_view_(), large_(), removed_(),
                candidates.visit_counts()());
}

SurfelVisit::Found SurfelVisit::read_found(Candidates& candidates, SurfelMap& map) {
  const std::vector<cl_uint> counts = candidates.visit_counts().read(COUNTS);
  map.marked(counts[COUNT_LABELLED]);
  return {counts[COUNT_IN_VIEW], counts[COUNT_LARGE], counts[COUNT_REMOVED], counts[COUNT_GOES_ON] != 0};
}

}  // namespace frontier_surfels
