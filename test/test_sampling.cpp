/// The working image with `sampling: mean`: the mapper's against the yardsticks', which is written down anew, and what it does at edges.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "frame/working_image.hpp"
#include "frontier_surfels/scoring/exact_test.hpp"
#include "scoring/decimated_depth.hpp"

namespace frontier_surfels {
namespace {

constexpr double kVoxels = 1e9;

Config config_for(int decimation) {
  Config config;
  config.decimation = decimation;
  return config;
}

/// A frame of float depths, and its pixels.
struct Image {
  int width, height;
  std::vector<float> depth;
  std::vector<std::uint8_t> color;

  Image(int columns, int rows, float value) : width(columns), height(rows), depth(static_cast<std::size_t>(columns) * rows, value) {}

  float& at(int column, int row) { return depth[static_cast<std::size_t>(row) * width + column]; }

  DepthFrame frame() const {
    DepthFrame frame;
    frame.depth = {width, height, width * sizeof(float), DepthImage::Encoding::kMetresF32, depth.data()};
    frame.intrinsics = {500, 510, width / 2.0, height / 2.0, width, height};
    frame.T_world_camera = Eigen::Isometry3d::Identity();
    if (!color.empty()) frame.color = ColorImage{width, height, width * 3UL, ColorImage::Order::kRgb, 3, color.data()};
    return frame;
  }
  WorkingImage working(const Config& config) const {
    SamplingRoom room(config);
    return make_working_image(frame(), config, kVoxels, room);
  }
};

/// Surfaces with noise, gaps, outliers, and everything else that images have in them.
Image random_image(int width, int height, std::mt19937& rng) {
  std::uniform_real_distribution<float> share(0, 1);
  Image image(width, height, 0);
  const float gaps = share(rng) < 0.5F ? 0 : share(rng), spread = share(rng) < 0.3F ? 0.5F : 0.03F;
  const float odd[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1, 0, 0.1F, 9, 1e30F};
  const float edge = share(rng) * static_cast<float>(width);
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      const float surface = static_cast<float>(column) < edge ? 1.2F : 2.4F;
      image.at(column, row) = share(rng) < gaps ? odd[rng() % 7] : surface * (1 + spread * (share(rng) - 0.5F));
    }
  return image;
}

TEST(Sampling, IsThatOfTheYardsticks) {
  std::mt19937 rng(5);
  for (int n = 0; n < 200; ++n) {
    Config config = config_for(1 + n % 7);
    config.carve_beyond_range = n % 3 == 0;
    config.carve_no_return = n % 2 == 0;
    config.sampling = n % 10 == 0 ? "nearest" : "mean";
    const int height = config.decimation + static_cast<int>(rng() % 30), width = config.decimation + static_cast<int>(rng() % 40);
    const Image image = random_image(width, height, rng);  // the order of a call's arguments would depend on the compiler
    const WorkingImage working = image.working(config);
    const scoring::DecimatedDepth expected = scoring::decimate(image.frame(), scoring::DepthReading(config));
    ASSERT_EQ(working.depth.size(), expected.depth.size());
    for (std::size_t pixel = 0; pixel < working.depth.size(); ++pixel)
      ASSERT_EQ(working.depth[pixel], expected.depth[pixel]) << "image " << n << ", pixel " << pixel;
  }
}

void expect_equal(const WorkingImage& image, const WorkingImage& expected) {
  EXPECT_EQ(image.depth, expected.depth);
  EXPECT_EQ(image.color, expected.color);
  const auto zeros = static_cast<std::size_t>(std::count(expected.depth.begin(), expected.depth.end(), 0.0F));
  EXPECT_EQ(image.measured_pixels(), expected.depth.size() - zeros);
}

/// The pixels of an image as bytes.
struct Bytes {
  std::vector<std::uint8_t> bytes;

  template <typename Pixel>
  void add(Pixel pixel, bool swap) {
    std::uint8_t of_pixel[sizeof(Pixel)];
    std::memcpy(of_pixel, &pixel, sizeof(Pixel));
    if (swap) std::reverse(std::begin(of_pixel), std::end(of_pixel));
    bytes.insert(bytes.end(), std::begin(of_pixel), std::end(of_pixel));
  }
};

/// Whole steps as such and in metres, in either order of bytes, at odd addresses, in rows with a rest.
TEST(Sampling, HowDepthsAreWrittenMakesNoDifference) {
  std::mt19937 rng(8);
  for (int n = 0; n < 60; ++n) {
    Config config = config_for(1 + n % 6);
    config.sampling = n % 5 == 0 ? "nearest" : "mean";
    config.carve_beyond_range = n % 2 == 0;
    Image image(30 + n, 25 + n % 7, 0);
    std::vector<std::uint16_t> steps;
    for (float& depth : image.depth) {
      const auto kind = rng() % 8;
      steps.push_back(static_cast<std::uint16_t>(kind == 0 ? 0 : kind == 1 ? 65535 : kind == 2 ? rng() % 9000 : 1200 + rng() % 40));
      depth = steps.back() == 65535 ? 0 : static_cast<float>(steps.back() * config.depth_unit);
    }
    const WorkingImage expected = image.working(config);
    for (const bool swap : {false, true})
      for (const bool in_steps : {false, true}) {
        Bytes all;
        all.bytes.resize(1);
        DepthFrame frame = image.frame();
        for (std::size_t pixel = 0; pixel < steps.size(); ++pixel) {
          if (in_steps)
            all.add(steps[pixel], swap);
          else
            all.add(image.depth[pixel], swap);
          if ((pixel + 1) % static_cast<std::size_t>(image.width) == 0) all.bytes.insert(all.bytes.end(), 3, 99);
        }
        frame.depth.encoding = in_steps ? DepthImage::Encoding::kStepsU16 : DepthImage::Encoding::kMetresF32;
        frame.depth.step = image.width * (in_steps ? sizeof(std::uint16_t) : sizeof(float)) + 3;
        frame.depth.swap_bytes = swap;
        frame.depth.data = &all.bytes[1];
        SCOPED_TRACE("image " + std::to_string(n) + (swap ? ", swapped" : "") + (in_steps ? ", in steps" : ", in metres"));
        SamplingRoom room(config);
        expect_equal(make_working_image(frame, config, kVoxels, room), expected);
      }
  }
}

/// The image is large enough for several bands of rows.
TEST(Sampling, ThreadsMakeNoDifference) {
  std::mt19937 rng(9);
  for (int n = 0; n < 10; ++n) {
    Config config = config_for(1 + n / 2);
    config.sampling = n % 2 == 0 ? "mean" : "nearest";
    Image image = random_image(801, 603, rng);
    for (std::size_t byte = 0; byte < 3 * image.depth.size(); ++byte) image.color.push_back(static_cast<std::uint8_t>(rng()));
    config.threads = 1;
    const WorkingImage expected = image.working(config);
    for (const int threads : {2, 3, 0}) {
      config.threads = threads;
      expect_equal(image.working(config), expected);
    }
  }
}

TEST(Sampling, MemoryOfEarlierImagesMakesNoDifference) {
  std::mt19937 rng(10);
  const Config config = config_for(4);
  SamplingRoom room(config);
  for (int n = 0; n < 40; ++n) {
    const int height = 4 + static_cast<int>(rng() % 60), width = 4 + static_cast<int>(rng() % 60);
    const Image image = random_image(width, height, rng);
    expect_equal(make_working_image(image.frame(), config, kVoxels, room), image.working(config));
  }
}

/// The mean of 24 pixels at 1 m and one at 1.02 m is 1.0008 m.
TEST(Sampling, TheExactTestTakesTheMeans) {
  Image image(40, 40, 1);
  for (int row = 0; row < 40; row += 4)
    for (int column = 0; column < 40; column += 4) image.at(column, row) = 1.02F;
  for (const char* sampling : {"mean", "nearest"}) {
    Config config = config_for(4);
    config.sampling = sampling;
    scoring::ExactTest test(config);
    test.add(image.frame());
    EXPECT_TRUE(test.known({0, 0, 1.0007})) << sampling;
    EXPECT_EQ(test.known({0, 0, 1.0009}), config.sampling == "nearest");
    EXPECT_EQ(test.known({0, 0, 1.0199}), config.sampling == "nearest");
  }
}

TEST(Sampling, TheExactTestRefusesWhatMakesNoSense) {
  Config median, negative;
  median.sampling = "median";
  negative.noise_growth = -1;
  EXPECT_THROW(scoring::ExactTest{median}, Error);
  EXPECT_THROW(scoring::ExactTest{negative}, Error);
}

TEST(Sampling, ThePapersTakesTheNearestPixel) {
  Config config = config_for(4);
  config.sampling = "nearest";
  Image image(40, 40, 1);
  image.at(4, 8) = 2;
  EXPECT_EQ(image.working(config).depth[2 * 10 + 1], 2);
}

TEST(Sampling, NoiseBecomesLess) {
  std::mt19937 rng(1);
  std::normal_distribution<float> noise(2, 0.006F);
  Image image(400, 400, 0);
  for (float& depth : image.depth) depth = noise(rng);
  double squares = 0;
  const WorkingImage working = image.working(config_for(4));
  for (const float depth : working.depth) squares += (depth - 2) * (depth - 2);
  const double deviation = std::sqrt(squares / static_cast<double>(working.depth.size()));
  EXPECT_LT(deviation, 0.006 / 4);  // 25 pixels: a fifth
  EXPECT_GT(deviation, 0.006 / 6);
}

TEST(Sampling, ASinglePixelIsNoMeasurement) {
  Image image(40, 40, 1);
  image.at(20, 20) = 2.5F;
  EXPECT_EQ(image.working(config_for(4)).depth[5 * 10 + 5], 1);
  for (int row = 0; row < 40; ++row)
    for (int column = 21; column < 40; ++column) image.at(column, row) = 2;  // at an edge, nothing says which surface it is on
  EXPECT_EQ(image.working(config_for(4)).depth[5 * 10 + 5], 0);
  image = Image(40, 40, 1);
  image.at(20, 20) = 1;
  image.at(21, 20) = 2.5F;  // another one beside it does no harm
  EXPECT_EQ(image.working(config_for(4)).depth[5 * 10 + 5], 1);
}

TEST(Sampling, PixelsBetweenForegroundAndBackgroundAreNoMeasurement) {
  Image image(40, 40, 1);
  for (int row = 0; row < 40; ++row) {
    for (int column = 21; column < 40; ++column) image.at(column, row) = 2;
    image.at(20, row) = 1.5F;  // the whole column: five pixels of a block agree
  }
  const WorkingImage working = image.working(config_for(4));
  EXPECT_EQ(working.depth[5 * 10 + 4], 1);
  EXPECT_EQ(working.depth[5 * 10 + 5], 0);
  EXPECT_EQ(working.depth[5 * 10 + 6], 2);
}

TEST(Sampling, PixelsThatDisagreeMeasureNothing) {
  Image image(80, 60, 0);
  for (int row = 0; row < 60; ++row)
    for (int column = 0; column < 80; ++column)  // 25 depths from 0.6 to 2.4 m, each 6 % from the next one
      image.at(column, row) = 0.6F * std::pow(1.06F, static_cast<float>(5 * (column % 5) + row % 5));
  Config config = config_for(4);
  EXPECT_EQ(image.working(config).measured_pixels(), 0U);
  config.sampling = "nearest";
  EXPECT_EQ(image.working(config).measured_pixels(), 20U * 15);
}

TEST(Sampling, AThinPoleStays) {
  Image image(40, 40, 2);
  for (int row = 0; row < 40; ++row) image.at(20, row) = 1;
  EXPECT_EQ(image.working(config_for(4)).depth[5 * 10 + 5], 1);
}

/// The middle pixel is too far from the others by its own tolerance, and near enough by theirs, which is larger.
TEST(Sampling, AMiddlePixelThatAgreesWithTheOthersIsInTheirMean) {
  Image image(40, 40, 1);
  image.at(20, 20) = 0.9705F;
  const Config config = config_for(4);
  const float depth = image.working(config).depth[5 * 10 + 5];
  EXPECT_FLOAT_EQ(depth, (24 + 0.9705F) / 25);
  EXPECT_EQ(depth, scoring::decimate(image.frame(), scoring::DepthReading(config)).depth[5 * 10 + 5]);
}

TEST(Sampling, LostPixelsOfOneSurfaceAreFilled) {
  Image image(40, 40, 1);
  for (int row = 19; row <= 21; ++row)
    for (int column = 19; column <= 21; ++column) image.at(column, row) = 0;
  EXPECT_EQ(image.working(config_for(4)).depth[5 * 10 + 5], 1);
}

TEST(Sampling, LostPixelsBesideASurfaceAreNot) {
  Image image(40, 40, 1);
  for (int row = 0; row < 40; ++row)
    for (int column = 20; column < 40; ++column) image.at(column, row) = 0;  // a shadow: pixels on one side alone
  EXPECT_EQ(image.working(config_for(4)).depth[5 * 10 + 5], 0);
  for (int row = 0; row < 40; ++row)
    for (int column = 22; column < 40; ++column) image.at(column, row) = 2;  // behind it another surface
  EXPECT_EQ(image.working(config_for(4)).depth[5 * 10 + 5], 0);
}

TEST(Sampling, FreeSpaceNeedsMoreThanOnePixel) {
  Config config = config_for(4);
  config.carve_beyond_range = true;
  Image image(40, 40, 1);
  image.at(20, 20) = 8;
  EXPECT_EQ(image.working(config).depth[5 * 10 + 5], 1);
  for (int column = 18; column <= 22; ++column) image.at(column, 20) = 8;
  EXPECT_EQ(image.working(config).depth[5 * 10 + 5], -3);
}

TEST(Sampling, ColoursAreThoseOfTheSameSurface) {
  Image image(40, 40, 1);
  for (int row = 0; row < 40; ++row)
    for (int column = 0; column < 40; ++column) {
      const bool far = column > 20;
      if (far) image.at(column, row) = 2;
      for (const int value : {far ? 0 : 100 + 2 * (row % 2), far ? 255 : 7, 9}) image.color.push_back(static_cast<std::uint8_t>(value));
    }
  const WorkingImage working = image.working(config_for(4));
  EXPECT_EQ(working.color[5 * 10 + 5], 101U | 7U << 8 | 9U << 16);  // rows 18 to 22: 100, 102, 100, 102, 100
  EXPECT_EQ(working.color[5 * 10 + 6], 0U | 255U << 8 | 9U << 16);
}

/// Also at the image's edges, beside which there are no colours.
TEST(Sampling, NothingWithinRangeHasTheMiddlePixelsColour) {
  Image image(40, 40, std::numeric_limits<float>::infinity());
  for (int row = 0; row < 40; ++row)
    for (int column = 0; column < 40; ++column) image.color.insert(image.color.end(), 3, row % 4 == 0 && column % 4 == 0 ? 10 : 200);
  Config config = config_for(4);
  config.carve_no_return = true;
  const WorkingImage working = image.working(config);
  for (std::size_t pixel = 0; pixel < working.depth.size(); ++pixel) {
    ASSERT_EQ(working.depth[pixel], -3);
    ASSERT_EQ(working.color[pixel], 10U | 10U << 8 | 10U << 16) << pixel;
  }
}

}  // namespace
}  // namespace frontier_surfels
