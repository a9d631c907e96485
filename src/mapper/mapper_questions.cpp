// What planners ask: the states of points, rays, boxes and paths, and the boundary near points. Questions change nothing.
#include <algorithm>

#include "map/view_blocks.hpp"
#include "mapper/mapper_impl.hpp"
#include "planner/box_states.hpp"
#include "planner/ray_states.hpp"

namespace frontier_surfels {
namespace {

constexpr double kFarAway = 1e9;  // [m] nothing is mapped there: positions become floats

std::vector<float> clearance_of(const std::vector<SpaceState>& states, const std::vector<NearestBoundary>& nearest, double most) {
  std::vector<float> clearance(states.size(), 0.0F);
  for (std::size_t n = 0; n < states.size(); ++n)
    if (states[n] == SpaceState::kFree) clearance[n] = std::min(nearest[n].distance, static_cast<float>(most));
  return clearance;
}

}  // namespace

std::vector<SpaceState> Mapper::states(const std::vector<Eigen::Vector3f>& points_world) const {
  return on_device(impl_->commands, [&] { return impl_->states(points_world); });
}

std::vector<SpaceState> Mapper::Impl::states(const std::vector<Eigen::Vector3f>& points_world) {
  begin_call();
  remember_forgotten();
  return point_states.find(points_world, {views, seen, taking_back, map, config.seen_points});
}

std::vector<RayState> Mapper::ray_states(const std::vector<Ray>& rays_world, bool stop_at_unknown, double step) const {
  return frontier_surfels::ray_states(rays_world, stop_at_unknown, step, [this](const auto& points_world) { return states(points_world); });
}

std::vector<NearestBoundary> Mapper::nearest_boundaries(const std::vector<Eigen::Vector3f>& points_world, double reach) const {
  return on_device(impl_->commands, [&] {
    impl_->begin_call();
    return impl_->boundaries.nearest(points_world, reach, impl_->map);
  });
}

std::vector<float> Mapper::clearance(const std::vector<Eigen::Vector3f>& points_world, double most) const {
  const std::vector<NearestBoundary> nearest = nearest_boundaries(points_world, most);
  return clearance_of(states(points_world), nearest, most);
}

std::vector<SpaceState> Mapper::box_states(const std::vector<Eigen::AlignedBox3f>& boxes_world, double step) const {
  return frontier_surfels::box_states(
      boxes_world, step, [this](const auto& points_world) { return states(points_world); },
      [this](const auto& boxes, bool frontier_counts) {
        return on_device(impl_->commands, [&] { return impl_->first_within(boxes, frontier_counts); });
      });
}

std::vector<RayState> Mapper::path_states(const std::vector<Ray>& paths_world, const Eigen::Vector3f& box_size, bool stop_at_unknown,
                                          double step) const {
  return frontier_surfels::path_states(
      paths_world, box_size, stop_at_unknown, step, [this](const auto& points_world) { return states(points_world); },
      [this](const auto& boxes, bool frontier_counts) {
        return on_device(impl_->commands, [&] { return impl_->first_within(boxes, frontier_counts); });
      });
}

std::vector<FirstSurfel> Mapper::Impl::first_within(const std::vector<MovingBox>& boxes, bool frontier_counts) {
  begin_call();
  return boundaries.first_within(boxes, frontier_counts, map);
}

StateChanges Mapper::state_changes(std::uint64_t since, double resolution) const {
  return on_device(impl_->commands, [&] { return impl_->state_changes(since, resolution); });
}

StateChanges Mapper::Impl::state_changes(std::uint64_t since, double resolution) {
  const StateGrid checked_resolution(resolution);
  begin_call();
  remember_forgotten();
  const bool is_part = looked_at.knows(since) && since <= sequence;
  StateChanges changes = {sequence, is_part ? since : 0, resolution, {}};
  std::vector<BlockKey> blocks = is_part ? looked_at.since(since) : known_blocks();
  const auto add = [&blocks](const std::vector<BlockKey>& more) { blocks.insert(blocks.end(), more.begin(), more.end()); };
  if (is_part) {
    add(surfels_changed_since(since));
    add(taken_from.since(since));
  }
  if (!looked_at.knows(state_blocks.sequence()) || state_blocks.resolution() != resolution) state_blocks.begin(resolution);
  StateBlocks::Changed changed;
  const std::uint64_t last = state_blocks.sequence();
  if (last == 0)
    changed.looked_at = known_blocks();
  else
    changed = {looked_at.since(last), taken_from.since(last), surfels_changed_since(last)};
  state_blocks.update(blocks, changed, sequence, {views, seen, taking_back, map, config.seen_points});
  changes.blocks = state_blocks.changes(blocks, changes.since, map);
  if (!is_part)
    changes.blocks.erase(std::remove_if(changes.blocks.begin(), changes.blocks.end(),
                                        [](const StateBlock& block) { return block.cells == std::vector<std::uint8_t>{0}; }),
                         changes.blocks.end());
  return changes;
}

std::vector<BlockKey> Mapper::Impl::surfels_changed_since(std::uint64_t since) const {
  std::vector<BlockKey> blocks = map.blocks_changed_since(static_cast<std::uint32_t>(since));
  const std::vector<BlockKey> without_page = lost_page.since(since);
  blocks.insert(blocks.end(), without_page.begin(), without_page.end());
  return blocks;
}

/// The blocks in memory of which anything is known.
std::vector<BlockKey> Mapper::Impl::known_blocks() const {
  std::vector<BlockKey> blocks = seen.blocks_with_points();
  for (const BlockKey& block : map.blocks_changed_since(0)) blocks.push_back(block);
  for (const auto& [intrinsics, T_world_camera] : views.cameras()) {
    const std::vector<BlockKey> of_view = blocks_of_view(intrinsics, T_world_camera, config.z_max, map.block_size()).blocks;
    blocks.insert(blocks.end(), of_view.begin(), of_view.end());
  }
  std::sort(blocks.begin(), blocks.end());
  blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
  return blocks;
}

std::vector<ViewValue> Mapper::evaluate_views(const ViewQuestion& question) const {
  check_question(question);
  return on_device(impl_->commands, [&] { return impl_->evaluate_views(question); });
}

std::vector<ViewValue> Mapper::Impl::evaluate_views(const ViewQuestion& question) {
  std::vector<Eigen::Vector3f> positions;
  for (const Eigen::Isometry3d& T : question.T_world_camera)
    positions.push_back(T.translation().cwiseMax(-kFarAway).cwiseMin(kFarAway).cast<float>());
  const std::vector<SpaceState> found = states(positions);
  const double most = question.most_clearance;
  const std::vector<float> room =
      most > 0 ? clearance_of(found, boundaries.nearest(positions, most, map), most) : std::vector<float>(found.size());
  std::vector<ViewValue> values = view_values.find(question, map, sequence);
  for (std::size_t n = 0; n < values.size(); ++n) {
    values[n].state = found[n];
    values[n].clearance = room[n];
  }
  return values;
}

}  // namespace frontier_surfels
