#include "stages/view_settling.hpp"

#include <algorithm>

namespace frontier_surfels {

void ViewSettling::settle(const Frame& frame, const Camera& camera, RecentViews& views, const SeenPoints& seen, const SeenPoints& taken,
                          Candidates& candidates) {
  const int count = views.prepare();
  const std::size_t columns = tile_columns(frame.grid), group = commands_.shape().tile_group;
  const std::size_t groups = commands_.shape().many_items ? columns * WORD_TILES : columns;
  tile_views_.resize(std::max<std::size_t>(columns * WORD_TILES * views.view_groups(), 1));  // kernels take no empty buffer
  tile_seen_.resize(columns * WORD_TILES);
  if (count == 0 && seen.empty()) return;
  commands_.run("recent_views", "settle_candidates", groups * group, group, frame, views.views(), views.view_lanes(),
                static_cast<cl_int>(count), views.depths(), camera.layer_depth()(), seen.slots(), seen.tables(), seen.brick_words(),
                taken.slots(), taken.tables(), taken.brick_words(), tile_views_(), tile_seen_(), candidates.visit_counts()(),
                candidates.bits()());
}

}  // namespace frontier_surfels
