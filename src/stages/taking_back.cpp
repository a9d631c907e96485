#include "stages/taking_back.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "frame/wide_vectors.hpp"

namespace frontier_surfels {
namespace {

constexpr const char* kStage = "taking_back";

/// Is any depth from the one to the other column, or that of a ray without a return, larger? Without a way out of the loop, so that the
/// compiler makes vectors of it.
WIDE_VECTORS bool any_beyond(const float* depth, int first, int last, float near) {
  int any = 0;
  for (int s = first; s <= last; ++s) any |= std::abs(depth[s]) > near ? 1 : 0;
  return any != 0;
}

}  // namespace

TakeBackLimits make_take_back_limits(const Config& config) {
  TakeBackLimits limits = {};
  limits.noise = static_cast<float>(config.noise);
  limits.noise_growth = static_cast<float>(config.noise_growth);
  limits.quantisation = static_cast<float>(config.quantisation);
  limits.support_margin = 2;
  limits.weak_margin = 3;
  limits.strong_margin = 6;
  limits.reach = 16;
  limits.weak_supports = 3;
  limits.strong_supports = 5;
  limits.contradictions = 3;
  limits.opinions = 8;
  limits.newer_opinions = 16;
  return limits;
}

TakingBack::TakingBack(Commands& commands, const Config& config, double block_size)
    : commands_(commands),
      limits_(make_take_back_limits(config)),
      is_on_(config.take_back && config.seen_points),
      taken_(commands, block_size),
      images_(commands),
      frame_views_(commands),
      older_views_(commands),
      taken_by_(commands),
      coarse_(commands),
      evidence_(commands),
      squares_(commands),
      chosen_(commands),
      states_(commands),
      chosen_count_(commands) {}

void TakingBack::clear() {
  last_frames_.clear();
  pixels_ = 0;
  frames_since_ = LAST_FRAMES;
  changed_bricks_.clear();
  taken_.clear();
  changed_.clear();
}

void TakingBack::open_window(const MapWindow& window, const SeenPoints& seen) {
  if (!is_on_) return;
  taken_.choose_spacing(seen.spacing());
  if (taken_.shift() != seen.shift()) {  // points of another lattice are of no use
    for (const BlockKey& block : taken_.blocks_with_points()) changed_.push_back(block);
    taken_.clear();
    taken_.choose_spacing(seen.spacing());
  }
  if (!taken_.empty()) taken_.open_window(window);
}

void TakingBack::look(const Camera& camera, const RecentViews& views, const SeenPoints& seen, Frame* frame) {
  if (!is_on_) return;
  changed_bricks_.clear();  // of a frame that failed: they keep words of their own
  frame->has_taken = taken_.empty() ? 0 : 1;
  chosen_count_.resize(1);
  chosen_count_.fill(kStage, 0, 1);
  find_evidence(*frame, camera, views, seen);
  chosen_count_now_ = chosen_count_.read_later(1);
}

std::size_t TakingBack::update(const Camera& camera, const MapWindow& window, const WorkingImage& image, const RecentViews& views,
                               Frame* frame) {
  if (!is_on_) return 0;
  commands_.wait();
  settle_bricks();
  const std::size_t count = chosen_count_now_->front();
  if (count == 0 && taken_.empty()) return pixels_;
  const std::vector<cl_uchar> chosen = count > 0 ? chosen_.read(image.depth.size()) : std::vector<cl_uchar>();
  pixels_ = std::max(pixels_, count);  // before anything is changed
  std::vector<Brick> bricks = bricks_to_change(*frame, window, image, chosen, bricks_with_points(window));
  if (!bricks.empty()) {
    change_bricks(*frame, camera, views, window, count > 0, std::move(bricks));
    commands_.wait();
    settle_bricks();
    taken_.open_window(window);
  }
  frame->has_taken = has_points(window) ? 1 : 0;
  frame->takes_back = pixels_ > 0 ? 1 : 0;
  return pixels_;
}

std::size_t TakingBack::give_back(const Camera& camera, const MapWindow& window, const WorkingImage& image, const RecentViews& views,
                                  Frame* frame) {
  if (!has_taken()) return pixels_;
  const std::vector<Brick> with_points = bricks_with_points(window);
  std::vector<Brick> bricks = bricks_to_change(*frame, window, image, {}, with_points);
  if (!bricks.empty()) change_bricks(*frame, camera, views, window, false, std::move(bricks));  // all in blocks that had tables
  frame->has_taken = with_points.empty() ? 0 : 1;
  frame->takes_back = pixels_ > 0 ? 1 : 0;
  return pixels_;
}

bool TakingBack::must_update() {
  if (!is_on_) return false;
  settle_bricks();
  return chosen_count_now_->front() > 0;
}

/// The bricks of the window that have taken points.
std::vector<TakingBack::Brick> TakingBack::bricks_with_points(const MapWindow& window) const {
  if (taken_.empty()) return {};  // then no window was opened
  const int sides = 1 << taken_.shift();
  const Window& w = window.window();
  std::vector<Brick> bricks;
  for (int cell = 0; cell < window.cells(); ++cell) {
    const int table = taken_.window_table(cell);
    if (table == 0) continue;
    for (const int brick : taken_.bricks_with_points(table))
      bricks.push_back({table,
                        brick,
                        {{cell % w.size_x * sides + brick % sides, cell / w.size_x % w.size_y * sides + brick / sides % sides,
                          cell / w.size_x / w.size_y * sides + brick / sides / sides, 0}}});
  }
  return bricks;
}

/// Has any block of the window taken points?
bool TakingBack::has_points(const MapWindow& window) const {
  if (taken_.empty()) return false;  // then no window was opened
  for (int cell = 0; cell < window.cells(); ++cell)
    if (const int table = taken_.window_table(cell); table != 0 && taken_.has_points(table)) return true;
  return false;
}

/// Chooses the pixels whose surface takes space back, and counts them.
void TakingBack::find_evidence(const Frame& frame, const Camera& camera, const RecentViews& views, const SeenPoints& seen) {
  const auto across = [](int size) { return static_cast<std::size_t>((size + TAKE_SQUARE - 1) / TAKE_SQUARE); };
  const std::size_t coarse = across(frame.grid.width) * across(frame.grid.height);
  const std::size_t rows = frame.grid.height, pixels = frame.grid.width * rows;
  coarse_.resize(coarse);  // in the first frame already, so that the memory in use does not grow later
  for (DeviceArray<cl_uchar>* all : {&evidence_, &squares_, &chosen_}) all->resize(pixels);
  if (last_frames_.size() < static_cast<std::size_t>(limits_.weak_supports)) return;
  std::vector<View> last, older = views.views_before(last_frames_.back().number);
  if (older.empty() && frame.has_seen == 0) return;
  for (const LastFrame& other : last_frames_) {
    last.push_back(views.view_from_current(other.intrinsics, other.T_world_camera));
    last.back().first_pixel = static_cast<std::uint32_t>(other.room * room_size_);
  }
  frame_views_.send(std::move(last));
  older_count_ = static_cast<cl_int>(older.size());
  older_views_.send(std::move(older));

  const auto weigh = [&](std::size_t chunks, int step, const DeviceArray<cl_uchar>& evidence) {
    commands_.run(kStage, "weigh_evidence", chunks * commands_.shape().view_team, commands_.shape().heavy_group, frame, limits_,
                  camera.depth()(), frame_views_(), static_cast<cl_int>(last_frames_.size()), images_(), older_views_(), older_count_,
                  views.depths(), seen.slots(), seen.tables(), seen.brick_words(), taken_.slots(), taken_.tables(), taken_.brick_words(),
                  static_cast<cl_int>(step), coarse_(), evidence());
  };
  weigh(commands_.chunks(coarse), TAKE_SQUARE, coarse_);
  weigh(commands_.chunks(frame.grid.width) * rows, 1, evidence_);
  commands_.run(kStage, "find_squares", pixels, kGroup, frame, evidence_(), squares_());
  commands_.run(kStage, "choose_pixels", pixels, kGroup, frame, evidence_(), squares_(), chosen_(), chosen_count_());
}

/// May this frame see something of a cube? @param center  camera frame [m]; radius: of the sphere around the cube [m]
bool TakingBack::may_see(const WorkingImage& image, const Eigen::Vector3d& center, double radius) const {
  const double near = center.z() - radius, far = center.z() + radius;
  if (far <= 0) return false;
  if (near <= 0.01) return true;
  const auto range = [&](double x, double f, double c, int size) {
    const auto high = [&](double side) { return c + f * std::max(side / near, side / far); };
    const auto low = [&](double side) { return c + f * std::min(side / near, side / far); };
    return std::pair(static_cast<int>(std::max(std::floor(low(x - radius)), 0.0)),
                     static_cast<int>(std::min(std::ceil(high(x + radius)), size - 1.0)));
  };
  const Intrinsics& camera = image.intrinsics;
  const auto [left, right] = range(center.x(), camera.fx, camera.cx, camera.width);
  const auto [top, bottom] = range(center.y(), camera.fy, camera.cy, camera.height);
  for (int t = top; t <= bottom; ++t)
    if (any_beyond(&image.depth[static_cast<std::size_t>(t) * camera.width], left, right, static_cast<float>(near))) return true;
  return false;
}

/// Places, counted in bricks from the window's corner, that the points behind chosen pixels may lie in; sorted.
std::vector<TakingBack::Place> TakingBack::places_behind(const Grid& g, const MapWindow& window, const WorkingImage& image,
                                                         const std::vector<cl_uchar>& chosen) const {
  const Eigen::Isometry3d T_local_camera = window.T_camera_local().inverse();
  const Eigen::Matrix3d R = T_local_camera.linear();
  const Intrinsics& camera = image.intrinsics;
  const Eigen::Array3d half_pixel = (R.col(0).cwiseAbs() / camera.fx + R.col(1).cwiseAbs() / camera.fy) / 2;  // at the depth 1
  const double brick_size = SEEN_BRICK * taken_.spacing();
  std::vector<Place> behind;
  Eigen::Array3i first_before(0, 0, 0), last_before(-1, -1, -1);
  for (auto next = std::find(chosen.begin(), chosen.end(), 1); next != chosen.end(); next = std::find(next + 1, chosen.end(), 1)) {
    const auto n = static_cast<std::size_t>(next - chosen.begin());
    const double s = static_cast<double>(n % g.width) - camera.cx, t = static_cast<double>(n / g.width) - camera.cy;
    const double near = image.depth[n], far = near + limits_.reach * std::max(near, static_cast<double>(g.z_min)) / g.f;
    const Eigen::Array3d ray = R * Eigen::Vector3d(s / camera.fx, t / camera.fy, 1), origin = T_local_camera.translation();
    const Eigen::Array3d low = ray - half_pixel, high = ray + half_pixel;  // of a box around the pixel's pyramid, at the depth 1
    const Eigen::Array3i first = ((origin + (near * low).min(far * low)) / brick_size).floor().cast<int>(),
                         last = ((origin + (near * high).max(far * high)) / brick_size).floor().cast<int>();
    if ((first == first_before).all() && (last == last_before).all()) continue;  // neighbours mostly have the same places
    first_before = first;
    last_before = last;
    for (int z = first.z(); z <= last.z(); ++z)
      for (int y = first.y(); y <= last.y(); ++y)
        for (int x = first.x(); x <= last.x(); ++x) behind.push_back({x, y, z});
  }
  std::sort(behind.begin(), behind.end());
  behind.erase(std::unique(behind.begin(), behind.end()), behind.end());
  return behind;
}

/// The bricks of the window with taken points of which this frame may see something, and those that may get some behind chosen pixels.
std::vector<TakingBack::Brick> TakingBack::bricks_to_change(const Frame& frame, const MapWindow& window, const WorkingImage& image,
                                                            const std::vector<cl_uchar>& chosen, const std::vector<Brick>& with_points) {
  const std::vector<Place> behind = places_behind(frame.grid, window, image, chosen);
  const double brick_size = SEEN_BRICK * taken_.spacing();
  std::vector<Brick> bricks;
  for (const Brick& brick : with_points) {
    const Place place = {brick.place.s[0], brick.place.s[1], brick.place.s[2]};
    const Eigen::Vector3d middle = Eigen::Vector3d(place[0], place[1], place[2]).array() + 0.5;
    if (!std::binary_search(behind.begin(), behind.end(), place) &&
        may_see(image, window.T_camera_local() * (middle * brick_size), std::sqrt(0.75) * brick_size + 1e-3))
      bricks.push_back(brick);
  }
  const int shift = taken_.shift(), sides = 1 << shift;
  const Window& w = window.window();
  for (const auto& [x, y, z] : behind) {
    if (x < 0 || y < 0 || z < 0 || x >= w.size_x << shift || y >= w.size_y << shift || z >= w.size_z << shift) continue;
    const int cell = ((z >> shift) * w.size_y + (y >> shift)) * w.size_x + (x >> shift);
    const int brick = ((z & (sides - 1)) << 2 * shift) | ((y & (sides - 1)) << shift) | (x & (sides - 1));
    bricks.push_back({taken_.table(window.block(cell)), brick, {{x, y, z, 0}}});
  }
  return bricks;
}

/// Sets and clears the points of bricks, which get words of their own for that. settle_bricks() must follow, once the host has waited.
/// @param has_chosen  if not, and pixels were chosen all the same, no point is changed
void TakingBack::change_bricks(const Frame& frame, const Camera& camera, const RecentViews& views, const MapWindow& window, bool has_chosen,
                               std::vector<Brick> bricks) {
  std::vector<cl_int4> taken_by;
  const Window& w = window.window();
  for (const Brick& b : bricks) {
    const auto block = [&](int axis) { return b.place.s[axis] >> taken_.shift(); };
    const BlockKey key = {w.origin_x + block(0), w.origin_y + block(1), w.origin_z + block(2)};
    if (changed_.empty() || changed_.back() != key) changed_.push_back(key);
    taken_by.push_back(b.place);
    taken_by.back().s[3] = taken_.own_brick(b.table, b.brick);
  }
  taken_.send_entries(kStage);
  const auto count = static_cast<cl_int>(bricks.size());
  taken_by_.send(std::move(taken_by));
  states_.resize(bricks.size());
  const cl::Buffer& chosen = has_chosen ? chosen_() : camera.depth()();  // a kernel takes no missing buffer
  commands_.run(kStage, "take_points", taken_.cubes(bricks.size()), commands_.shape().heavy_group, frame, limits_,
                views.own_view_from(window.T_camera_local()), views.depths(), camera.depth()(), static_cast<cl_int>(has_chosen), chosen,
                chosen_count_(), taken_by_(), count, taken_.brick_words());
  commands_.run(kStage, "find_brick_states", count, kGroup, taken_by_(), count, taken_.brick_words(), states_());
  states_now_ = states_.read_later(bricks.size());
  changed_bricks_ = std::move(bricks);
}

/// Bricks that have become uniform need no words of their own. The host has waited for their states.
void TakingBack::settle_bricks() {
  for (std::size_t n = 0; n < changed_bricks_.size(); ++n) {
    const cl_uchar state = (*states_now_)[n];
    if (state != SEEN_MIXED) taken_.set_uniform(changed_bricks_[n].table, changed_bricks_[n].brick, state == SEEN_ALL);
  }
  changed_bricks_.clear();
}

void TakingBack::add_to_last_frames(const Camera& camera, const WorkingImage& image, const Eigen::Isometry3d& T_world_camera,
                                    std::uint64_t number) {
  if (!is_on_) return;
  const std::size_t pixels = image.depth.size();
  if (pixels > room_size_) {
    images_.allocate(LAST_FRAMES * pixels);
    last_frames_.clear();
    room_size_ = pixels;
  }
  const bool is_full = last_frames_.size() == LAST_FRAMES;
  const std::size_t room = is_full ? last_frames_.back().room : last_frames_.size();
  images_.copy_from(camera.depth()(), pixels, room * room_size_);
  if (is_full) last_frames_.pop_back();
  last_frames_.push_front({image.intrinsics, T_world_camera, room, number});
  frames_since_ = pixels_ > 0 ? 0 : std::min<std::size_t>(frames_since_ + 1, LAST_FRAMES);
  pixels_ = 0;
}

}  // namespace frontier_surfels
