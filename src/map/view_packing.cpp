#include "map/view_packing.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <iterator>

namespace frontier_surfels {
namespace {

struct Head {
  std::array<double, kViewNumbers> numbers;
  std::int32_t width, height;
};
static_assert(sizeof(Head) == 17 * 8 + 2 * 4);

}  // namespace

void check_view(const SavedView& view) {
  const Intrinsics& camera = view.intrinsics;
  const Eigen::Matrix3d R = view.T_world_camera.linear();
  const double positive[] = {camera.fx, camera.fy, view.depth_step};
  const bool is_sound = view.T_world_camera.matrix().allFinite() && (R * R.transpose()).isIdentity(1e-6) && std::isfinite(camera.cx) &&
                        std::isfinite(camera.cy) &&
                        std::all_of(std::begin(positive), std::end(positive), [](double x) { return std::isfinite(x) && x > 0; }) &&
                        camera.width > 0 && camera.height > 0 &&
                        view.depth.size() == static_cast<std::uint64_t>(camera.width) * static_cast<std::uint64_t>(camera.height);
  if (!is_sound) throw FileError("A kept view of the map has no camera, pose or depths: use another copy.");
}

std::vector<std::uint8_t> pack_view(const SavedView& view) {
  Head head = {};
  const Intrinsics& camera = view.intrinsics;
  Eigen::Map<Eigen::Matrix<double, 3, 4>>(head.numbers.data()) = view.T_world_camera.matrix().topRows<3>();
  const double others[] = {camera.fx, camera.fy, camera.cx, camera.cy, view.depth_step};
  std::copy(std::begin(others), std::end(others), head.numbers.begin() + 12);
  head.width = camera.width;
  head.height = camera.height;
  const auto count = static_cast<std::uint32_t>(view.depth.size());
  const std::size_t depth_bytes = count * sizeof(std::uint16_t);
  std::vector<std::uint8_t> bytes(sizeof head + sizeof count + depth_bytes);
  std::memcpy(&bytes[0], head.numbers.data(), sizeof head.numbers);
  std::memcpy(&bytes[sizeof head.numbers], &head.width, sizeof head.width + sizeof head.height);
  std::memcpy(&bytes[sizeof head], &count, sizeof count);
  if (count > 0) std::memcpy(&bytes[sizeof head + sizeof count], view.depth.data(), depth_bytes);
  return bytes;
}

SavedView unpack_view(const std::uint8_t* bytes, std::size_t size, std::size_t* used) {
  Head head;
  std::uint32_t count = 0;
  if (size < sizeof head + sizeof count) throw FileError("A kept view of the map is cut off: use another copy.");
  std::memcpy(&head, bytes, sizeof head);
  std::memcpy(&count, bytes + sizeof head, sizeof count);
  if ((size - sizeof head - sizeof count) / sizeof(std::uint16_t) < count)
    throw FileError("A kept view of the map is cut off: use another copy.");
  SavedView view;
  view.T_world_camera.matrix().topRows<3>() = Eigen::Map<const Eigen::Matrix<double, 3, 4>>(head.numbers.data());
  view.intrinsics = {head.numbers[12], head.numbers[13], head.numbers[14], head.numbers[15], head.width, head.height};
  view.depth_step = head.numbers[16];
  view.depth.resize(count);
  if (count > 0) std::memcpy(view.depth.data(), bytes + sizeof head + sizeof count, count * sizeof(std::uint16_t));
  check_view(view);
  *used = sizeof head + sizeof count + count * sizeof(std::uint16_t);
  return view;
}

}  // namespace frontier_surfels
