#include "stages/stages.hpp"

#include <algorithm>
#include <cmath>

namespace frontier_surfels {
namespace {

constexpr std::size_t kGroup = 64;  // work items of a group, where kernels do not say otherwise
constexpr double kHullReach = 1;    // times z_max: surfels further from the grid say nothing of the paths that enter it

Limits make_limits(const Config& config) {
  Limits limits = {};
  limits.th_d = static_cast<float>(config.th_d);
  limits.peak = static_cast<float>(std::round(config.peak * SIGN_FIELD_ONE));
  limits.thickness = static_cast<float>(config.thickness);
  limits.hull_unknown_scale = 1.5F;
  limits.split_radius = 2 * std::sqrt(3.0F);
  limits.create_radius = std::sqrt(3.0F) / 2;
  limits.normal_min = 0.01F;
  limits.back_probe = static_cast<float>(kBackProbe);
  limits.front_probe = static_cast<float>(kFrontProbe) * limits.create_radius;
  limits.min_gap = static_cast<float>(config.min_gap);
  limits.surface_depth = static_cast<float>(config.surface_depth);
  limits.median_votes = config.median_votes;
  return limits;
}

std::size_t tiles(int size) { return (size + VIEW_TILE - 1) / VIEW_TILE; }

bool same_camera(const Intrinsics& a, const Intrinsics& b) {
  return a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy && a.width == b.width && a.height == b.height;
}

}  // namespace

Stages::Stages(Commands& commands, Lists& lists, const Config& config, SurfelMap& map, RecentViews& views)
    : commands_(commands),
      lists_(lists),
      map_(map),
      views_(views),
      config_(config),
      limits_(make_limits(config)),
      depth_(commands),
      color_(commands),
      layer_depth_(commands),
      column_end_(commands),
      valid_(commands),
      pixels_i_(commands),
      pixels_j_(commands),
      words_i_(commands),
      observed_(commands),
      events_(commands),
      hull_(commands),
      known_(commands),
      filtered_(commands),
      candidates_(commands),
      hull_faces_(commands),
      lines_(commands),
      tile_views_(commands),
      listed_voxels_(commands),
      created_(commands),
      kept_bits_(commands),
      around_(commands),
      directions_(commands),
      counts_(commands),
      in_view_bits_(commands),
      large_bits_(commands),
      removed_bits_(commands),
      in_view_slots_(commands),
      split_slots_(commands),
      split_offsets_(commands),
      view_surfels_(commands),
      new_surfels_(commands),
      new_cells_(commands),
      near_pages_(commands),
      tile_begin_(commands),
      tile_cursor_(commands),
      tile_surfels_(commands) {}

double Stages::set_camera(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera) {
  if (!same_camera(intrinsics_, image.intrinsics)) set_grid(image);
  return map_.window_reach(grid_, T_world_camera) + kHullReach * config_.z_max;
}

void Stages::begin_frame(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera, std::uint32_t frame) {
  set_camera(image, T_world_camera);
  frame_ = frame;
  map_.open_window(grid_, T_world_camera);
  window_ = map_.window().window();
  T_camera_local_ = to_transform(map_.window().T_camera_local());
  T_local_camera_ = to_transform(map_.window().T_camera_local().inverse());
  depth_.send(image.depth);
  has_color_ = !image.color.empty();
  color_.send(image.color);
  views_.set_current(image, T_world_camera);
}

void Stages::set_grid(const WorkingImage& image) {
  const ViewGrid view = make_view_grid(image.intrinsics, config_);
  grid_ = view.grid;
  intrinsics_ = {};  // until all of it is there
  layer_depth_.write(view.layer_depth);
  pixels_i_.write(view.pixels_i);
  pixels_j_.write(view.pixels_j);
  words_i_.write(view.words_i);
  column_end_.resize(image.depth.size());
  valid_.resize(image_words());
  allocate_grid();
  intrinsics_ = image.intrinsics;
}

void Stages::allocate_grid() {
  observed_.allocate(words() + SPARE_WORDS);
  filtered_.allocate(words());
  candidates_.allocate(candidate_words());
}

/// What only section 4 of the method needs, and not before it does: half of the memory.
void Stages::allocate_paths() {
  known_.allocate(words());
  events_.allocate(3 * EVENT_PLANES * words());
  const std::size_t i = grid_.size_i, j = grid_.size_j, k = grid_.size_k, w = grid_.words_k;
  lines_.allocate(line_numbers());
  hull_faces_.allocate(2 * (j * k + i * k + i * j));
  hull_.allocate(2 * (j * w + i * w + i * j));
}

std::size_t Stages::image_words() const { return (grid_.width + 31) / 32 * static_cast<std::size_t>(grid_.height); }

std::size_t Stages::candidate_words() const {
  return VIEW_TILE * VIEW_TILE * tiles(grid_.size_i) * tiles(grid_.size_j) * static_cast<std::size_t>(grid_.words_k);
}

void Stages::observe_space() {
  const char* stage = "observed_space";
  if (commands_.lanes() == 1) valid_.fill(stage, 0, image_words());
  commands_.run(stage, "column_ends", 32 / commands_.lanes() * image_words(), kGroup, grid_, depth_(), layer_depth_(), column_end_(),
                valid_());
  const std::size_t rows = (grid_.size_j + SPACE_ROWS - 1) / SPACE_ROWS;
  commands_.run(stage, "observed_space", commands_.chunks(grid_.size_i) * grid_.words_k * rows, large_group(), grid_, column_end_(),
                valid_(), pixels_i_(), pixels_j_(), words_i_(), observed_());
}

std::vector<cl_uint> Stages::visit_surfels() {
  const char* stage = "in_view";
  const std::size_t pages = map_.window_pages();
  in_view_bits_.resize(pages + 1);
  large_bits_.resize(pages + 1);
  removed_bits_.resize(pages + 1);
  commands_.run(stage, "visit_surfels", PAGE_SLOTS / commands_.lanes() * pages, PAGE_GROUP, grid_, limits_, window_, T_camera_local_,
                views_.own_view(), static_cast<cl_int>(config_.remove_buried), static_cast<cl_int>(has_color_), views_.depths(), depth_(),
                column_end_(), map_.pages(), static_cast<cl_uint>(pages), map_.alive(), map_.page_block(), map_.surfels(), observed_(),
                candidates_(), map_.changed(), in_view_bits_(), large_bits_(), removed_bits_(), counts_());
  std::vector<cl_uint> counts = counts_.read(COUNTS);
  removed_ = counts[COUNT_REMOVED];
  return counts;
}

std::size_t Stages::select_in_view() {
  const std::vector<cl_uint> counts = visit_surfels();
  large_ = counts[COUNT_LARGE];
  return counts[COUNT_IN_VIEW];
}

std::size_t Stages::split_surfels() {
  if (large_ == 0) return 0;
  const char* stage = "split";
  const std::uint32_t parents = lists_.list_bits(stage, large_bits_, map_.window_pages(), split_slots_);
  commands_.run(stage, "to_slots", parents, kGroup, map_.pages(), split_slots_(), parents);
  split_offsets_.resize(parents + 1);
  commands_.run(stage, "count_children", commands_.chunks(parents), kGroup, grid_, limits_, window_, T_camera_local_, map_.page_block(),
                map_.surfels(), split_slots_(), parents, split_offsets_());
  const std::uint32_t children = lists_.scan(stage, split_offsets_, parents);
  map_.reserve(children);
  new_surfels_.resize(children);
  new_cells_.resize(children);
  commands_.run(stage, "split", commands_.chunks(parents), kGroup, grid_, limits_, window_, T_camera_local_, map_.page_block(),
                map_.surfels(), split_slots_(), parents, split_offsets_(), new_surfels_(), new_cells_(), map_.alive(), map_.changed());
  map_.removed(parents);
  map_.insert(stage, new_surfels_, new_cells_, children);
  find_candidates();  // parents have taken some off
  visit_surfels();    // the children instead of their parents
  return children - parents;
}

void Stages::place_surfels() {
  const char* stage = "sign_field";
  in_view_ = lists_.list_bits(stage, in_view_bits_, map_.window_pages(), in_view_slots_);
  const auto count = static_cast<cl_uint>(in_view_);
  view_surfels_.resize(std::max<std::size_t>(in_view_, 1));  // the sign field is computed without surfels, too
  commands_.run(stage, "to_slots", in_view_, kGroup, map_.pages(), in_view_slots_(), count);
  commands_.run(stage, "place_surfels", commands_.chunks(in_view_), kGroup, grid_, window_, T_camera_local_, map_.page_block(),
                map_.surfels(), in_view_slots_(), count, view_surfels_());
}

void Stages::compute_sign_field() {
  const char* stage = "sign_field";
  place_surfels();
  const auto up = [](int size, int tile) { return static_cast<std::size_t>((size + tile - 1) / tile); };
  const std::size_t tiles = up(grid_.size_i, TILE_I) * up(grid_.size_j, TILE_J) * grid_.words_k * (64 / TILE_K);
  const auto count = static_cast<cl_uint>(in_view_);
  tile_begin_.resize(tiles + 1);
  tile_cursor_.resize(tiles + 1);
  tile_begin_.fill(stage, 0, tiles + 1);
  commands_.run(stage, "count_tiles", in_view_, kGroup, grid_, limits_, view_surfels_(), count, tile_begin_());
  tile_surfels_.resize(std::max<std::size_t>(lists_.scan(stage, tile_begin_, tiles), 1));
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
  const std::size_t pages = map_.list_pages_near(kHullReach * config_.z_max, near_pages_);
  commands_.run(stage, "project_hull", PAGE_SLOTS / commands_.lanes() * pages, kGroup, grid_, limits_, window_, T_camera_local_,
                near_pages_(), static_cast<cl_uint>(pages), map_.alive(), map_.page_block(), map_.surfels(), lines_(), hull_faces_());
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

void Stages::filter_median() { commands_.run("median", "median", words(), kGroup, grid_, limits_, known_(), candidates_(), filtered_()); }

void Stages::find_candidates() {
  counts_.resize(COUNTS);
  const std::size_t rows = VIEW_TILE * tiles(grid_.size_j);
  commands_.run("candidates", "find_candidates", commands_.chunks(VIEW_TILE * tiles(grid_.size_i)) * grid_.words_k * rows, kGroup, grid_,
                observed_(), candidates_(), counts_());
}

void Stages::settle_by_recent_views() {
  const char* stage = "recent_views";
  const int count = views_.prepare();
  if (count > 0) {
    const std::size_t words = tiles(grid_.size_i) * tiles(grid_.size_j) * grid_.words_k, group = large_group();
    tile_views_.resize(words * (64 / VIEW_TILE_K) * views_.view_groups());
    commands_.run(stage, "settle_candidates", words * group, group, grid_, limits_.min_gap, views_.views(), views_.view_lanes(),
                  static_cast<cl_int>(count), views_.depths(), layer_depth_(), tile_views_(), candidates_());
  }
  list_candidates();
  tile_views_.resize(1);
  if (config_.min_gap > 0)
    commands_.run(stage, "close_gaps", commands_.chunks(listed_count_), large_group(), grid_, limits_, views_.own_view(), views_.views(),
                  tile_views_(), static_cast<cl_int>(views_.view_groups()), views_.depths(), layer_depth_(), depth_(), column_end_(),
                  listed_voxels_(), static_cast<cl_int>(listed_count_), directions_(), candidates_());
  if (!is_open()) return;
  allocate_paths();
  lines_.fill(stage, 0, line_numbers());
  commands_.run(stage, "mark_lines", words(), kGroup, grid_, candidates_(), lines_());
}

std::size_t Stages::large_group() const { return commands_.device().is_cpu ? 1 : 64; }

void Stages::list_candidates() {
  const char* stage = "recent_views";
  listed_count_ = lists_.list_bits(stage, candidates_, candidate_words(), listed_voxels_);
  around_.resize(commands_.chunks(listed_count_) * commands_.lanes());
  directions_.resize(commands_.chunks(listed_count_) * 3 * commands_.lanes());
  commands_.run(stage, "find_directions", commands_.chunks(listed_count_), large_group(), grid_, layer_depth_(), observed_(),
                listed_voxels_(), static_cast<cl_int>(listed_count_), around_(), directions_());
}

void Stages::filter_candidates() {
  const char* stage = "creation";
  const std::size_t words = (listed_count_ + 63) / 64;
  kept_bits_.resize(words + 1);
  if (commands_.lanes() == 1) kept_bits_.fill(stage, 0, words);
  commands_.run(stage, "filter_candidates", 64 / commands_.lanes() * words, large_group(), grid_, limits_, listed_voxels_(),
                static_cast<cl_int>(listed_count_), directions_(), candidates_(), static_cast<cl_int>(is_open()), filtered_(),
                kept_bits_());
  created_count_ = lists_.list_bits(stage, kept_bits_, words, created_);
}

std::size_t Stages::remove_surfels() {
  const char* stage = "removal";
  map_.reserve(created_count_);
  new_surfels_.resize(created_count_);
  new_cells_.resize(created_count_);
  const std::size_t pages = map_.window_pages();
  commands_.run(stage, "remove_surfels", pages, kGroup, map_.pages(), static_cast<cl_uint>(pages), removed_bits_(), map_.alive(),
                map_.changed());
  map_.removed(removed_);
  return removed_;
}

std::size_t Stages::create_surfels() {
  const char* stage = "creation";
  commands_.run(stage, "create_surfels", commands_.chunks(created_count_), large_group(), grid_, limits_, window_, T_local_camera_,
                static_cast<cl_int>(config_.refine_surfels), views_.own_view(), views_.views(), tile_views_(),
                static_cast<cl_int>(views_.view_groups()), views_.depths(), layer_depth_(), created_(), static_cast<cl_int>(created_count_),
                listed_voxels_(), around_(), directions_(), new_surfels_(), new_cells_());
  map_.insert(stage, new_surfels_, new_cells_, created_count_);
  return created_count_;
}

void Stages::label_surfels() {
  const std::size_t pages = map_.window_pages();
  commands_.run("labels", "label_surfels", PAGE_SLOTS / commands_.lanes() * pages, PAGE_GROUP, grid_, limits_, window_, T_camera_local_,
                depth_(), column_end_(), color_(), static_cast<cl_int>(has_color_), map_.pages(), static_cast<cl_uint>(pages), map_.alive(),
                map_.changed(), map_.page_block(), map_.surfels());
}

std::vector<BlockKey> Stages::finish_frame() { return map_.finish_frame("labels", frame_); }

}  // namespace frontier_surfels
