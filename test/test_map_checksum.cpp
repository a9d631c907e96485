/// The same map on every device, by numbers that are written down here.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "frontier_surfels/map_checksum.hpp"
#include "frontier_surfels/mapper.hpp"
#include "stages/test_device.hpp"

namespace frontier_surfels {
namespace {

constexpr const char* kMeaning =
    "The map of the same frames is another one. If the method was changed on purpose, put the new number here, and say so in the commit. "
    "If not, this device or this compiler computes in another way, which is a fault: kernels/common/arithmetic.cl says what must hold.";

constexpr int kWidth = 64, kHeight = 48, kFrames = 12;

/// A room with a table by whole numbers alone: no sine, no rounding, the same input on every machine. The camera is in a box of
/// 2.6 x 1.7 m with a block before its end. It moves sideways and forward, and turns in the end.
std::vector<std::uint16_t> room_depth(int frame) {
  const int eye_x = 40 * (frame % 8) - 150, eye_z = 260 * (frame % 8);  // [mm], x right, y down, z forward
  std::vector<std::uint16_t> depth(kWidth * kHeight);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u) {
      const int x = 2 * u - (kWidth - 1), y = 2 * v - (kHeight - 1), f = 2 * 56;  // the pixel's ray, times the same number
      int nearest = 2400 - eye_z;
      const auto meet = [&](int distance, int slope) {  // of a wall beside the ray
        if (slope != 0 && distance * slope > 0) nearest = std::min(nearest, distance * f / slope);
      };
      meet(x > 0 ? 1300 - eye_x : -1300 - eye_x, x);
      meet(y > 0 ? 900 : -800, y);
      const int block = 2300 - eye_z, at_x = x * block / f + eye_x, at_y = y * block / f;
      if (at_x > -250 && at_x < 350 && at_y > 100 && at_y < 900) nearest = std::min(nearest, block);
      depth[v * kWidth + u] = static_cast<std::uint16_t>((u * v) % 97 == 5 ? 0 : nearest);
    }
  return depth;
}

std::vector<std::uint8_t> room_color(int frame) {
  std::vector<std::uint8_t> color;
  for (int n = 0; n < kWidth * kHeight; ++n)
    for (int channel = 1; channel <= 3; ++channel)
      color.push_back(static_cast<std::uint8_t>(17 * channel + n % kWidth + n / kWidth + frame));
  return color;
}

/// Turned by a multiple of a quarter, or by the angle whose cosine is 0.8: all exact, or at least the same everywhere.
Eigen::Isometry3d room_pose(int frame) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = Eigen::Vector3d(0.04 * (frame % 8) - 0.15, 0, 0.26 * (frame % 8));
  Eigen::Matrix3d turn;
  if (frame >= 8) turn << 0.8, 0, 0.6, 0, 1, 0, -0.6, 0, 0.8;
  if (frame >= 10) turn << 0, 0, 1, 0, 1, 0, -1, 0, 0;
  if (frame >= 8) T.linear() = turn;
  return T;
}

struct Mapped {
  std::uint64_t checksum = 0;
  std::size_t surfels = 0, split = 0, removed = 0;
};

Mapped map_room(Config config) {
  Mapper mapper(config);
  EXPECT_TRUE(mapper.take_warnings().empty());
  Mapped mapped;
  for (int n = 0; n < kFrames; ++n) {
    const std::vector<std::uint16_t> depth = room_depth(n);
    const std::vector<std::uint8_t> color = room_color(n);
    DepthFrame frame;
    frame.stamp = n;
    frame.depth = {kWidth, kHeight, kWidth * sizeof(std::uint16_t), DepthImage::Encoding::kStepsU16, depth.data()};
    frame.intrinsics = {56, 56, (kWidth - 1) / 2.0, (kHeight - 1) / 2.0, kWidth, kHeight};
    frame.T_world_camera = room_pose(n);
    frame.color = ColorImage{kWidth, kHeight, 3 * kWidth, ColorImage::Order::kRgb, 3, color.data()};
    const Report report = mapper.integrate(frame);
    mapped.split += report.split;
    mapped.removed += report.removed;
  }
  const std::vector<Surfel> surfels = mapper.surfels();
  mapped.checksum = map_checksum(surfels);
  mapped.surfels = surfels.size();
  return mapped;
}

/// The default method, with few kept views, so that there are seen points as well.
Config room_config() {
  Config config = test_config();
  config.decimation = 1;
  config.recent_views = 3;
  return config;
}

TEST(MapChecksum, OfTheRoom) {
  const Mapped mapped = map_room(room_config());
  EXPECT_GT(mapped.removed, 0u);
  EXPECT_GT(mapped.split, 0u);
  EXPECT_GT(mapped.surfels, 3000u);
  EXPECT_EQ(checksum_text(mapped.checksum), "fd4ce6279fdee876") << kMeaning;
}

TEST(MapChecksum, OfTheRoomByThePapersMethod) {
  const char* carried = std::getenv("FRONTIER_SURFELS_TEST_CONFIG");  // on machines without this package's sources
  Config config = load_config(std::string(carried == nullptr ? FRONTIER_SURFELS_SOURCE_DIR "/config" : carried) + "/paper.yaml");
  config.platform = room_config().platform;
  config.lanes = room_config().lanes;
  config.decimation = 1;
  EXPECT_EQ(checksum_text(map_room(config).checksum), "b349c242bd93717b") << kMeaning;
}

TEST(MapChecksum, OnOneThread) {
  if (!can_be_divided(test_device())) GTEST_SKIP() << "The device cannot be divided.";
  Config config = room_config();
  const std::uint64_t whole = map_room(config).checksum;
  config.threads = 1;
  EXPECT_EQ(map_room(config).checksum, whole);
}

TEST(MapChecksum, AtTheOtherWidth) {
  Config config = room_config();
  if (!choose_device(config).is_pocl_cpu) GTEST_SKIP() << "Vectors take this device's compiler too long: only PoCL has both widths.";
  const std::uint64_t own = map_room(config).checksum;
  config.lanes = choose_device(config).lanes == 16 ? 1 : 16;
  EXPECT_EQ(map_room(config).checksum, own);
}

TEST(MapChecksum, HasEveryBitOfASurfelAndNotTheirOrder) {
  Surfel first, second;
  first.position = {1, 2, 3};
  second.position = {2, 1, 3};
  second.radius = 0.25F;
  EXPECT_EQ(map_checksum({}), 0u);
  EXPECT_EQ(map_checksum({first, second}), map_checksum({second, first}));
  EXPECT_NE(map_checksum({first, first}), map_checksum({second, second}));
  const std::uint64_t sum = map_checksum({first});
  const auto expect_other = [&](auto&& change) {
    Surfel changed = first;
    change(changed);
    EXPECT_NE(map_checksum({changed}), sum);
  };
  for (int n = 0; n < 3; ++n) {
    expect_other([n](Surfel& s) { s.position[n] = std::nextafter(s.position[n], 9.0F); });
    expect_other([n](Surfel& s) { s.normal[n] += 1e-7F; });
    expect_other([n](Surfel& s) { s.rgb[n] ^= 1; });
  }
  expect_other([](Surfel& s) { s.radius = 1e-6F; });
  expect_other([](Surfel& s) { s.label = Label::kOccupied; });
  expect_other([](Surfel& s) { std::swap(s.position.x(), s.position.y()); });
  first.id = 7;
  EXPECT_EQ(map_checksum({first}), sum);
  EXPECT_EQ(checksum_text(0x0123456789abcdefU), "0123456789abcdef");
}

}  // namespace
}  // namespace frontier_surfels
