#include "stages/thin_gaps.hpp"

namespace frontier_surfels {

void close_thin_gaps(Commands& commands, const Frame& frame, const Camera& camera, const DeviceArray<cl_int>& column_end,
                     const RecentViews& views, const DeviceArray<cl_ushort>& tile_views, const SeenPoints& taken, const CandidateList& list,
                     Candidates& candidates) {
  if (!(frame.limits.min_gap > 0)) return;
  const std::size_t chunks = commands.chunks(list.voxels().room()), team = commands.shape().team(chunks);
  commands.run("thin_gaps", "close_gaps", chunks * team, commands.shape().heavy_group, frame, views.views(), tile_views(),
               static_cast<cl_int>(views.view_groups()), views.depths(), camera.layer_depth()(), camera.depth()(), column_end(),
               taken.slots(), taken.tables(), taken.brick_words(), list.voxels()(), list.voxels().length(), list.directions()(),
               static_cast<cl_int>(team), candidates.bits()());
}

}  // namespace frontier_surfels
