#include "frontier_surfels/mapper.hpp"

#include <chrono>
#include <optional>
#include <utility>

#include "config/checked.hpp"
#include "frame/camera.hpp"
#include "frame/limits.hpp"
#include "frame/recent_views.hpp"
#include "frame/working_image.hpp"
#include "frontier_surfels/map_file.hpp"
#include "map/change_readers.hpp"
#include "map/seen_fill.hpp"
#include "map/seen_points.hpp"
#include "map/surfel_map.hpp"
#include "map/view_packing.hpp"
#include "opencl/commands.hpp"
#include "stages/candidates.hpp"
#include "stages/creation.hpp"
#include "stages/known_space.hpp"
#include "stages/observed_space.hpp"
#include "stages/remembering.hpp"
#include "stages/removal.hpp"
#include "stages/surfel_split.hpp"
#include "stages/surfel_visit.hpp"
#include "stages/thin_gaps.hpp"
#include "stages/view_settling.hpp"
#include "storage/map_archive.hpp"

namespace frontier_surfels {
namespace {

using Clock = std::chrono::steady_clock;

/// Runs work on the device. An exception of OpenCL's becomes one of this library's errors.
template <typename Work>
auto on_device(Work work) -> decltype(work()) {
  try {
    return work();
  } catch (const std::exception& error) {
    throw_device_error(error);
  }
}

}  // namespace

struct Mapper::Impl {
  explicit Impl(const Config& wanted)
      : config(checked(wanted)),
        limits(make_limits(config)),
        commands(choose_device(config)),
        lists(commands),
        map(commands, lists, config),
        seen(commands, map.block_size()),
        views(commands, config),
        cameras(commands, config),
        observed(commands),
        candidates(commands),
        visit(commands),
        splitting(commands, lists),
        settling(commands),
        list(commands, lists),
        creation(commands, lists),
        remembering(commands) {
    if (config.map_folder.empty()) return;
    archive = std::make_unique<MapArchive>(config, map, seen, views,
                                           [this] { return remembering.remember_forgotten(views, map.block_size(), seen); });
    views.clear(archive->empty());
    if (!config.seen_points) return;  // the folder's views are of no use then, and stay there
    const std::vector<SavedView> stored = archive->stored_views(&warnings);
    views.make_room(stored);
    load_views(stored);
    archive->store_views();
  }

  void begin_call();
  void remember_forgotten();
  Report integrate(const DepthFrame& input);
  Report update(const DepthFrame& input);
  Frame begin_frame(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera, Camera& camera, std::uint32_t number);
  SurfelVisit::Found visit_surfels(const Frame& frame, const Camera& camera);
  void fetch_blocks(const Camera& camera, const Eigen::Isometry3d& T_world_camera, std::uint32_t number);
  void finish_frame(std::uint32_t number, Report& report);
  Changes changes(std::uint64_t since);
  SavedMap saved_map();
  void begin_map(const std::vector<Surfel>& surfels, const SeenSpace& saved_seen, const std::vector<SavedView>& saved_views);
  void load_views(const std::vector<SavedView>& saved);
  std::size_t device_bytes() const { return commands.allocated_bytes() - map.untouched_bytes(); }

  const Config config;
  const Limits limits;
  Commands commands;
  Lists lists;
  SurfelMap map;
  SeenPoints seen;
  RecentViews views;
  Cameras cameras;

  // The stages, in the order in which they run
  ObservedSpace observed;
  Candidates candidates;
  SurfelVisit visit;
  SurfelSplit splitting;
  ViewSettling settling;
  CandidateList list;
  std::optional<KnownSpace> known_space;  ///< made by the first frame that needs it
  Creation creation;
  Remembering remembering;

  std::unique_ptr<MapArchive> archive;  ///< with a map_folder
  std::vector<std::string> warnings;    ///< that have not been taken
  ChangeReaders readers;
  std::uint64_t sequence = 0;
  std::uint64_t frame_on_device = 0;  ///< sequence number of the last frame, while its changes can be read exactly; else 0
  bool pages_changed = false;         ///< by the archive, since the last frame
};

Mapper::Mapper(const Config& config) : impl_(on_device([&] { return std::make_unique<Impl>(config); })) {}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;
Mapper& Mapper::operator=(Mapper&&) noexcept = default;

Report Mapper::integrate(const DepthFrame& frame) {
  return on_device([&] { return impl_->integrate(frame); });
}

/// What each call that uses the map begins with. It forgets the times of earlier calls, which would pile up without frames, and undoes a
/// failed frame that could not be undone at once.
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
  const Frame frame = begin_frame(image, input.T_world_camera, camera, number);

  // Observed space C~ - 3.3, eq. (9)-(11)
  observed.compute(frame, camera);

  // Candidates for creation - 3.5, eq. (13): unobserved voxels beside observed ones. They come before removal, because a voxel with a
  // surviving surfel needs no new one
  SurfelVisit::Found found = visit_surfels(frame, camera);
  report.in_view = found.in_view;

  // Surfels that are too large for this view are split - 3.4. Then the smaller ones are visited
  if (found.large > 0) {
    report.split = splitting.split(frame, visit.large(), map);
    found = visit_surfels(frame, camera);
  }

  // Candidates that a kept view has seen are settled, and so are candidates on thin sheets of unknown space - both ours
  settling.settle(frame, camera, views, seen, candidates);
  list.list(frame, camera, observed.bits(), candidates);
  close_thin_gaps(commands, frame, camera, observed.column_end(), views, settling.tile_views(), list, candidates);

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
  creation.create(frame, camera, views, seen, settling, list, map);

  // Labels and colour - 3.5
  label_surfels(commands, frame, camera, observed.column_end(), map);

  finish_frame(number, report);
  report.total_ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  return report;
}

Frame Mapper::Impl::begin_frame(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera, Camera& camera, std::uint32_t number) {
  begin_call();
  remember_forgotten();
  if (readers.forget_lost_ones(sequence)) map.reserve_ids(readers.slowest());
  if (archive) fetch_blocks(camera, T_world_camera, number);
  map.open_window(camera.grid(), T_world_camera);
  camera.set_image(image);
  views.set_current(image, T_world_camera);
  seen.choose_spacing(config.seen_spacing > 0 ? config.seen_spacing : default_seen_spacing(camera.grid()));
  seen.open_window(map.window());
  return make_frame(camera, map.window(), views, config.seen_points ? &seen : nullptr, limits);
}

/// Finds the candidates, and then visits the surfels, which clears the candidates in their voxels.
SurfelVisit::Found Mapper::Impl::visit_surfels(const Frame& frame, const Camera& camera) {
  candidates.find(frame, observed.bits(), visit.counters());
  return visit.visit(frame, camera, observed.bits(), observed.column_end(), views, map, candidates);
}

/// Repeats itself if larger surfels have come than any before, because the window around the view becomes larger then.
void Mapper::Impl::fetch_blocks(const Camera& camera, const Eigen::Isometry3d& T_world_camera, std::uint32_t number) {
  bool changed = std::exchange(pages_changed, true);  // stays true if something throws
  const std::uint64_t exact = std::exchange(frame_on_device, 0);
  const auto reach = [&] { return map.window_reach(camera.grid(), T_world_camera) + KnownHull::kReach * config.z_max; };
  while (archive->follow(T_world_camera.translation(), reach(), number)) changed = true;
  pages_changed = changed;
  if (!changed) frame_on_device = exact;
}

void Mapper::Impl::finish_frame(std::uint32_t number, Report& report) {
  map.finish_frame("labels", number);
  report.stages = commands.take_times();  // waits for the device: whatever has failed shows by now
  const std::vector<BlockKey> shrunk = map.commit(number);
  report.view_kept = views.keep_current();
  sequence = report.sequence;
  frame_on_device = pages_changed ? 0 : sequence;
  pages_changed = false;
  if (archive) {
    archive->note_changed(shrunk);
    archive->save_some(number);
  }
  report.surfels = map.size();
  report.map_bytes = map.bytes();
  report.seen_bytes = seen.bytes();
  report.device_bytes = device_bytes();
}

std::vector<Surfel> Mapper::surfels() const {
  return on_device([&] {
    impl_->begin_call();
    return impl_->map.download();
  });
}

std::vector<Surfel> Mapper::surfels(const Eigen::AlignedBox3f& box_world) const {
  std::vector<Surfel> inside;
  for (const Surfel& surfel : surfels())
    if (box_world.contains(surfel.position)) inside.push_back(surfel);
  return inside;
}

Changes Mapper::changes(std::uint64_t since) const {
  return on_device([&] { return impl_->changes(since); });
}

Changes Mapper::Impl::changes(std::uint64_t since) {
  begin_call();
  const std::uint64_t begin = readers.knows(since) && since <= sequence ? since : 0;
  // The last frame alone is asked for after every frame: that must not cost more than what it has changed.
  const bool last_frame = frame_on_device == sequence && begin != 0 && begin + 1 == sequence;
  Changes changes = last_frame ? map.last_changes() : map.changes(begin);
  changes.since = begin;
  changes.sequence = sequence;
  ChangeReaders told = readers;
  told.note(since, sequence);
  map.reserve_ids(told.slowest());
  readers = told;  // nothing has failed: the reader gets the changes
  return changes;
}

std::vector<Surfel> Mapper::whole_map() const {
  SavedMap map;
  map.surfels = surfels();
  if (impl_->archive) impl_->archive->add_stored(map);
  return std::move(map.surfels);
}

SavedMap Mapper::saved_map() const {
  SavedMap map = on_device([&] { return impl_->saved_map(); });
  if (impl_->archive) impl_->archive->add_stored(map);
  if (!impl_->config.seen_points) map.seen = {};  // it lacks what this mapper has seen: let it be filled in
  return map;
}

SavedMap Mapper::Impl::saved_map() {
  begin_call();
  remember_forgotten();
  SavedMap saved = {map.download(), seen.saved(), {}};
  for (const std::uint64_t number : views.numbers()) saved.views.push_back(views.saved(number));
  return saved;
}

void Mapper::save(const std::string& path) const { write_map(path, saved_map()); }

void Mapper::flush() {
  if (!impl_->archive) return;
  on_device([&] {
    impl_->commands.forget_times();
    impl_->archive->flush(static_cast<std::uint32_t>(impl_->sequence));
  });
}

std::vector<std::string> Mapper::take_warnings() { return std::exchange(impl_->warnings, {}); }
std::string Mapper::map_folder_fault() const { return impl_->archive ? impl_->archive->fault() : ""; }

void Mapper::load(const std::string& path) {
  const SavedMap map = read_saved_map(path);
  try {
    load(map);
  } catch (const DeviceError&) {
    throw;
  } catch (const Error& error) {
    throw FileError(path + " cannot be loaded. " + error.what());
  }
}

void Mapper::load(const std::vector<Surfel>& surfels) {
  on_device([&] { impl_->begin_map(surfels, {}, {}); });
}

void Mapper::load(const SavedMap& map) {
  on_device([&] { impl_->begin_map(map.surfels, map.seen, map.views); });
}

void Mapper::Impl::begin_map(const std::vector<Surfel>& surfels, const SeenSpace& saved_seen, const std::vector<SavedView>& saved_views) {
  commands.forget_times();
  SurfelMap::check(surfels);
  for (const SavedView& view : saved_views) check_view(view);
  views.make_room(saved_views);
  const SeenSpace has_seen = config.seen_points ? seen_of(surfels, saved_seen, map.block_size(), config.threads) : SeenSpace();
  map.replace(surfels, static_cast<std::uint32_t>(sequence + 1));
  map.set_lost(true);  // until all that belongs to it is there
  views.clear(map.size() == 0);
  seen.clear();
  if (config.seen_points) seen.load(has_seen);
  load_views(saved_views);
  map.set_lost(false);
  ++sequence;
  if (!archive) return;
  archive->clear();
  archive->note_changed(seen.blocks_with_points());
  archive->save_some(static_cast<std::uint32_t>(sequence));
}

/// The seen points must be there. What there is no room for becomes seen points, as if it had been kept and forgotten.
void Mapper::Impl::load_views(const std::vector<SavedView>& saved) {
  if (config.seen_spacing > 0) seen.choose_spacing(config.seen_spacing);
  for (const SavedView& view : saved) {
    views.set_current(working_image_of(view), view.T_world_camera);
    views.keep();
    remember_forgotten();
    commands.forget_times();
  }
  if (config.seen_points) seen.warn_of_spacing(config.seen_spacing, &warnings);
}

void Mapper::reset() {
  on_device([&] { impl_->begin_map({}, {}, {}); });
}

Statistics Mapper::statistics() const {
  Statistics statistics;
  for (const Surfel& surfel : surfels()) ++(surfel.label == Label::kOccupied ? statistics.occupied : statistics.frontier);
  statistics.surfels = statistics.occupied + statistics.frontier;
  statistics.map_bytes = impl_->map.bytes();
  statistics.seen_bytes = impl_->seen.bytes();
  statistics.device_bytes = impl_->device_bytes();
  return statistics;
}

std::size_t Mapper::size() const { return impl_->map.size(); }
std::size_t Mapper::size_on_disk() const { return impl_->archive ? impl_->archive->stored_size() : 0; }
std::uint64_t Mapper::sequence() const { return impl_->sequence; }
const Config& Mapper::config() const { return impl_->config; }
std::string Mapper::device() const { return impl_->commands.device().description; }

}  // namespace frontier_surfels
