#include "stages.hpp"

#include <algorithm>
#include <cmath>

namespace frontier_surfels {
namespace {

constexpr std::size_t kGroup = 64;      // work items of a group, where kernels do not say otherwise
constexpr std::size_t kScanFew = 2048;  // so many values one work item scans alone

Limits make_limits(const Config& config) {
  Limits limits = {};
  limits.th_d = static_cast<float>(config.th_d);
  limits.peak = static_cast<float>(std::round(config.peak * SIGN_FIELD_ONE));
  limits.thickness = static_cast<float>(config.thickness);
  limits.hull_unknown_scale = 1.5F;
  limits.split_radius = 2 * std::sqrt(3.0F);
  limits.create_radius = std::sqrt(3.0F) / 2;
  limits.normal_min = 0.01F;
  limits.min_gap = static_cast<float>(config.min_gap);
  limits.surface_depth = static_cast<float>(config.surface_depth);
  limits.median_votes = config.median_votes;
  return limits;
}

std::size_t chunks(std::size_t count) { return (count + LANES - 1) / LANES; }

bool same_camera(const Intrinsics& a, const Intrinsics& b) {
  return a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy && a.width == b.width && a.height == b.height;
}

}  // namespace

Stages::Stages(Commands& commands, const Config& config, SurfelMap& map, RecentViews& views)
    : commands_(commands),
      map_(map),
      views_(views),
      config_(config),
      limits_(make_limits(config)),
      depth_(commands),
      layer_depth_(commands),
      valid_above_(commands),
      column_end_(commands),
      color_(commands),
      pixels_i_(commands),
      pixels_j_(commands),
      observed_(commands),
      events_(commands),
      hull_(commands),
      known_(commands),
      filtered_(commands),
      occupied_voxels_(commands),
      candidates_(commands),
      hull_faces_(commands),
      lines_(commands),
      tile_views_(commands),
      listed_voxels_(commands),
      kept_offsets_(commands),
      around_(commands),
      created_(commands),
      directions_(commands),
      placed_(commands),
      placed_normals_(commands),
      in_view_bits_(commands),
      removed_bits_(commands),
      in_view_slots_(commands),
      split_offsets_(commands),
      removed_list_(commands),
      view_surfels_(commands),
      changed_bits_(commands),
      changed_slots_(commands),
      changed_positions_(commands),
      changed_normals_(commands),
      tile_begin_(commands),
      tile_cursor_(commands),
      tile_surfels_(commands),
      counts_(commands),
      scan_levels_{DeviceArray<cl_uint>(commands), DeviceArray<cl_uint>(commands), DeviceArray<cl_uint>(commands),
                   DeviceArray<cl_uint>(commands)} {}

void Stages::begin_frame(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera, std::uint32_t frame) {
  if (!same_camera(intrinsics_, image.intrinsics)) set_grid(image);
  frame_ = frame;
  T_world_camera_ = to_transform(T_world_camera);
  T_camera_world_ = to_transform(T_world_camera.inverse());
  depth_.write(image.depth);
  valid_above_.write(image.valid_above);
  has_color_ = !image.color.empty();
  color_.resize(1);
  color_.write(image.color);
  views_.set_current(image, T_world_camera);
  view_ = views_.current_view();
}

void Stages::set_grid(const WorkingImage& image) {
  const ViewGrid view = make_view_grid(image.intrinsics, config_);
  grid_ = view.grid;
  intrinsics_ = {};  // until all of it is there
  layer_depth_.write(view.layer_depth);
  pixels_i_.write(view.pixels_i);
  pixels_j_.write(view.pixels_j);
  column_end_.resize(image.depth.size());
  allocate_grid();
  intrinsics_ = image.intrinsics;
}

void Stages::allocate_grid() {
  observed_.resize(words());
  known_.resize(words());
  filtered_.resize(words());
  occupied_voxels_.resize(words());
  candidates_.resize(words());
  events_.resize(3 * EVENT_PLANES * words());
  const std::size_t i = grid_.size_i, j = grid_.size_j, k = grid_.size_k, w = grid_.words_k;
  lines_.resize(line_numbers());
  hull_faces_.resize(2 * (j * k + i * k + i * j));
  hull_.resize(2 * (j * w + i * w + i * j));
}

View Stages::own_view() const {
  View own = view_;
  own.T_camera_world = to_transform(Eigen::Isometry3d::Identity());
  return own;
}

cl::NDRange Stages::word_range() const {
  return {(grid_.size_i + kGroup - 1) / kGroup * kGroup, static_cast<std::size_t>(grid_.words_k), static_cast<std::size_t>(grid_.size_j)};
}

void Stages::observe_space() {
  const char* stage = "observed_space";
  commands_.run(stage, "column_ends", static_cast<std::size_t>(grid_.width) * grid_.height, kGroup, grid_, depth_(), layer_depth_(),
                column_end_());
  commands_.run(stage, "observed_space", word_range(), cl::NDRange(kGroup, 1, 1), grid_, column_end_(), valid_above_(), pixels_i_(),
                pixels_j_(), observed_());
}

std::size_t Stages::select_in_view() {
  const char* stage = "in_view";
  const std::size_t slots = map_.slots(), count = (slots + 63) / 64;
  in_view_bits_.resize(count + 1);
  commands_.run(stage, "mark_in_view", slots, 64, grid_, limits_, T_camera_world_, map_.position_radius(), map_.normal_attributes(),
                static_cast<cl_uint>(slots), in_view_bits_());
  in_view_ = list_bits(stage, in_view_bits_, count, in_view_slots_);
  return in_view_;
}

std::size_t Stages::split_surfels() {
  const char* stage = "split";
  const auto count = static_cast<cl_uint>(in_view_);
  place_surfels();
  split_offsets_.resize(in_view_ + 1);
  commands_.run(stage, "count_splits", in_view_, kGroup, grid_, limits_, view_surfels_(), count, split_offsets_());
  const std::uint32_t additional = scan(stage, split_offsets_, in_view_);
  if (additional > 0) {
    map_.reserve(additional);
    in_view_slots_.grow(in_view_ + additional, in_view_);
    commands_.run(stage, "split", in_view_, kGroup, grid_, limits_, view_surfels_(), map_.position_radius(), map_.normal_attributes(),
                  map_.changed(), frame_, in_view_slots_(), count, split_offsets_(), map_.free_list(),
                  static_cast<cl_uint>(map_.free_slots()), static_cast<cl_uint>(map_.slots()));
    map_.added(additional);
    in_view_ += additional;
    place_surfels();
  }
  return additional;
}

void Stages::place_surfels() {
  view_surfels_.resize(std::max<std::size_t>(in_view_, 1));  // the sign field is computed without surfels, too
  commands_.run("split", "place_surfels", in_view_, kGroup, grid_, T_camera_world_, map_.position_radius(), map_.normal_attributes(),
                in_view_slots_(), static_cast<cl_uint>(in_view_), view_surfels_());
}

void Stages::assume_unknown() { filtered_.fill("median", 0, words()); }

void Stages::compute_sign_field() {
  const char* stage = "sign_field";
  const auto up = [](int size, int tile) { return static_cast<std::size_t>((size + tile - 1) / tile); };
  const std::size_t tiles = up(grid_.size_i, TILE_I) * up(grid_.size_j, TILE_J) * grid_.words_k * (64 / TILE_K);
  const auto count = static_cast<cl_uint>(in_view_);
  tile_begin_.resize(tiles + 1);
  tile_cursor_.resize(tiles + 1);
  tile_begin_.fill(stage, 0, tiles + 1);
  commands_.run(stage, "count_tiles", in_view_, kGroup, grid_, limits_, view_surfels_(), count, tile_begin_());
  tile_surfels_.resize(std::max<std::size_t>(scan(stage, tile_begin_, tiles), 1));
  commands_.queue().enqueueCopyBuffer(tile_begin_(), tile_cursor_(), 0, 0, (tiles + 1) * sizeof(cl_uint));
  commands_.run(stage, "fill_tiles", in_view_, kGroup, grid_, limits_, view_surfels_(), count, tile_cursor_(), tile_surfels_());
  const std::size_t group = large_group();
  commands_.run(stage, "sign_field", tiles * group, group, grid_, limits_, lines_(), view_surfels_(), tile_begin_(), tile_surfels_(),
                events_());
}

void Stages::compute_known_hull() {
  const char* stage = "known_hull";
  const std::size_t i = grid_.size_i, j = grid_.size_j, k = grid_.size_k, w = grid_.words_k;
  hull_faces_.fill(stage, 0xffffffffU, 2 * (j * k + i * k + i * j));
  commands_.run(stage, "project_hull", map_.slots(), kGroup, grid_, limits_, T_camera_world_, map_.position_radius(),
                map_.normal_attributes(), static_cast<cl_uint>(map_.slots()), lines_(), hull_faces_());
  const std::size_t most = std::max({j * w, i * w, i * j});
  commands_.run(stage, "hull_states", cl::NDRange((most + kGroup - 1) / kGroup * kGroup, 6), cl::NDRange(kGroup, 1), grid_, hull_faces_(),
                hull_());
}

void Stages::sweep_paths() {
  const char* stage = "sweeps";
  const std::size_t i = grid_.size_i, j = grid_.size_j, w = grid_.words_k;
  commands_.run(stage, "sweep_i", j * w, kGroup, grid_, lines_(), events_(), hull_(), known_());
  commands_.run(stage, "sweep_j", i * w, kGroup, grid_, lines_(), events_(), hull_(), known_());
  commands_.run(stage, "sweep_k", i * j, kGroup, grid_, lines_(), events_(), hull_(), known_());
}

void Stages::filter_median() { commands_.run("median", "median", words(), kGroup, grid_, limits_, known_(), filtered_()); }

void Stages::mark_removed() {
  const char* stage = "removal";
  occupied_voxels_.fill(stage, 0, words());
  removed_bits_.resize((in_view_ + 63) / 64 + 1);
  commands_.run(stage, "mark_removed", in_view_, 64, grid_, limits_, view_, static_cast<cl_int>(config_.remove_buried), views_.depths(),
                view_surfels_(), static_cast<cl_uint>(in_view_), map_.position_radius(), map_.normal_attributes(), observed_(),
                occupied_voxels_(), removed_bits_());
}

void Stages::find_candidates() {
  commands_.run("candidates", "find_candidates", word_range(), cl::NDRange(kGroup, 1, 1), grid_, observed_(), occupied_voxels_(),
                candidates_());
}

void Stages::settle_by_recent_views() {
  const char* stage = "recent_views";
  const int count = views_.prepare();
  if (count > 0) {
    const auto up = [](int size) { return static_cast<std::size_t>((size + VIEW_TILE - 1) / VIEW_TILE); };
    const std::size_t tiles = up(grid_.size_i) * up(grid_.size_j) * grid_.words_k * (64 / VIEW_TILE_K), group = large_group();
    tile_views_.resize(tiles * views_.view_groups());
    commands_.run(stage, "settle_candidates", tiles * group, group, grid_, limits_.min_gap, views_.views(), views_.view_lanes(),
                  static_cast<cl_int>(views_.view_groups()), views_.depths(), views_.block_depths(), layer_depth_(), tile_views_(),
                  candidates_());
  }
  list_candidates();
  tile_views_.resize(1);
  if (config_.min_gap > 0)
    commands_.run(stage, "close_gaps", chunks(listed_count_), large_group(), grid_, limits_, own_view(), views_.views(), tile_views_(),
                  static_cast<cl_int>(views_.view_groups()), views_.depths(), layer_depth_(), depth_(), column_end_(), listed_voxels_(),
                  static_cast<cl_int>(listed_count_), directions_(), candidates_());
  if (!is_open()) return;
  lines_.fill(stage, 0, line_numbers());
  commands_.run(stage, "mark_lines", words(), kGroup, grid_, candidates_(), lines_());
}

std::size_t Stages::large_group() const { return commands_.device().is_cpu ? 1 : 64; }

void Stages::list_candidates() {
  const char* stage = "recent_views";
  listed_count_ = list_bits(stage, candidates_, words(), listed_voxels_);
  around_.resize(chunks(listed_count_) * LANES);
  directions_.resize(chunks(listed_count_) * 3 * LANES);
  commands_.run(stage, "find_directions", chunks(listed_count_), large_group(), grid_, layer_depth_(), observed_(), listed_voxels_(),
                static_cast<cl_int>(listed_count_), around_(), directions_());
}

void Stages::filter_candidates() {
  const char* stage = "creation";
  const auto count = static_cast<cl_int>(listed_count_);
  kept_offsets_.resize(listed_count_ + 1);
  commands_.run(stage, "filter_candidates", listed_count_, kGroup, limits_, listed_voxels_(), count, directions_(), candidates_(),
                filtered_(), kept_offsets_());
  created_count_ = scan(stage, kept_offsets_, listed_count_);
  created_.resize(created_count_);
  if (created_count_ > 0) commands_.run(stage, "list_kept", listed_count_, kGroup, kept_offsets_(), count, created_());
}

std::size_t Stages::remove_surfels() {
  removed_count_ = list_bits("removal", removed_bits_, (in_view_ + 63) / 64, removed_list_);
  map_.reserve(created_count_);
  in_view_slots_.grow(in_view_ + created_count_, in_view_);
  commands_.run("removal", "remove_surfels", removed_count_, kGroup, removed_list_(), static_cast<cl_uint>(removed_count_), view_surfels_(),
                map_.normal_attributes(), map_.changed(), frame_, map_.free_list(), static_cast<cl_uint>(map_.free_slots()));
  map_.removed(removed_count_);
  return removed_count_;
}

std::size_t Stages::create_surfels() {
  const char* stage = "creation";
  placed_.resize(chunks(created_count_) * LANES);
  placed_normals_.resize(chunks(created_count_) * LANES);
  commands_.run(stage, "shape_surfels", chunks(created_count_), large_group(), grid_, limits_, static_cast<cl_int>(config_.refine_surfels),
                own_view(), views_.views(), tile_views_(), static_cast<cl_int>(views_.view_groups()), views_.depths(), layer_depth_(),
                created_(), static_cast<cl_int>(created_count_), listed_voxels_(), around_(), directions_(), placed_(), placed_normals_());
  commands_.run(stage, "create_surfels", created_count_, kGroup, T_world_camera_, placed_(), placed_normals_(),
                static_cast<cl_uint>(created_count_), map_.position_radius(), map_.normal_attributes(), map_.changed(), frame_,
                map_.free_list(), static_cast<cl_uint>(map_.free_slots()), static_cast<cl_uint>(map_.slots()), in_view_slots_(),
                static_cast<cl_uint>(in_view_));
  map_.added(created_count_);
  in_view_ += created_count_;
  return created_count_;
}

void Stages::label_surfels() {
  commands_.run("labels", "label_surfels", in_view_, kGroup, grid_, limits_, T_camera_world_, depth_(), column_end_(), color_(),
                static_cast<cl_int>(has_color_), in_view_slots_(), static_cast<cl_uint>(in_view_), map_.position_radius(),
                map_.normal_attributes(), map_.changed(), frame_);
}

Changes Stages::changes() {
  const char* stage = "changes";
  const std::size_t words = (map_.slots() + 63) / 64;
  changed_bits_.resize(words + 1);
  changed_bits_.fill(stage, 0, words + 1);
  commands_.run(stage, "mark_changed", in_view_, kGroup, in_view_slots_(), static_cast<cl_uint>(in_view_), map_.changed(), frame_,
                changed_bits_());
  const std::uint32_t count = list_bits(stage, changed_bits_, words, changed_slots_);
  changed_positions_.resize(count);
  changed_normals_.resize(count);
  commands_.run(stage, "gather_surfels", count, kGroup, changed_slots_(), count, map_.position_radius(), map_.normal_attributes(),
                changed_positions_(), changed_normals_());
  return to_changes(changed_slots_.read(count), changed_positions_.read(count), changed_normals_.read(count));
}

std::uint32_t Stages::scan(const char* stage, DeviceArray<cl_uint>& values, std::size_t count, std::size_t level) {
  if (count == 0) return 0;
  const auto n = static_cast<cl_uint>(count);
  if (count <= kScanFew) {
    commands_.run(stage, "scan_few", 1, 1, values(), n);
  } else {
    DeviceArray<cl_uint>& sums = scan_levels_[level];
    const std::size_t chunks = (count + SCAN_CHUNK - 1) / SCAN_CHUNK;
    sums.resize(chunks + 1);
    commands_.run(stage, "sum_chunks", chunks, kGroup, values(), n, sums());
    scan(stage, sums, chunks, level + 1);
    commands_.run(stage, "scan_chunks", chunks, kGroup, values(), n, sums());
  }
  return level == 0 ? values.read_one(count) : 0;
}

std::uint32_t Stages::list_bits(const char* stage, const DeviceArray<cl_ulong>& bits, std::size_t count, DeviceArray<cl_uint>& list) {
  if (count == 0) return 0;
  const auto n = static_cast<cl_uint>(count);
  counts_.resize(count + 1);
  commands_.run(stage, "count_bits", count, kGroup, bits(), n, counts_());
  const std::uint32_t total = scan(stage, counts_, count);
  list.resize(total);
  if (total > 0) commands_.run(stage, "list_bits", count, kGroup, bits(), n, counts_(), list());
  return total;
}

}  // namespace frontier_surfels
