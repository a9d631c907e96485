/// The reasons why frames add nothing to a map, and the sentences about them.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "replay/warnings.hpp"

namespace frontier_surfels::replay {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();

/// @param in_working_image  pixels of the working image that have measured something
template <typename Pixel>
DepthCensus census(const std::vector<Pixel>& pixels, const Config& config, std::size_t in_working_image = 1) {
  DepthImage image;
  image.width = static_cast<int>(pixels.size());
  image.height = 1;
  image.step = sizeof(Pixel) * pixels.size();
  image.encoding = sizeof(Pixel) == 2 ? DepthImage::Encoding::kStepsU16 : DepthImage::Encoding::kMetresF32;
  image.data = pixels.data();
  return count_depths(image, config, in_working_image);
}

Config every_pixel() {
  Config config;
  config.decimation = 1;
  return config;
}

std::string reason_of(const std::vector<std::uint16_t>& pixels) { return census(pixels, every_pixel()).reason(); }
std::string reason_of(const std::vector<float>& pixels) { return census(pixels, every_pixel()).reason(); }

TEST(DepthCensus, ReasonsOfSixteenBits) {
  EXPECT_EQ(reason_of(std::vector<std::uint16_t>{0, 0}), "no_measurement");
  EXPECT_EQ(reason_of(std::vector<std::uint16_t>{0, 65535}), "saturated");
  EXPECT_EQ(reason_of(std::vector<std::uint16_t>{0, 5}), "too_near");
  EXPECT_EQ(reason_of(std::vector<std::uint16_t>{0, 60000}), "too_far");
  EXPECT_EQ(reason_of(std::vector<std::uint16_t>{5, 60000}), "out_of_range");
  EXPECT_EQ(reason_of(std::vector<std::uint16_t>{0, 65535, 60000, 5, 1000}), "");
}

TEST(DepthCensus, ReasonsOfMetres) {
  EXPECT_EQ(reason_of(std::vector<float>{kNan, 0, -1}), "no_measurement");
  EXPECT_EQ(reason_of(std::vector<float>{kInfinity}), "too_far");
  EXPECT_EQ(reason_of(std::vector<float>{1500}), "too_far");
  EXPECT_EQ(reason_of(std::vector<float>{1500, 1}), "");
}

TEST(DepthCensus, CarvingMakesFarDepthsUsableUnlessTheyAreImplausible) {
  Config config = every_pixel();
  config.carve_beyond_range = true;
  EXPECT_EQ(census<float>({50}, config).reason(), "");
  EXPECT_EQ(census<float>({1500}, config).reason(), "too_far");
  EXPECT_EQ(census<float>({kInfinity}, config).reason(), "too_far");
  config.carve_no_return = true;
  EXPECT_EQ(census<float>({kInfinity}, config).reason(), "");
}

TEST(DepthCensus, LooksAtThePixelsOfTheMapperInEitherByteOrder) {
  Config config = every_pixel();
  const std::vector<std::uint16_t> pixels = {0x0100, 7, 0x0200, 7, 7, 7, 7, 7};
  config.decimation = 2;
  DepthImage image = {4, 1, 8, DepthImage::Encoding::kStepsU16, pixels.data(), false};
  EXPECT_EQ(count_depths(image, config, 0).missing, 0u) << "the image has no whole block of 2 x 2 pixels";
  image.height = 2;
  image.swap_bytes = true;
  const DepthCensus swapped = count_depths(image, config, 0);
  EXPECT_EQ(swapped.too_near, 2u);
  EXPECT_FLOAT_EQ(swapped.farthest, 0.002F);
}

TEST(DepthCensus, ReadsStepsOfTheConfiguredUnit) {
  Config config = every_pixel();
  config.depth_unit = 0.0001;
  const DepthCensus depths = census<std::uint16_t>({10000, 60000}, config);
  EXPECT_EQ(depths.usable, 1u);
  EXPECT_FLOAT_EQ(depths.nearest, 1);
  EXPECT_FLOAT_EQ(depths.farthest, 6);
  EXPECT_NE(range_and_remedy(depths, config).find("from 1 to 6 m: 16-bit images are read in steps of depth_unit = 0.0001 m"),
            std::string::npos);
}

TEST(DepthCensus, UsablePixelsThatDisagreeAreAReason) {
  EXPECT_EQ(census<float>({1, 2}, every_pixel(), 0).reason(), "no_agreement");
  EXPECT_EQ(census<float>({1, 2}, every_pixel(), 1).reason(), "");
  EXPECT_EQ(census<float>({1500}, every_pixel(), 0).reason(), "too_far") << "what is wrong with the pixels themselves comes first";
}

/// The mean has all pixels: those between the ones that the paper reads, too.
TEST(DepthCensus, WithTheMeanAllPixelsCountIfThoseOfThePaperHaveMeasuredNothing) {
  Config config;
  config.decimation = 2;
  const std::vector<float> pixels = {0, 1, kNan, 1, 1, 1, 1, 1};
  const DepthImage image = {4, 2, 16, DepthImage::Encoding::kMetresF32, pixels.data(), false};
  EXPECT_EQ(count_depths(image, config, 0).usable, 6u);
  EXPECT_EQ(count_depths(image, config, 0).reason(), "no_agreement");
  EXPECT_EQ(count_depths(image, config, 1).reason(), "");
  config.sampling = "nearest";
  EXPECT_EQ(count_depths(image, config, 0).reason(), "no_measurement");
}

/// A run of frames with these pixels, whose camera moves.
template <typename Pixel>
Run run_of(const std::vector<std::vector<Pixel>>& images, const Config& config = every_pixel(), std::size_t in_working_image = 1) {
  Run run;
  run.config = config;
  run.world_frame = "map";
  for (const auto& pixels : images) {
    FrameRecord frame;
    frame.T_world_camera = Eigen::Isometry3d(Eigen::Translation3d(0.1 * static_cast<double>(run.frames.size()), 0, 0));
    frame.depths = census(pixels, run.config, in_working_image);
    run.frames.push_back(frame);
  }
  return run;
}

void expect_warning(const Run& run, const std::vector<std::string>& parts) {
  const std::vector<std::string> all = warnings(run);
  ASSERT_EQ(all.size(), 1u);
  for (const std::string& part : parts) EXPECT_NE(all[0].find(part), std::string::npos) << "'" << part << "' is not in '" << all[0] << "'";
}

TEST(Warnings, NameTheCauseAndTheRemedy) {
  EXPECT_TRUE(warnings(run_of<std::uint16_t>({{1000}, {2000}})).empty());
  expect_warning(run_of<std::uint16_t>({{0}, {0}, {1000}}), {"2 of 3", "no measurement", "topic"});
  expect_warning(run_of<std::uint16_t>({{65535}}), {"1 of 1", "65535"});
  expect_warning(run_of<std::uint16_t>({{60000}}), {"60 m", "correct depth_unit"});
  expect_warning(run_of<float>({{1500, 900}, {2500}}), {"2 of 2", "900 to 2.5e+03 m", "look like millimetres", "divide them by 1000"});
  expect_warning(run_of<float>({{kInfinity, kNan}}), {"only depths of +Inf", "carve_no_return"});
  expect_warning(run_of<float>({{0.001F}}), {"0.001 m", "must be in metres"});
  expect_warning(run_of<float>({{1, 2}}, every_pixel(), 0), {"1 of 1", "differ by more than agreement = 0.03", "or set sampling: nearest"});
}

TEST(Warnings, AWrongUnitIsFoundIfFewDepthsAreInRange) {
  std::vector<float> pixels(100, 1500);
  pixels[7] = 1;
  expect_warning(run_of<float>({pixels}), {"Only 1 %", "look like millimetres"});
  pixels.assign(100, kInfinity);
  pixels[7] = 1;
  EXPECT_TRUE(warnings(run_of<float>({pixels})).empty()) << "the camera looks into the open";
}

TEST(Warnings, AWrongUnitIsFoundIfFarDepthsCarve) {
  Config config = every_pixel();
  config.carve_beyond_range = config.carve_no_return = true;
  const std::vector<std::uint16_t> five_times_too_far(100, 20000), no_measurement(100, 0), right(100, 2000);
  EXPECT_EQ(reason_of(five_times_too_far), "too_far");
  expect_warning(run_of<std::uint16_t>({five_times_too_far, five_times_too_far}, config),
                 {"None of the measured depths are from z_min", "takes those beyond for free space", "20 m", "correct depth_unit"});
  EXPECT_EQ(warnings(run_of<std::uint16_t>({no_measurement, five_times_too_far}, config)).size(), 2u);
  EXPECT_TRUE(warnings(run_of<std::uint16_t>({five_times_too_far, right}, config)).empty()) << "a far wall in one of two frames";
  EXPECT_TRUE(warnings(run_of<float>({{kInfinity, kInfinity}}, config)).empty()) << "no return is what the option is for";
}

TEST(Warnings, ThoseOfTheSourceAreAmongThem) {
  auto run = run_of<std::uint16_t>({{1000}, {1000}});
  run.remarks = {"The camera_info is odd."};
  expect_warning(run, {"The camera_info is odd."});
}

TEST(Warnings, StillCamera) {
  auto run = run_of<std::uint16_t>({{1000}, {1000}});
  run.if_still = "look at its transforms";
  EXPECT_FALSE(is_still(run.frames));
  run.frames[1].T_world_camera = run.frames[0].T_world_camera;
  expect_warning(run, {"never moves", "all 2 frames", "'map'", "look at its transforms"});
  EXPECT_EQ(reason(run.frames[0], true), "still_camera");
  run.frames[1].T_world_camera.rotate(Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitX()));
  EXPECT_FALSE(is_still(run.frames));
  run.frames.pop_back();
  EXPECT_FALSE(is_still(run.frames)) << "one frame does not tell";
}

}  // namespace
}  // namespace frontier_surfels::replay
