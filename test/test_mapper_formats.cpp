/// The same image in another format makes the same map, bit by bit.
#include <gtest/gtest.h>

#include "mapper_input.hpp"

namespace frontier_surfels {
namespace {

/// How an image lies in memory.
struct Layout {
  std::size_t padding = 0;  ///< bytes of rubbish behind every row
  std::size_t offset = 0;   ///< bytes of rubbish before the first row
  bool swap_bytes = false;
};

/// The bytes of an image in a given layout.
class Bytes {
 public:
  Bytes(const cv::Mat& image, const Layout& layout) : offset_(layout.offset), step_(image.cols * image.elemSize() + layout.padding) {
    bytes_.assign(offset_ + step_ * image.rows, 0xA5);
    for (int row = 0; row < image.rows; ++row) {
      std::uint8_t* to = bytes_.data() + offset_ + row * step_;
      std::memcpy(to, image.ptr(row), image.cols * image.elemSize());
      if (!layout.swap_bytes) continue;
      for (int column = 0; column < image.cols; ++column, to += image.elemSize()) std::reverse(to, to + image.elemSize());
    }
  }
  const std::uint8_t* data() const { return bytes_.data() + offset_; }
  std::size_t step() const { return step_; }

 private:
  std::size_t offset_, step_;
  std::vector<std::uint8_t> bytes_;
};

/// Frames with depths in whole millimetres, noise and lost pixels, as from a sensor.
Frames sensor_frames() {
  const replay::Room room;
  replay::SensorModel sensor;
  sensor.noise = true;
  sensor.dropouts = 0.05;
  Frames frames;
  for (int n = 0; n < 3; ++n) frames.push_back(room.render(6 * n, 200, coarse_camera(), sensor));
  return frames;
}

Frames in_metres(Frames frames) {
  for (auto& frame : frames) {
    cv::Mat metres(frame.depth.size(), CV_32FC1);
    for (int v = 0; v < metres.rows; ++v)
      for (int u = 0; u < metres.cols; ++u) metres.at<float>(v, u) = static_cast<float>(frame.depth.at<std::uint16_t>(v, u)) / 1000.0F;
    frame.depth = metres;
  }
  return frames;
}

std::vector<Surfel> map_of_layout(const Frames& frames, const Layout& layout) {
  Mapper mapper(undecimated());
  for (const auto& frame : frames) {
    const Bytes bytes(frame.depth, layout);
    DepthFrame view = frame.view();
    view.depth.data = bytes.data();
    view.depth.step = bytes.step();
    view.depth.swap_bytes = layout.swap_bytes;
    mapper.integrate(view);
  }
  return mapper.surfels();
}

TEST(MapperFormats, DepthsOfAnyLayoutAreTheSame) {
  const Frames millimetres = sensor_frames(), metres = in_metres(millimetres);
  ASSERT_EQ(millimetres.front().depth.type(), CV_16UC1);
  const auto expected = map_of(millimetres, undecimated());
  ASSERT_GT(expected.size(), 10000u);
  EXPECT_TRUE(same(expected, map_of(metres, undecimated()))) << "millimetres and metres";
  for (const Layout& layout : {Layout{0, 0, false}, Layout{0, 0, true}, Layout{6, 0, false}, Layout{7, 1, true}, Layout{1001, 3, false}}) {
    SCOPED_TRACE("padding " + std::to_string(layout.padding) + ", swapped " + std::to_string(layout.swap_bytes));
    EXPECT_TRUE(same(expected, map_of_layout(millimetres, layout)));
    EXPECT_TRUE(same(expected, map_of_layout(metres, layout)));
  }
}

/// The same depths in steps of another length [m], which must be a whole part of a millimetre.
Frames in_steps(Frames frames, double depth_unit) {
  for (auto& frame : frames) frame.depth = cv::Mat(frame.depth * std::lround(0.001 / depth_unit));  // a copy; up to 65535
  return frames;
}

TEST(MapperFormats, SixteenBitsInAnyUnit) {
  const Frames millimetres = sensor_frames();
  const auto expected = map_of(millimetres, undecimated());
  const auto expected_score = score(expected, millimetres, undecimated());
  for (const double depth_unit : {0.0002, 0.00025}) {
    Config config = undecimated();
    config.depth_unit = depth_unit;
    const Frames steps = in_steps(millimetres, depth_unit);
    EXPECT_TRUE(same(expected, map_of(steps, config))) << depth_unit;
    EXPECT_TRUE(same(expected, map_of(in_metres(millimetres), config))) << "metres are metres";
    EXPECT_EQ(score(expected, steps, config).right, expected_score.right) << depth_unit;
    EXPECT_EQ(score(expected, steps, config).miss_2cm, expected_score.miss_2cm) << depth_unit;
    EXPECT_FALSE(same(expected, map_of(steps, undecimated()))) << "the unit would have made a difference";
  }
}

/// Sensors write 65535 where they have measured nothing. It is neither a depth within the range nor one beyond it, whose ray would be
/// carved.
TEST(MapperFormats, TheLargestNumberIsNoMeasurement) {
  for (const double depth_unit : {0.001, 0.00005}) {  // 65535 is 65 m, 3.28 m
    Frames largest = in_steps(sensor_frames(), depth_unit), none = largest;
    for (auto& frame : largest) frame.depth.setTo(65535, frame.depth == 0);
    for (std::size_t n = 0; n < none.size(); ++n) {
      none[n].depth = largest[n].depth.clone();
      none[n].depth.setTo(0, none[n].depth == 65535);
    }
    for (const bool carve : {false, true}) {
      SCOPED_TRACE((carve ? "carved, " : "not carved, ") + std::to_string(depth_unit));
      Config config = undecimated();
      config.z_max = 3.5;
      config.depth_unit = depth_unit;
      config.carve_beyond_range = carve;
      const auto expected = map_of(none, config);
      EXPECT_TRUE(same(expected, map_of(largest, config)));
      const auto s = score(expected, largest, config), expected_score = score(expected, none, config);
      EXPECT_EQ(s.right, expected_score.right);
      EXPECT_EQ(s.miss_2cm, expected_score.miss_2cm);
    }
  }
}

/// The map of frames whose colour images have `channels` bytes per pixel in the given order.
std::vector<Surfel> map_of_colors(const Frames& frames, ColorImage::Order order, int channels, const Layout& layout) {
  Mapper mapper(undecimated());
  for (const auto& frame : frames) {
    cv::Mat pixels(frame.color.size(), CV_8UC(channels), cv::Scalar::all(77));
    for (int v = 0; v < pixels.rows; ++v)
      for (int u = 0; u < pixels.cols; ++u)
        for (int c = 0; c < 3; ++c) pixels.ptr(v, u)[c] = frame.color.at<cv::Vec3b>(v, u)[order == ColorImage::Order::kBgr ? c : 2 - c];
    const Bytes bytes(pixels, layout);
    DepthFrame view = frame.view();
    view.color->order = order;
    view.color->channels = channels;
    view.color->data = bytes.data();
    view.color->step = bytes.step();
    mapper.integrate(view);
  }
  return mapper.surfels();
}

TEST(MapperFormats, ColoursOfAnyLayoutAreTheSame) {
  const Frames frames = orbit_frames(coarse_camera(), 3, 6);
  const auto expected = map_of(frames, undecimated());
  for (const auto order : {ColorImage::Order::kRgb, ColorImage::Order::kBgr})
    for (const int channels : {3, 4})
      for (const Layout& layout : {Layout{0, 0, false}, Layout{5, 1, false}})
        EXPECT_TRUE(same(expected, map_of_colors(frames, order, channels, layout))) << channels << " channels";
}

TEST(MapperFormats, SurfelsTakeTheirPixelsColourAndColourChangesNothingElse) {
  replay::RecordedFrame frame = plane_frame(coarse_camera(), 1.5);
  const auto plain = map_of({frame}, undecimated());
  frame.color = cv::Mat(60, 80, CV_8UC3, cv::Scalar(30, 20, 10));  // blue, green, red
  frame.color.colRange(40, 80).setTo(cv::Scalar(3, 2, 1));
  auto colored = map_of({frame}, undecimated());
  std::size_t left = 0, right = 0;
  for (Surfel& s : colored) {
    const double u = s.position.x() / s.position.z() * frame.intrinsics.fx + frame.intrinsics.cx;
    const std::array<std::uint8_t, 3> black = {0, 0, 0}, expected_left = {10, 20, 30}, expected_right = {1, 2, 3};
    if (s.label == Label::kFrontier) {
      EXPECT_EQ(s.rgb, black) << "frontier has no colour";
    } else if (std::abs(u - 39.5) > 0.6) {
      EXPECT_EQ(s.rgb, u < 39.5 ? expected_left : expected_right) << u;
    }
    left += s.rgb == expected_left;
    right += s.rgb == expected_right;
    s.rgb = black;
  }
  EXPECT_GE(left, 2400u);
  EXPECT_GE(right, 2400u);
  EXPECT_TRUE(same(plain, colored));
}

/// Decimation takes every fourth pixel, if sampling says so, and divides the intrinsics by four.
TEST(MapperFormats, ADecimatedImageIsLikeASmallerOne) {
  Config config;
  config.sampling = "nearest";
  const replay::Room room;
  Frames full, small;
  for (const int index : {0, 8}) {
    full.push_back(room.render(index, 200, replay::synthetic_camera(640, 480)));
    small.push_back(room.render(index, 200, replay::synthetic_camera(160, 120)));
  }
  const auto surfels = map_of(full, config);
  EXPECT_GT(surfels.size(), 50000u);
  EXPECT_TRUE(same(surfels, map_of(small, undecimated())));
}

}  // namespace
}  // namespace frontier_surfels
