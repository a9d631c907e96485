#include "frontier_surfels/mapper.hpp"

#include <chrono>
#include <optional>

#include "frontier_surfels/ply.hpp"
#include "opencl/commands.hpp"
#include "recent_views.hpp"
#include "stages.hpp"
#include "surfel_map.hpp"
#include "working_image.hpp"

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

}  // namespace

struct Mapper::Impl {
  explicit Impl(const Config& wanted)
      : config(checked(wanted)), commands(choose_device(config)), map(commands), views(commands, config), stages(commands, config, map, views) {}

  Config config;
  Commands commands;
  SurfelMap map;
  RecentViews views;
  Stages stages;
  std::uint64_t sequence = 0;
};

Mapper::Mapper(const Config& config) : impl_(std::make_unique<Impl>(config)) {}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;
Mapper& Mapper::operator=(Mapper&&) noexcept = default;

Report Mapper::integrate(const DepthFrame& frame) {
  const auto start = Clock::now();
  Stages& stages = impl_->stages;
  Report report;
  report.stamp = frame.stamp;
  report.sequence = impl_->sequence + 1;

  // The working image and its grid - 3.1, eq. (2)-(3)
  const WorkingImage image = make_working_image(frame, impl_->config);
  stages.begin_frame(image, frame.T_world_camera, static_cast<std::uint32_t>(report.sequence));

  // Observed space C~ - 3.3, eq. (9)-(11)
  stages.observe_space();

  // Surfels in view, split where they are large for this view - 3.4
  report.in_view = stages.select_in_view();
  report.split = stages.split_surfels();

  // Removal - 3.4, eq. (12): decided now, done when the frame can no longer fail
  stages.mark_removed();

  // Candidates for creation - 3.5, eq. (13) - without those that a recent view knows
  stages.find_candidates();
  stages.settle_by_recent_views();

  // Known space K~ from the surfels, for the candidates left - 3.2, Algorithm 1, eq. (5)-(8)
  stages.compute_sign_field();
  stages.compute_known_hull();
  stages.sweep_paths();
  stages.filter_median();
  stages.filter_candidates();

  // Psi_(n+1) = survivors u created - eq. (14)-(16)
  report.removed = stages.remove_surfels();
  report.created = stages.create_surfels();

  // Labels and colour - 3.5
  stages.label_surfels();

  report.view_kept = impl_->views.keep_current();
  report.stages = impl_->commands.take_times();
  impl_->sequence = report.sequence;
  report.surfels = impl_->map.size();
  report.total_ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  return report;
}

std::vector<Surfel> Mapper::surfels() const { return impl_->map.download(); }

std::vector<Surfel> Mapper::surfels(const Eigen::AlignedBox3f& box_world) const {
  std::vector<Surfel> inside;
  for (const Surfel& surfel : surfels())
    if (box_world.contains(surfel.position)) inside.push_back(surfel);
  return inside;
}

Changes Mapper::changes(std::uint64_t since) const {
  Changes changes = impl_->map.changes(since);
  changes.sequence = impl_->sequence;
  return changes;
}

void Mapper::save(const std::string& path) const { write_ply(path, surfels()); }

void Mapper::load(const std::string& path) {
  impl_->map.replace(read_ply(path), static_cast<std::uint32_t>(impl_->sequence + 1));
  impl_->views.clear();
  ++impl_->sequence;
}

void Mapper::reset() {
  impl_->map.replace({}, static_cast<std::uint32_t>(impl_->sequence + 1));
  impl_->views.clear();
  ++impl_->sequence;
}

Statistics Mapper::statistics() const {
  Statistics statistics;
  for (const Surfel& surfel : surfels()) ++(surfel.label == Label::kOccupied ? statistics.occupied : statistics.frontier);
  statistics.surfels = statistics.occupied + statistics.frontier;
  statistics.map_bytes = impl_->map.bytes();
  statistics.device_bytes = impl_->commands.allocated_bytes();
  return statistics;
}

std::uint64_t Mapper::sequence() const { return impl_->sequence; }
const Config& Mapper::config() const { return impl_->config; }
std::string Mapper::device() const { return impl_->commands.device().description; }

}  // namespace frontier_surfels
