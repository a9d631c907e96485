#include "frontier_surfels/mapper.hpp"

#include <utility>

#include "frame/working_image.hpp"
#include "frontier_surfels/map_file.hpp"
#include "map/seen_fill.hpp"
#include "map/view_packing.hpp"
#include "mapper/mapper_impl.hpp"

namespace frontier_surfels {
Mapper::Mapper(const Config& config) : impl_(on_device([&] { return std::make_unique<Impl>(config); })) {}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;
Mapper& Mapper::operator=(Mapper&&) noexcept = default;

void Mapper::prepare_questions() {
  on_device(impl_->commands, [&] { impl_->commands.build(kPlannersProgram); });
}

Report Mapper::integrate(const DepthFrame& frame) {
  return on_device(impl_->commands, [&] { return impl_->integrate(frame); });
}

std::vector<Surfel> Mapper::surfels() const {
  return on_device(impl_->commands, [&] {
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
  return on_device(impl_->commands, [&] { return impl_->changes(since); });
}

Changes Mapper::Impl::changes(std::uint64_t since) {
  begin_call();
  const std::uint64_t begin = readers.knows(since) && since <= sequence ? since : 0;
  Changes changes = begin == 0 ? map.whole() : map.changes(begin);
  changes.since = begin;
  changes.sequence = sequence;
  ChangeReaders told = readers;
  told.note(since, sequence);
  map.reserve_ids(told.maps(), sequence);
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
  SavedMap map = on_device(impl_->commands, [&] { return impl_->saved_map(); });
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
  on_device(impl_->commands, [&] {
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
  on_device(impl_->commands, [&] { impl_->begin_map(surfels, {}, {}); });
}

void Mapper::load(const SavedMap& map) {
  on_device(impl_->commands, [&] { impl_->begin_map(map.surfels, map.seen, map.views); });
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
  remembering.clear();
  taking_back.clear();
  pose_correction.clear();
  if (config.seen_points) seen.load(has_seen);
  load_views(saved_views);
  map.set_lost(false);
  ++sequence;
  for (ChangedBlocks* changed : {&looked_at, &taken_from, &lost_page}) changed->begin(sequence);
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
    commands.wait();  // so that not all images are kept at once
  }
  if (config.seen_points) seen.warn_of_spacing(config.seen_spacing, &warnings);
}

void Mapper::reset() {
  on_device(impl_->commands, [&] { impl_->begin_map({}, {}, {}); });
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
std::string Mapper::device_choice() const { return impl_->commands.device().choice; }

}  // namespace frontier_surfels
