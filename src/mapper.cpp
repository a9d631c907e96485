#include "frontier_surfels/mapper.hpp"

#include <chrono>
#include <utility>

#include "frame/recent_views.hpp"
#include "frame/working_image.hpp"
#include "frontier_surfels/ply.hpp"
#include "map/surfel_map.hpp"
#include "opencl/commands.hpp"
#include "stages/stages.hpp"
#include "storage/map_archive.hpp"

namespace frontier_surfels {
namespace {

using Clock = std::chrono::steady_clock;

Config checked(const Config& config) {
  const auto problems = config.problems();
  std::string all;
  for (const auto& problem : problems) all += (all.empty() ? "" : "\n") + problem;
  if (!all.empty()) throw Error(all);
  return config;
}

/// Runs a piece of work on the device; what OpenCL throws becomes one of this library's errors.
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
  Report integrate(const DepthFrame& frame);
  void finish_frame();
  void fetch_blocks(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera, std::uint32_t frame);
  void begin_map(const std::vector<Surfel>& surfels);
  std::size_t device_bytes() const { return commands.allocated_bytes() - map.untouched_bytes(); }

  explicit Impl(const Config& wanted)
      : config(checked(wanted)),
        commands(choose_device(config)),
        lists(commands),
        map(commands, lists, config),
        views(commands, config),
        stages(commands, lists, config, map, views) {
    if (config.map_folder.empty()) return;
    archive = std::make_unique<MapArchive>(config, map);
    views.clear(archive->empty());
  }

  Config config;
  Commands commands;
  Lists lists;
  SurfelMap map;
  RecentViews views;
  Stages stages;
  std::unique_ptr<MapArchive> archive;  ///< with a map_folder
  std::uint64_t sequence = 0;
  std::uint64_t frame_on_device = 0;  ///< sequence number of the frame that the stages have finished and nothing has come after
  bool unfinished = false;            ///< the last frame failed
  bool pages_changed = false;         ///< since the last finished frame: by one that failed, or by the archive
};

Mapper::Mapper(const Config& config) : impl_(on_device([&] { return std::make_unique<Impl>(config); })) {}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;
Mapper& Mapper::operator=(Mapper&&) noexcept = default;

Report Mapper::integrate(const DepthFrame& frame) {
  return on_device([&] { return impl_->integrate(frame); });
}

Report Mapper::Impl::integrate(const DepthFrame& frame) {
  const auto start = Clock::now();
  commands.forget_times();  // of a frame that failed half way
  Report report;
  report.stamp = frame.stamp;
  report.sequence = sequence + 1;

  // The working image and its grid - 3.1, eq. (2)-(3)
  const WorkingImage image = make_working_image(frame, config);
  frame_on_device = 0;
  if (unfinished) {  // a frame failed half way, but may have split surfels or noted others as changed
    pages_changed = true;
    finish_frame();
    unfinished = false;
  }
  const auto number = static_cast<std::uint32_t>(report.sequence);
  if (archive) fetch_blocks(image, frame.T_world_camera, number);
  unfinished = true;
  stages.begin_frame(image, frame.T_world_camera, number);

  // Observed space C~ - 3.3, eq. (9)-(11)
  stages.observe_space();

  // Candidates for creation - 3.5, eq. (13)
  stages.find_candidates();

  // Surfels in view, split where they are large for this view - 3.4 -, and removal - eq. (12): decided now, done when the frame can no
  // longer fail. Voxels of surfels that stay are no candidates
  report.in_view = stages.select_in_view();
  report.split = stages.split_surfels();

  // Candidates that a recent view knows are none
  stages.settle_by_recent_views();

  // Known space K~ from the surfels, for the candidates left - 3.2, Algorithm 1, eq. (5)-(8). What no view saw is unknown where all are
  // kept
  if (stages.is_open()) {
    stages.compute_sign_field();
    stages.compute_known_hull();
    stages.sweep_paths();
    stages.filter_median();
  }
  stages.filter_candidates();

  // Psi_(n+1) = survivors u created - eq. (14)-(16)
  report.removed = stages.remove_surfels();
  report.created = stages.create_surfels();

  // Labels and colour - 3.5
  stages.label_surfels();
  finish_frame();

  if (archive) archive->save_some(number);
  report.view_kept = views.keep_current();
  report.stages = commands.take_times();
  unfinished = false;
  sequence = report.sequence;
  frame_on_device = pages_changed ? 0 : sequence;
  pages_changed = false;
  report.surfels = map.size();
  report.map_bytes = map.bytes();
  report.device_bytes = device_bytes();
  report.total_ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  return report;
}

void Mapper::Impl::finish_frame() {
  const std::vector<BlockKey> shrunk = stages.finish_frame();
  if (archive) archive->note_shrunk(shrunk);
}

/// Once more if surfels have come that are larger than any before: they matter to a wider window.
void Mapper::Impl::fetch_blocks(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera, std::uint32_t frame) {
  bool changed = std::exchange(pages_changed, true);  // whatever fails
  while (archive->follow(T_world_camera.translation(), stages.set_camera(image, T_world_camera), frame)) changed = true;
  pages_changed = changed;
}

std::vector<Surfel> Mapper::surfels() const {
  return on_device([&] { return impl_->map.download(); });
}

std::vector<Surfel> Mapper::surfels(const Eigen::AlignedBox3f& box_world) const {
  std::vector<Surfel> inside;
  for (const Surfel& surfel : surfels())
    if (box_world.contains(surfel.position)) inside.push_back(surfel);
  return inside;
}

Changes Mapper::changes(std::uint64_t since) const {
  // The last frame alone is asked for after every frame: that must not cost more than what it has changed.
  const bool last_frame = impl_->frame_on_device == impl_->sequence && since + 1 == impl_->sequence;
  Changes changes = on_device([&] { return last_frame ? impl_->map.last_changes() : impl_->map.changes(since); });
  changes.sequence = impl_->sequence;
  return changes;
}

void Mapper::save(const std::string& path) const {
  std::vector<Surfel> all = surfels();
  if (impl_->archive) {
    const std::vector<Surfel> stored = impl_->archive->stored();
    all.insert(all.end(), stored.begin(), stored.end());
  }
  write_ply(path, all);
}

void Mapper::load(const std::string& path) {
  const std::vector<Surfel> surfels = read_ply(path);
  try {
    load(surfels);
  } catch (const DeviceError&) {
    throw;
  } catch (const Error& error) {
    throw FileError(path + " cannot be loaded. " + error.what());
  }
}

void Mapper::load(const std::vector<Surfel>& surfels) {
  on_device([&] { impl_->begin_map(surfels); });
}

void Mapper::Impl::begin_map(const std::vector<Surfel>& surfels) {
  map.replace(surfels, static_cast<std::uint32_t>(sequence + 1));
  ++sequence;
  views.clear(map.size() == 0);
  if (!archive) return;
  archive->clear();
  archive->save_some(static_cast<std::uint32_t>(sequence));
}

void Mapper::reset() {
  on_device([&] { impl_->begin_map({}); });
}

Statistics Mapper::statistics() const {
  Statistics statistics;
  for (const Surfel& surfel : surfels()) ++(surfel.label == Label::kOccupied ? statistics.occupied : statistics.frontier);
  statistics.surfels = statistics.occupied + statistics.frontier;
  statistics.map_bytes = impl_->map.bytes();
  statistics.device_bytes = impl_->device_bytes();
  return statistics;
}

std::size_t Mapper::size() const { return impl_->map.size(); }
std::uint64_t Mapper::sequence() const { return impl_->sequence; }
const Config& Mapper::config() const { return impl_->config; }
std::string Mapper::device() const { return impl_->commands.device().description; }

}  // namespace frontier_surfels
