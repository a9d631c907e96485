/// Unusable frames, configurations and devices give one clear sentence, and the map stays as it was.
#include <gtest/gtest.h>

#include <functional>

#include "frame/view_grid.hpp"
#include "mapper_input.hpp"
#include "replay/run.hpp"

namespace frontier_surfels {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

struct Fault {
  const char* name;
  const char* said;  ///< part of the error's sentence
  std::function<void(DepthFrame&)> spoil;
};

const Fault kFaults[] = {
    {"no data", "no data", [](DepthFrame& f) { f.depth.data = nullptr; }},
    {"short rows", "rows of", [](DepthFrame& f) { f.depth.step = f.depth.width * 4 - 1; }},
    {"no rows' length", "rows of", [](DepthFrame& f) { f.depth.step = 0; }},
    {"empty", "0 x 60", [](DepthFrame& f) { f.depth.width = f.intrinsics.width = 0; }},
    {"negative height", "80 x -60", [](DepthFrame& f) { f.depth.height = f.intrinsics.height = -60; }},
    {"huge", "100000 x 60", [](DepthFrame& f) { f.depth.width = f.intrinsics.width = 100000, f.depth.step = 400000; }},
    {"hugest", "2147483647", [](DepthFrame& f) { f.depth.height = f.intrinsics.height = 2147483647; }},
    {"other width", "intrinsics", [](DepthFrame& f) { f.intrinsics.width = 640; }},
    {"other height", "intrinsics", [](DepthFrame& f) { f.intrinsics.height = 0; }},
    {"no focal length", "focal length", [](DepthFrame& f) { f.intrinsics.fx = 0; }},
    {"negative focal length", "focal length", [](DepthFrame& f) { f.intrinsics.fy = -65; }},
    {"NaN focal length", "focal length", [](DepthFrame& f) { f.intrinsics.fx = kNan; }},
    {"infinite focal length", "focal length", [](DepthFrame& f) { f.intrinsics.fy = kInfinity; }},
    {"NaN principal point", "principal point", [](DepthFrame& f) { f.intrinsics.cx = kNan; }},
    {"infinite principal point", "principal point", [](DepthFrame& f) { f.intrinsics.cy = -kInfinity; }},
    {"no pose", "pose", [](DepthFrame& f) { f.T_world_camera = DepthFrame().T_world_camera; }},
    {"NaN position", "pose", [](DepthFrame& f) { f.T_world_camera.translation().y() = kNan; }},
    {"infinite position", "pose", [](DepthFrame& f) { f.T_world_camera.translation().z() = kInfinity; }},
    {"scaled pose", "rotation", [](DepthFrame& f) { f.T_world_camera.linear() *= 1.1; }},
    {"reflected pose", "rotation", [](DepthFrame& f) { f.T_world_camera.linear().col(0) *= -1; }},
    {"sheared pose", "rotation", [](DepthFrame& f) { f.T_world_camera.linear()(0, 1) += 0.1; }},
    {"pose all zero", "rotation", [](DepthFrame& f) { f.T_world_camera.linear().setZero(); }},
    {"far away", "origin", [](DepthFrame& f) { f.T_world_camera.translation().x() = 1e6; }},
    {"other colour size", "colour", [](DepthFrame& f) { f.color->width = 79; }},
    {"no colour data", "colour", [](DepthFrame& f) { f.color->data = nullptr; }},
    {"grey", "colour", [](DepthFrame& f) { f.color->channels = 1; }},
    {"short rows of colour", "colour", [](DepthFrame& f) { f.color->step = 239; }},
    {"zoom without end", "voxels", [](DepthFrame& f) { f.intrinsics.fx = f.intrinsics.fy = 1e7; }},
    {"view all around", "m large", [](DepthFrame& f) { f.intrinsics.fx = f.intrinsics.fy = 0.5; }},
    {"focal length beyond all", "voxels", [](DepthFrame& f) { f.intrinsics.fx = 1e300; }},
};

/// Expects a sentence: a capital letter, more than a word, and a full stop or question mark.
void expect_sentence(const std::string& text) {
  ASSERT_GT(text.size(), 20u) << text;
  EXPECT_TRUE(std::isupper(static_cast<unsigned char>(text.front()))) << text;
  EXPECT_TRUE(text.back() == '.' || text.back() == '?') << text;
}

TEST(MapperBadInput, EveryBadFrameIsNamedAndChangesNothing) {
  const Frames frames = orbit_frames(coarse_camera(), 4, 5);
  Mapper mapper(undecimated()), untroubled(undecimated());
  for (int n = 0; n < 3; ++n) {
    mapper.integrate(frames[n].view());
    untroubled.integrate(frames[n].view());
  }
  const auto before = mapper.surfels();
  ASSERT_GT(before.size(), 10000u);
  for (const Fault& fault : kFaults) {
    SCOPED_TRACE(fault.name);
    DepthFrame frame = frames[3].view();
    fault.spoil(frame);
    const std::string said = fault_of<BadFrame>([&] { mapper.integrate(frame); });
    EXPECT_TRUE(contains(said, fault.said)) << "said '" << said << "'";
    expect_sentence(said);
    EXPECT_TRUE(same(before, mapper.surfels()));
    EXPECT_EQ(mapper.sequence(), 3u);
  }
  EXPECT_EQ(mapper.integrate(frames[3].view()).sequence, 4u);
  untroubled.integrate(frames[3].view());
  EXPECT_TRUE(same(mapper.surfels(), untroubled.surfels())) << "a bad frame has changed the next one's result";
}

TEST(MapperBadInput, ABadFirstFrameLeavesNothingBehind) {
  const Frames frames = orbit_frames(coarse_camera(), 2, 5);
  Mapper mapper(undecimated());
  for (const Fault& fault : kFaults) {
    DepthFrame frame = frames[0].view();
    fault.spoil(frame);
    EXPECT_THROW(mapper.integrate(frame), BadFrame) << fault.name;
    EXPECT_TRUE(mapper.surfels().empty());
  }
  integrate_all(mapper, frames);
  EXPECT_TRUE(same(mapper.surfels(), map_of(frames, undecimated())));
}

/// Absurd cameras are refused, or mapped with valid surfels only.
TEST(MapperBadInput, DegenerateCamerasMakeNoUnsoundSurfel) {
  const Frames frames = orbit_frames(coarse_camera(), 1);
  Mapper mapper(undecimated());
  const std::function<void(Intrinsics&)> cameras[] = {
      [](Intrinsics& k) { k.fx = k.fy = 1e-40; }, [](Intrinsics& k) { k.fx = 1e-3; }, [](Intrinsics& k) { k.cx = 1e39; },
      [](Intrinsics& k) { k.cy = -1e300; },       [](Intrinsics& k) { k.cx = -1e4; }, [](Intrinsics& k) { k.fx = 0.5, k.fy = 2000; },
  };
  for (const auto& change : cameras) {
    DepthFrame frame = frames[0].view();
    change(frame.intrinsics);
    SCOPED_TRACE(std::to_string(frame.intrinsics.fx) + " " + std::to_string(frame.intrinsics.cx) + " " +
                 std::to_string(frame.intrinsics.cy));
    try {
      mapper.integrate(frame);
    } catch (const BadFrame& error) {
      expect_sentence(error.what());
    }
    EXPECT_TRUE(all_sound(mapper.surfels()));
    mapper.reset();
  }
}

TEST(MapperBadInput, ImagesSmallerThanTheDecimation) {
  Config config;
  config.decimation = 8;
  Mapper mapper(config);
  const auto narrow = plane_frame(plain_camera(7, 60, 60), 1), flat = plane_frame(plain_camera(60, 7, 60), 1);
  EXPECT_TRUE(contains(fault_of<BadFrame>([&] { mapper.integrate(narrow.view()); }), "decimation"));
  EXPECT_TRUE(contains(fault_of<BadFrame>([&] { mapper.integrate(flat.view()); }), "decimation"));
  EXPECT_GT(mapper.integrate(plane_frame(plain_camera(8, 8, 60), 1).view()).created, 0u) << "one pixel is enough";
}

TEST(MapperBadInput, AGridTooLargeIsRefused) {
  Config config;
  config.decimation = 1;
  config.z_min = 0.01;
  config.z_max = 1000;
  Mapper mapper(config);
  const std::string said = fault_of<BadFrame>([&] { mapper.integrate(plane_frame(replay::synthetic_camera(), 1).view()); });
  EXPECT_TRUE(contains(said, "voxels")) << said;
  EXPECT_TRUE(contains(said, "z_max")) << said;
  EXPECT_TRUE(mapper.surfels().empty());
  EXPECT_GT(mapper.integrate(plane_frame(plain_camera(12, 9, 10), 1).view()).created, 0u);
}

/// The sentence with which an image of this size is refused. Its pixels are not there: nobody may read them, nor ask for memory for them.
std::string refusal(Mapper& mapper, int width, int height, double f) {
  const std::uint16_t pixel = 1000;
  DepthFrame frame;
  frame.intrinsics = {f, f, width / 2.0, height / 2.0, width, height};
  frame.depth = {width, height, std::size_t{2} * width, DepthImage::Encoding::kStepsU16, &pixel, false};
  frame.T_world_camera = Eigen::Isometry3d::Identity();
  return fault_of<BadFrame>([&] { mapper.integrate(frame); });
}

TEST(MapperBadInput, ImagesTooLargeAreRefusedWithTheDecimationThatWouldDo) {
  Mapper mapper(undecimated());
  const std::size_t device_before = mapper.statistics().device_bytes;
  const double peak_before_mb = replay::peak_rss_mb();
  const struct {
    int width, height;
    double f;
  } cameras[] = {{16384, 16384, 2000}, {65536, 4000, 3000}, {4000, 3000, 3000}, {1 << 20, 64, 100}};
  for (const auto& camera : cameras) {
    const std::string said = refusal(mapper, camera.width, camera.height, camera.f);
    const std::size_t at = said.find("Set decimation to ");
    ASSERT_NE(at, std::string::npos) << said;
    EXPECT_TRUE(contains(said, std::to_string(camera.width) + " x " + std::to_string(camera.height))) << said;
    const int decimation = std::stoi(said.substr(at + 18));
    const Intrinsics full = {camera.f, camera.f, 0, 0, camera.width, camera.height};
    Config config = undecimated();
    config.decimation = decimation;
    EXPECT_NO_THROW(check_grid_size(full, config, kMaxVoxels)) << said;
    config.decimation = decimation - 1;
    EXPECT_THROW(check_grid_size(full, config, kMaxVoxels), BadFrame) << said;
  }
  EXPECT_TRUE(contains(refusal(mapper, 1900000, 1900000, 1e3), "No decimation would do"));
  EXPECT_EQ(mapper.statistics().device_bytes, device_before);
  EXPECT_LT(replay::peak_rss_mb(), peak_before_mb + 16);
  EXPECT_EQ(mapper.sequence(), 0u);
}

TEST(MapperBadInput, LargeImagesFitAfterDecimation) {
  Config config = undecimated();
  config.decimation = 64;
  Mapper mapper(config);
  EXPECT_GT(mapper.integrate(plane_frame(plain_camera(20000, 512, 4000), 1).view()).created, 0u);
}

TEST(MapperBadInput, GridsLargerThanTheDevicesMemoryAreRefused) {
  const Intrinsics full = {500, 500, 320, 240, 640, 480};
  EXPECT_NO_THROW(check_grid_size(full, undecimated(), kMaxVoxels));
  const std::string said = fault_of<BadFrame>([&] { check_grid_size(full, undecimated(), 1e8); });
  EXPECT_TRUE(contains(said, "room for 0.1.")) << said;
  EXPECT_TRUE(contains(said, "Set decimation to 2")) << said;
}

TEST(MapperBadInput, EveryFaultOfAConfigurationIsListed) {
  Config config;
  config.decimation = 0;
  config.z_min = kNan;
  config.z_max = -1;
  config.padding_k = 0;
  config.th_d = 2;
  config.median_votes = 28;
  config.recent_views = -1;
  config.threads = -2;
  config.device_type = "tpu";
  const std::string said = fault_of<Error>([&] { Mapper mapper(config); });
  for (const std::string& problem : config.problems()) EXPECT_TRUE(contains(said, problem)) << "'" << problem << "' is not in:\n" << said;
  for (const char* name : {"decimation", "z_min", "z_max", "padding_k", "th_d", "median_votes", "recent_views", "threads", "device_type"})
    EXPECT_TRUE(contains(said, name)) << name << " is not in:\n" << said;
}

TEST(MapperBadInput, MissingDevices) {
  const std::string device = Mapper(undecimated()).device();
  Config platform, index;
  platform.platform = "no such platform";
  index.device_index = 255;
  for (const Config& config : {platform, index}) {
    const std::string said = fault_of<DeviceError>([&] { Mapper mapper(config); });
    EXPECT_TRUE(contains(said, config.platform)) << said;
    EXPECT_TRUE(contains(said, std::to_string(config.device_index))) << said;
    EXPECT_TRUE(contains(said, device)) << "it does not list '" << device << "':\n" << said;
  }
  Config part_of_name = undecimated();
  part_of_name.platform = device.substr(0, device.find(':'));
  std::transform(part_of_name.platform.begin(), part_of_name.platform.end(), part_of_name.platform.begin(), ::toupper);
  EXPECT_EQ(Mapper(part_of_name).device(), device) << "case does not matter";
}

}  // namespace
}  // namespace frontier_surfels
