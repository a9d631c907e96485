/// The flow chart of a frame: the paper's stages, and ours, in the order in which they run.
#include <chrono>
#include <limits>
#include <memory>

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

/// What the last frame has forgotten is remembered by the next call that needs it, before anything else; the next frame does it in steps.
/// If that fails, the frame that forgot it is in the map all the same, and the call after that goes on with it.
void Mapper::Impl::remember_forgotten() { note_changed(remembering.remember_forgotten(views, map.block_size(), seen)); }

void Mapper::Impl::note_changed(const std::vector<BlockKey>& blocks) {
  if (archive) archive->note_changed(blocks);
}

/// All or nothing.
Report Mapper::Impl::integrate(const DepthFrame& input) {
  try {
    return update(input);
  } catch (const std::exception&) {
    list.voxels().expect_nothing();  // room for many candidates may have been too much for the device
    creation.chosen().expect_nothing();
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
  commands.time_stages(report.sequence % stage_times_every() == 0);
  begin_call();

  // What the last frame has forgotten is remembered - ours. The device looks for it while the host makes the image
  remembering.ask(views, map.block_size(), seen);
  commands.start();

  // The working image, and the non-uniform voxel grid of its camera - 3.1, eq. (2)-(3)
  const auto shared_image = std::make_shared<const WorkingImage>(make_working_image(input, config, cameras.max_voxels(), sampling_room));
  const WorkingImage& image = *shared_image;
  report.measured_pixels = image.measured_pixels();
  Camera& camera = cameras.find(image.intrinsics);

  remembering.take_answer();

  // Observed space C~ - 3.3, eq. (9)-(11). It needs no pose: the device finds it while the host corrects the pose
  camera.set_image(shared_image);
  observed.compute(camera);
  commands.start();
  note_changed(remembering.see(views, seen));
  commands.start();

  // Pose correction - ours: the jitter of the recorded poses is taken out
  const CorrectedPose pose = pose_correction.correct(image, input.T_world_camera);
  report.T_world_camera = pose.T_world_camera;
  Frame frame = begin_frame(image, pose.T_world_camera, camera, number);

  // Taking back - ours: is there evidence that space behind measured surfaces, which was known, is unknown again?
  taking_back.look(camera, views, seen, &frame);

  // What is found with the map as it is: which surfels leave it, and new ones. Large surfels are split. On some devices the map may have
  // changed after that
  if (!find_changes(image, camera, frame, report)) {
    map.reserve(report.created);  // the map's own memory is enlarged before anything is removed
    carry_out(frame, camera, report.removed);
  }

  finish_frame(number, image, camera, pose, report);
  report.total_ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  return report;
}

/// Stages are timed in one frame of so many.
std::uint64_t Mapper::Impl::stage_times_every() const {
  constexpr std::uint64_t kSeldom = 32;  // less than 5 % of the frames, so that their p95 is that of the others
  if (config.stage_times_every > 0) return static_cast<std::uint64_t>(config.stage_times_every);
  return commands.device().is_cpu ? 1 : kSeldom;
}

Frame Mapper::Impl::begin_frame(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera, Camera& camera, std::uint32_t number) {
  if (readers.forget_lost_ones(sequence)) map.reserve_ids(readers.maps(), sequence);
  if (archive) {
    if (remembering.must_settle()) commands.wait();
    remembering.settle(seen);  // before blocks move
    fetch_blocks(camera, T_world_camera, number);
  }
  map.open_window(camera.grid(), T_world_camera);
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

/// The device does all of it before the host asks what has come of it. In few frames it has to be done again: surfels were too large, space
/// is taken back, or there were far more candidates than in the last frame. Where waiting costs much, the device also carries the changes
/// out, unless it finds that the host must look at them first.
/// @return whether they have been carried out
bool Mapper::Impl::find_changes(const WorkingImage& image, Camera& camera, Frame& frame, Report& report) {
  // Does this frame take space back? If one of the frames just before it did, the host waits for the answer at once. Else the frame goes on
  // as if it did not
  bool is_judged = taking_back.is_likely();
  const auto judge = [&] { report.taken_back = taking_back.update(camera, map.window(), image, views, &frame); };
  if (is_judged)
    judge();
  else
    report.taken_back = taking_back.give_back(camera, map.window(), image, views, &frame);

  for (;;) {
    // Candidates for creation - 3.5, eq. (13): unobserved voxels beside observed ones. They come before removal, because a voxel with a
    // surviving surfel needs no new one
    candidates.find(camera.grid(), observed.bits());
    visit.visit(frame, camera, observed.bits(), observed.column_end(), views, taking_back.taken(), map, candidates);

    // Candidates that a kept view has seen are settled, and so are candidates on thin sheets of unknown space - both ours
    settling.settle(frame, camera, views, seen, taking_back.taken(), candidates);
    list.list(frame, camera, observed.bits(), candidates);
    close_thin_gaps(commands, frame, camera, observed.column_end(), views, settling.tile_views(), taking_back.taken(), list, candidates);

    // Known space K~ from the surfels, for the candidates that are left - 3.2, Algorithm 1, eq. (5)-(8). It is not needed as long as no
    // view has been forgotten: what no view has seen is unknown then
    const BitField* known = nullptr;
    if (!config.seen_points && !views.complete()) {
      if (!known_space) known_space.emplace(commands, lists);
      known = &known_space->compute(frame, visit.in_view(), candidates, map);
    }

    // New surfel filter, and new surfels - 3.5, eq. (14)-(16)
    creation.filter(frame, list, candidates, known);
    creation.create(frame, camera, views, seen, taking_back.taken(), settling, list, visit.removed(), map);

    list.voxels().read_length_later();
    creation.chosen().read_length_later();
    const bool is_ahead = map.go_ahead("creation", {is_judged ? nullptr : taking_back.wanting(), list.voxels().length(),
                                                    creation.chosen().length(), candidates.visit_counts()()});
    if (is_ahead) carry_out(frame, camera, 0);
    commands.start();
    prepare_end(image, report);
    const SurfelVisit::Found found = SurfelVisit::read_found(candidates, map);  // the host waits
    if (is_ahead && !found.goes_on) map.stayed();

    // Space is taken back: then surfels float in it. Those that the visit has marked for labels too many leave the map, which marks them
    // as well
    if (!is_judged && taking_back.must_update()) {
      judge();
      is_judged = true;
      continue;
    }

    if (report.split == 0) report.in_view = found.in_view;

    // Surfels that are too large for this view are split - 3.4 -, once in a frame. Then the smaller ones are visited
    if (found.large > 0) {
      report.split = splitting.split(frame, visit.large(), map);
      frame.limits.split_radius = std::numeric_limits<float>::infinity();
      continue;
    }

    const bool all_listed = list.voxels().is_whole(), all_chosen = creation.chosen().is_whole();
    list.voxels().note_length();
    creation.chosen().note_length();
    if (all_listed && all_chosen) {
      report.created = creation.chosen().count();
      report.removed = found.removed;
      if (found.goes_on) map.went_on(report.removed, report.created);
      return found.goes_on;
    }
    if (!all_listed) creation.chosen().expect(list.voxels().total());  // not all could be chosen
  }
}

/// What the end of the frame needs, and the host can find while the device works.
void Mapper::Impl::prepare_end(const WorkingImage& image, const Report& report) {
  pose_correction.prepare(image);
  blocks_in_view = blocks_of_view(image.intrinsics, report.T_world_camera, config.z_max, map.block_size()).blocks;
}

/// Psi_(n+1) = survivors u created - 3.4, eq. (12); 3.5, eq. (14)-(16) -, labels and colour - 3.5.
/// @param removed  number of surfels that leave the map; 0 if the host does not know it yet
void Mapper::Impl::carry_out(const Frame& frame, const Camera& camera, std::size_t removed) {
  remove_surfels(commands, visit.removed(), removed, map);
  creation.insert(map);
  label_surfels(commands, frame, camera, observed.column_end(), map);
  map.finish_frame("labels", static_cast<std::uint32_t>(sequence + 1));
}

/// Repeats itself if larger surfels have come than any before, because the window around the view becomes larger then.
void Mapper::Impl::fetch_blocks(const Camera& camera, const Eigen::Isometry3d& T_world_camera, std::uint32_t number) {
  const auto reach = [&] { return map.window_reach(camera.grid(), T_world_camera) + KnownHull::kReach * config.z_max; };
  while (archive->follow(T_world_camera.translation(), reach(), number)) {
  }
}

void Mapper::Impl::finish_frame(std::uint32_t number, const WorkingImage& image, const Camera& camera, const CorrectedPose& pose,
                                Report& report) {
  report.stages = commands.take_times();  // waits for the device: whatever has failed shows by now
  if (stage_times_every() > 1) commands.time_stages(false);
  remembering.settle(seen);  // the host has waited
  taking_back.add_to_last_frames(camera, image, pose.T_world_camera, views.current_number());
  const std::vector<BlockKey> shrunk = map.commit(number);
  pose_correction.add(image, pose);
  report.view_kept = views.keep_current();
  sequence = report.sequence;
  looked_at.note(blocks_in_view, sequence);
  taken_from.note(taking_back.take_changed(), sequence);
  lost_page.note(shrunk, sequence);
  note_changed(shrunk);
  if (archive) archive->save_some(number);
  report.surfels = map.size();
  report.map_bytes = map.bytes();
  report.seen_bytes = seen.bytes();
  report.device_bytes = device_bytes();
}

}  // namespace frontier_surfels
