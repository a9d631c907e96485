#include "frame/recent_views.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "frame/wide_vectors.hpp"
#include "frontier_surfels/number_text.hpp"

namespace frontier_surfels {
namespace {

/// A depth in steps, rounded down, so that nothing counts as seen that was not. z_max may be one step more than 16 bits hold.
cl_ushort to_steps(float depth, float per_step) {
  const float steps = std::abs(depth) * per_step;
  return static_cast<cl_ushort>(steps < 65535.0F ? steps : 65535.0F);
}

constexpr int kPatch = PATCH_COLUMNS * PATCH_ROWS;

int patches(int pixels, int side) { return (pixels + side - 1) / side; }

/// Number of elements that an image takes. A room has whole patches: those of the next room must not cross cache lines, and pixels are read
/// in pairs.
std::size_t room_for(int width, int height) {
  const auto count = [&](int columns, int rows) { return static_cast<std::size_t>(patches(width, columns)) * patches(height, rows); };
  const std::size_t depths = count(PATCH_COLUMNS, PATCH_ROWS) * kPatch, of_blocks = 2 * count(VIEW_BLOCK, VIEW_BLOCK);
  return (depths + of_blocks + kPatch - 1) / kPatch * kPatch;
}

/// Writes a row of an image, in steps, into its patches, which are kPatch elements apart.
void write_row(const float* depth, int width, float per_step, cl_ushort* patch) {
  int s = 0;
  for (; s + PATCH_COLUMNS <= width; s += PATCH_COLUMNS, patch += kPatch)
    for (int n = 0; n < PATCH_COLUMNS; ++n) patch[n] = to_steps(depth[s + n], per_step);
  for (int n = 0; s + n < width; ++n) patch[n] = to_steps(depth[s + n], per_step);
}

/// Largest and smallest depth of each column of a row of blocks.
class Extremes {
 public:
  explicit Extremes(int width) : width_(width), largest_(patches(width, VIEW_BLOCK) * VIEW_BLOCK), smallest_(largest_.size()) {}

  void clear() {
    std::fill(largest_.begin(), largest_.end(), 0.0F);
    std::fill(smallest_.begin(), smallest_.end(), std::numeric_limits<float>::infinity());
  }

  void add_row(const float* depth) {
    float* __restrict__ largest = largest_.data(), * __restrict__ smallest = smallest_.data();
    for (int s = 0; s < width_; ++s) {
      const float d = std::abs(depth[s]);
      largest[s] = std::max(largest[s], d);
      smallest[s] = std::min(smallest[s], d);
    }
  }

  /// Those of the blocks, in steps. @return the largest of all [m]
  float write_blocks(float per_step, cl_ushort* largest, cl_ushort* smallest) const {
    float deepest = 0;
    for (std::size_t column = 0; column < largest_.size(); column += VIEW_BLOCK) {
      float high = largest_[column], low = smallest_[column];
      for (std::size_t n = column + 1; n < column + VIEW_BLOCK; ++n) {
        high = std::max(high, largest_[n]);
        low = std::min(low, smallest_[n]);
      }
      *largest++ = to_steps(high, per_step);
      *smallest++ = to_steps(low, per_step);
      deepest = std::max(deepest, high);
    }
    return deepest;
  }

 private:
  int width_;
  std::vector<float> largest_, smallest_;
};

/// A view's depths in the kernels' layout: patch by patch, in steps, without signs, then the largest and the smallest ones of the blocks.
/// Pixels beyond the image's edges are 0.
struct KeptDepths {
  std::vector<cl_ushort> depths;  ///< of a room
  float deepest = 0;              ///< [m]
};

WIDE_VECTORS KeptDepths kept_depths(const WorkingImage& image, float per_step) {
  const int width = image.intrinsics.width, height = image.intrinsics.height, columns = patches(width, PATCH_COLUMNS),
            across = patches(width, VIEW_BLOCK);
  KeptDepths kept = {std::vector<cl_ushort>(room_for(width, height)), 0};
  cl_ushort* largest = &kept.depths[static_cast<std::size_t>(columns) * patches(height, PATCH_ROWS) * kPatch];
  cl_ushort* smallest = largest + static_cast<std::ptrdiff_t>(across) * patches(height, VIEW_BLOCK);
  Extremes extremes(width);
  for (int first = 0; first < height; first += VIEW_BLOCK, largest += across, smallest += across) {
    extremes.clear();
    for (int t = first; t < std::min(first + VIEW_BLOCK, height); ++t) {
      const float* depth = &image.depth[static_cast<std::size_t>(t) * width];
      write_row(depth, width, per_step,
                &kept.depths[static_cast<std::size_t>(t / PATCH_ROWS) * columns * kPatch + t % PATCH_ROWS * PATCH_COLUMNS]);
      extremes.add_row(depth);
    }
    kept.deepest = std::max(kept.deepest, extremes.write_blocks(per_step, largest, smallest));
  }
  return kept;
}

Transform to_transform(const Eigen::Matrix<double, 3, 4>& matrix) {
  const Eigen::Matrix<float, 3, 4> m = matrix.cast<float>();
  return {m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0), m(2, 1), m(2, 2), m(0, 3), m(1, 3), m(2, 3)};
}

/// Projection from the camera to the image, shifted by half a pixel: coordinates rounded down are the nearest pixel.
Eigen::Matrix3d projection(const Intrinsics& camera) {
  Eigen::Matrix3d K;
  K << camera.fx, 0, camera.cx + 0.5, 0, camera.fy, camera.cy + 0.5, 0, 0, 1;
  return K;
}

/// Writes a view into its lane of a group, lane[VIEW_LANE_FIELDS][VIEW_GROUP]. @param lane  the view's first number
void set_lane(const Eigen::Isometry3d& T_view_camera, const Intrinsics& camera, std::uint32_t first_pixel, float* lane) {
  const auto set = [lane](int field, double value) { lane[field * VIEW_GROUP] = static_cast<float>(value); };
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) set(VIEW_LANE_R00 + 3 * row + column, T_view_camera.linear()(row, column));
    set(VIEW_LANE_T0 + row, T_view_camera.translation()[row]);
  }
  set(VIEW_LANE_FX, camera.fx);
  set(VIEW_LANE_FY, camera.fy);
  set(VIEW_LANE_CX, camera.cx);
  set(VIEW_LANE_CY, camera.cy);
  set(VIEW_LANE_WIDTH, camera.width);
  set(VIEW_LANE_HEIGHT, camera.height);
  std::memcpy(&lane[VIEW_LANE_FIRST_PIXEL * VIEW_GROUP], &first_pixel, sizeof(first_pixel));
}

/// An order of the kept views in which each is far from the ones before it. Then a few views already find most points that any view knows.
/// Multiples of the golden ratio are spread like this.
std::vector<std::size_t> spread(std::size_t count) {
  constexpr double kGolden = 0.6180339887498949;
  std::vector<std::size_t> order;
  std::vector<bool> taken(count, false);
  for (std::size_t n = 0; n < count; ++n) {
    std::size_t at = static_cast<std::size_t>(std::fmod(n * kGolden, 1.0) * count);
    while (taken[at]) at = (at + 1) % count;
    taken[at] = true;
    order.push_back(at);
  }
  return order;
}

}  // namespace

double depth_step_for(double z_max) { return std::exp2(std::ceil(std::log2(z_max / 65536))); }

Transform to_transform(const Eigen::Isometry3d& T) { return to_transform(Eigen::Matrix<double, 3, 4>(T.matrix().topRows<3>())); }

RecentViews::RecentViews(Commands& commands, const Config& config)
    : config_(config),
      depth_step_(depth_step_for(config.z_max)),
      complete_(config.recent_views > 0),
      views_(commands),
      view_lanes_(commands),
      depths_(commands) {}

void RecentViews::clear(bool map_is_empty) {
  kept_.clear();
  forgotten_.reset();
  complete_ = map_is_empty && config_.recent_views > 0;
}

void RecentViews::set_current(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera) {
  KeptDepths kept = kept_depths(image, static_cast<float>(1 / depth_step_));
  if (kept.depths.size() > room_size_) enlarge_rooms(kept.depths.size());
  current_ = {image.intrinsics, T_world_camera, free_room(), kept.deepest, ++last_number_};
  forgotten_.reset();
  depths_.send(std::move(kept.depths), current_.room * room_size_);
}

void RecentViews::make_room(const std::vector<SavedView>& views) {
  std::size_t size = 0;
  for (const SavedView& view : views) size = std::max(size, room_for(view.intrinsics.width, view.intrinsics.height));
  if (size <= room_size_) return;
  if (const std::string fault = excess(size); !fault.empty()) throw FileError(fault + "lower recent_views.");
  enlarge_rooms(size);
}

/// The begin of a sentence if rooms of this size cannot be had, else empty.
std::string RecentViews::excess(std::size_t size) const {
  const double pixels = (config_.recent_views + 1.0) * static_cast<double>(size);
  if (pixels <= std::numeric_limits<std::int32_t>::max()) return "";  // pixels are numbered with 32 bits
  return "The " + std::to_string(config_.recent_views) + " kept views would have " + fixed_text(pixels * 1e-9, 6) +
         " billion pixels, more than 2 billion; ";
}

/// Makes every room larger; the kept images are copied, and that of a forgotten view.
void RecentViews::enlarge_rooms(std::size_t size) {
  const std::size_t rooms = config_.recent_views + 1;
  if (const std::string fault = excess(size); !fault.empty()) throw BadFrame(fault + "raise decimation or lower recent_views.");
  std::size_t used = 0;
  for (const Kept& kept : kept_) used = std::max(used, kept.room + 1);
  if (forgotten_) used = std::max(used, forgotten_->room + 1);
  depths_.widen_rows(rooms, used, room_size_, size);
  room_size_ = size;
}

std::size_t RecentViews::free_room() const {
  std::vector<bool> taken(config_.recent_views + 1, false);
  for (const Kept& kept : kept_) taken[kept.room] = true;
  return static_cast<std::size_t>(std::find(taken.begin(), taken.end(), false) - taken.begin());
}

View RecentViews::to_view(const Kept& kept, const Eigen::Isometry3d& T_view_camera) const {
  View view = {};
  view.to_image = to_transform(Eigen::Matrix<double, 3, 4>(projection(kept.intrinsics) * T_view_camera.matrix().topRows<3>()));
  view.width = kept.intrinsics.width;
  view.height = kept.intrinsics.height;
  view.first_pixel = static_cast<std::uint32_t>(kept.room * room_size_);
  view.depth_step = static_cast<float>(depth_step_);
  return view;
}

View RecentViews::own_view() const { return to_view(current_, Eigen::Isometry3d::Identity()); }

View RecentViews::view_from_current(const Intrinsics& intrinsics, const Eigen::Isometry3d& T_world_camera) const {
  return to_view({intrinsics, T_world_camera, 0, 0, 0}, T_world_camera.inverse() * current_.T_world_camera);
}

std::vector<View> RecentViews::views_before(std::uint64_t number) const {
  std::vector<View> views;
  for (const Kept& kept : kept_)
    if (kept.number < number) views.push_back(to_view(kept, kept.T_world_camera.inverse() * current_.T_world_camera));
  return views;
}

int RecentViews::prepare(const Eigen::Isometry3d& T_world_frame, std::uint64_t after) {
  const auto newer = static_cast<std::size_t>(
      std::find_if(kept_.begin(), kept_.end(), [&](const Kept& kept) { return kept.number <= after; }) - kept_.begin());
  std::vector<View> views;
  std::vector<float> lanes(view_groups() * VIEW_LANE_FIELDS * VIEW_GROUP, 0.0F);
  for (const std::size_t number : spread(newer)) {
    const Kept& kept = kept_[number];
    const Eigen::Isometry3d T_view_frame = kept.T_world_camera.inverse() * T_world_frame;
    const std::size_t n = views.size();
    views.push_back(to_view(kept, T_view_frame));
    set_lane(T_view_frame, kept.intrinsics, views[n].first_pixel, &lanes[n / VIEW_GROUP * VIEW_LANE_FIELDS * VIEW_GROUP + n % VIEW_GROUP]);
  }
  views_.send(std::move(views));
  view_lanes_.send(std::move(lanes));
  return static_cast<int>(newer);
}

bool RecentViews::differs_enough() const {
  const double cos_angle = std::cos(config_.recent_view_angle * M_PI / 180);
  return std::none_of(kept_.begin(), kept_.end(), [&](const Kept& kept) {
    if (!same_camera(kept.intrinsics, current_.intrinsics)) return false;
    const Eigen::Isometry3d motion = kept.T_world_camera.inverse() * current_.T_world_camera;
    const double cos_turn = (motion.linear().trace() - 1) / 2;
    return motion.translation().norm() < config_.recent_view_distance && cos_turn > cos_angle;
  });
}

void RecentViews::forget(const Kept& view) {
  if (config_.seen_points && view.deepest > 0) forgotten_ = ForgottenView{view.intrinsics, view.T_world_camera, view.room, view.deepest};
}

bool RecentViews::keep_current() {
  if (config_.recent_views > 0 && differs_enough()) {
    keep();
    return true;
  }
  forget(current_);
  return false;
}

void RecentViews::keep() {
  if (config_.recent_views == 0) return forget(current_);
  if (kept_.size() == static_cast<std::size_t>(config_.recent_views)) {
    forget(kept_.back());
    kept_.pop_back();
    complete_ = false;
  }
  kept_.push_front(current_);
}

std::vector<std::uint64_t> RecentViews::numbers() const {
  std::vector<std::uint64_t> numbers;
  for (auto kept = kept_.rbegin(); kept != kept_.rend(); ++kept) numbers.push_back(kept->number);
  return numbers;
}

std::vector<std::pair<Intrinsics, Eigen::Isometry3d>> RecentViews::cameras() const {
  std::vector<std::pair<Intrinsics, Eigen::Isometry3d>> cameras;
  for (auto kept = kept_.rbegin(); kept != kept_.rend(); ++kept) cameras.emplace_back(kept->intrinsics, kept->T_world_camera);
  return cameras;
}

SavedView RecentViews::saved(std::uint64_t number) const {
  const auto kept = std::find_if(kept_.begin(), kept_.end(), [&](const Kept& view) { return view.number == number; });
  const int width = kept->intrinsics.width, height = kept->intrinsics.height, columns = patches(width, PATCH_COLUMNS);
  const std::vector<cl_ushort> room =
      depths_.read(static_cast<std::size_t>(columns) * patches(height, PATCH_ROWS) * kPatch, kept->room * room_size_);
  SavedView view = {kept->intrinsics, kept->T_world_camera, depth_step_, {}};
  for (int t = 0; t < height; ++t)
    for (int s = 0; s < width; ++s)
      view.depth.push_back(room[(static_cast<std::size_t>(t / PATCH_ROWS) * columns + s / PATCH_COLUMNS) * kPatch +
                                t % PATCH_ROWS * PATCH_COLUMNS + s % PATCH_COLUMNS]);
  return view;
}

View RecentViews::view_of(const ForgottenView& view, const Eigen::Isometry3d& T_camera_local) const {
  return to_view({view.intrinsics, view.T_world_camera, view.room, view.deepest, 0}, T_camera_local);
}

}  // namespace frontier_surfels
