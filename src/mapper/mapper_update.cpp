/// The flow chart of a frame: the paper's stages, and ours, in the order in which they run.
#include <chrono>

#include "frame/working_image.hpp"
#include "map/view_blocks.hpp"
#include "mapper/mapper_impl.hpp"
#include "stages/removal.hpp"
#include "stages/thin_gaps.hpp"

namespace frontier_surfels {

using Clock = std::chrono::steady_clock;

/// What each call that uses the map begins with. It does not wait for the device. It forgets the times of earlier calls, which would pile
/// up without frames, and undoes a failed frame that could not be undone at once.
void Mapper::Impl::begin_call() {
  commands.forget_times();
  map.roll_back();
}

/// What the last frame has forgotten is remembered by the next call that needs it, before anything else. If that fails, the frame that
/// forgot it is in the map all the same, and the call after that goes on with it.
void Mapper::Impl::remember_forgotten() {
  const std::vector<BlockKey> changed = remembering.remember_forgotten(views, map.block_size(), seen);
  if (archive) archive->note_changed(changed);
}

/// All or nothing.
Report Mapper::Impl::integrate(const DepthFrame& input) {
  try {
    return update(input);
  } catch (const std::exception&) {
    try {
      map.roll_back();
    } catch (const std::exception&) {  // the next call tries again
    }
    throw;
  }
}

Report Mapper::Impl::update(const DepthFrame& input) {
  const auto start = Clock::now();
  Report report;
  report.stamp = input.stamp;
  report.sequence = sequence + 1;
  const auto number = static_cast<std::uint32_t>(report.sequence);

  // The working image, and the non-uniform voxel grid of its camera - 3.1, eq. (2)-(3)
  const WorkingImage image = make_working_image(input, config, cameras.max_voxels());
  report.measured_pixels = image.measured_pixels();
  Camera& camera = cameras.find(image.intrinsics);

  // Pose correction - ours: the jitter of the recorded poses is taken out
  const CorrectedPose pose = pose_correction.correct(image, input.T_world_camera);
  report.T_world_camera = pose.T_world_camera;
  Frame frame = begin_frame(image, pose.T_world_camera, camera, number);

  // Observed space C~ - 3.3, eq. (9)-(11)
  observed.compute(frame, camera);

  // Taking back - ours: is there evidence that space behind measured surfaces, which was known, is unknown again?
  taking_back.look(camera, views, seen, &frame);

  // Candidates for creation - 3.5, eq. (13): unobserved voxels beside observed ones. They come before removal, because a voxel with a
  // surviving surfel needs no new one
  SurfelVisit::Found found = visit_surfels(frame, camera);

  // Space is taken back. That is rare, and only then the visit depends on it: so the visit is not kept waiting for the evidence, and is
  // repeated where it should have been. The surfels that it has marked for labels too many then leave the map, which marks them as well
  report.taken_back = taking_back.update(camera, map.window(), image, views, seen, &frame);
  if (frame.takes_back) found = visit_surfels(frame, camera);
  report.in_view = found.in_view;

  // Surfels that are too large for this view are split - 3.4. Then the smaller ones are visited
  if (found.large > 0) {
    report.split = splitting.split(frame, visit.large(), map);
    found = visit_surfels(frame, camera);
  }

  // Candidates that a kept view has seen are settled, and so are candidates on thin sheets of unknown space - both ours
  settling.settle(frame, camera, views, seen, taking_back.taken(), candidates);
  list.list(frame, camera, observed.bits(), candidates);
  close_thin_gaps(commands, frame, camera, observed.column_end(), views, settling.tile_views(), taking_back.taken(), list, candidates);

  // Known space K~ from the surfels, for the candidates that are left - 3.2, Algorithm 1, eq. (5)-(8). It is not needed as long as no view
  // has been forgotten: what no view has seen is unknown then
  const BitField* known = nullptr;
  if (!config.seen_points && !views.complete()) {
    if (!known_space) known_space.emplace(commands, lists);
    known = &known_space->compute(frame, visit.in_view(), candidates, map);
  }

  // New surfel filter - 3.5. The map's own memory is enlarged before anything is removed
  report.created = creation.filter(frame, list, candidates, known);
  map.reserve(report.created);

  // Psi_(n+1) = survivors u created - 3.4, eq. (12); 3.5, eq. (14)-(16)
  remove_surfels(commands, visit.removed(), found.removed, map);
  report.removed = found.removed;
  creation.create(frame, camera, views, seen, taking_back.taken(), settling, list, map);

  // Labels and colour - 3.5
  label_surfels(commands, frame, camera, observed.column_end(), map);

  finish_frame(number, image, pose, report);
  report.total_ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  return report;
}

Frame Mapper::Impl::begin_frame(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera, Camera& camera, std::uint32_t number) {
  begin_call();
  remember_forgotten();
  if (readers.forget_lost_ones(sequence)) map.reserve_ids(readers.maps(), sequence);
  if (archive) fetch_blocks(camera, T_world_camera, number);
  map.open_window(camera.grid(), T_world_camera);
  camera.set_image(image);
  views.set_current(image, T_world_camera);
  seen.choose_spacing(seen_spacing(camera));
  seen.open_window(map.window());
  taking_back.open_window(map.window(), seen);
  return make_frame(camera, map.window(), views, config.seen_points ? &seen : nullptr, limits);
}

/// The wanted distance of the lattices' points. Both have the same, also before any view has been forgotten.
double Mapper::Impl::seen_spacing(const Camera& camera) const {
  if (!taking_back.taken().empty()) return taking_back.taken().spacing();
  return config.seen_spacing > 0 ? config.seen_spacing : default_seen_spacing(camera.grid());
}

/// Finds the candidates, and then visits the surfels, which clears the candidates in their voxels.
SurfelVisit::Found Mapper::Impl::visit_surfels(const Frame& frame, const Camera& camera) {
  candidates.find(frame, observed.bits(), visit.counters());
  return visit.visit(frame, camera, observed.bits(), observed.column_end(), views, taking_back.taken(), map, candidates);
}

/// Repeats itself if larger surfels have come than any before, because the window around the view becomes larger then.
void Mapper::Impl::fetch_blocks(const Camera& camera, const Eigen::Isometry3d& T_world_camera, std::uint32_t number) {
  const auto reach = [&] { return map.window_reach(camera.grid(), T_world_camera) + KnownHull::kReach * config.z_max; };
  while (archive->follow(T_world_camera.translation(), reach(), number)) {
  }
}

void Mapper::Impl::finish_frame(std::uint32_t number, const WorkingImage& image, const CorrectedPose& pose, Report& report) {
  map.finish_frame("labels", number);
  report.stages = commands.take_times();  // waits for the device: whatever has failed shows by now
  taking_back.add_to_last_frames(image, pose.T_world_camera, views.current_number());
  const std::vector<BlockKey> shrunk = map.commit(number);
  pose_correction.add(image, pose);
  report.view_kept = views.keep_current();
  sequence = report.sequence;
  looked_at.note(blocks_of_view(image.intrinsics, pose.T_world_camera, config.z_max, map.block_size()).blocks, sequence);
  taken_from.note(taking_back.take_changed(), sequence);
  lost_page.note(shrunk, sequence);
  if (archive) {
    archive->note_changed(shrunk);
    archive->save_some(number);
  }
  report.surfels = map.size();
  report.map_bytes = map.bytes();
  report.seen_bytes = seen.bytes();
  report.device_bytes = device_bytes();
}

}  // namespace frontier_surfels
