/// What PCL makes of surfels and of saved maps, and the other way round.
#include <pcl/io/pcd_io.h>

#include "frontier_surfels/pcl.hpp"
#include "map_file_input.hpp"

namespace frontier_surfels {
namespace {

class Pcl : public MapFileFolder {
 protected:
  Pcl() : MapFileFolder(".pcd") {}

  /// The saved surfels_ as PCL reads them.
  template <typename Point>
  pcl::PointCloud<Point> load() {
    write_map(path_, surfels_);
    pcl::PointCloud<Point> cloud;
    EXPECT_EQ(pcl::io::loadPCDFile(path_, cloud), 0);
    EXPECT_EQ(cloud.size(), surfels_.size());
    cloud.resize(surfels_.size());
    return cloud;
  }

  const std::vector<Surfel> surfels_ = some_surfels(50);
};

TEST_F(Pcl, SurfelsBecomePointsAndComeBack) {
  for (const Label confident : {Label::kFrontier, Label::kOccupied}) {
    const auto cloud = to_pcl(surfels_, confident);
    ASSERT_EQ(cloud.size(), surfels_.size());
    EXPECT_EQ(cloud.width, surfels_.size());
    EXPECT_EQ(cloud.height, 1u);
    for (std::size_t n = 0; n < cloud.size(); ++n) {
      EXPECT_EQ(cloud[n].getVector3fMap(), surfels_[n].position);
      EXPECT_EQ(cloud[n].getNormalVector3fMap(), surfels_[n].normal);
      EXPECT_EQ(cloud[n].radius, surfels_[n].radius);
      EXPECT_EQ(cloud[n].confidence, surfels_[n].label == confident ? 1 : 0);
      EXPECT_EQ(cloud[n].curvature, 0);
      EXPECT_EQ(cloud[n].data[3], 1) << "a point, not a direction";
    }
    EXPECT_TRUE(same_but_ids(surfels_, from_pcl(cloud, confident)));
  }
}

TEST_F(Pcl, ColoursAreThoseOfPclAndTheirAbsenceComesBack) {
  Surfel surfel = surfels_.front();
  const auto color = [&] {
    const pcl::PointSurfel point = to_pcl(surfel);
    EXPECT_EQ(from_pcl(point).rgb, surfel.rgb);
    return std::array<int, 3>{point.r, point.g, point.b};
  };
  surfel.rgb = {10, 20, 30};
  EXPECT_EQ(color(), (std::array<int, 3>{10, 20, 30}));
  surfel.rgb = {0, 0, 0};
  surfel.label = Label::kFrontier;
  EXPECT_EQ(color(), (std::array<int, 3>{0, 0, 255}));
  surfel.label = Label::kOccupied;
  EXPECT_EQ(color(), (std::array<int, 3>{128, 128, 128}));
  pcl::PointSurfel opaque = to_pcl(surfel);
  opaque.a = 255;
  EXPECT_EQ(from_pcl(opaque).rgb, (std::array<std::uint8_t, 3>{128, 128, 128})) << "another program's grey is a colour";
}

TEST_F(Pcl, PointsThatAreNoSurfelsAreRefused) {
  for (const float bad : {std::nanf(""), HUGE_VALF}) {
    for (float pcl::PointSurfel::*field : {&pcl::PointSurfel::x, &pcl::PointSurfel::normal_y, &pcl::PointSurfel::radius}) {
      auto cloud = to_pcl(surfels_);
      cloud[7].*field = bad;
      try {
        from_pcl(cloud);
        ADD_FAILURE() << "nothing was refused";
      } catch (const Error& error) {
        EXPECT_STREQ(error.what(), "Point 7 of the cloud has a value that is not finite, or no radius: remove it.");
      }
    }
  }
}

TEST_F(Pcl, SavedMapsAreReadAsSurfels) {
  const auto cloud = load<pcl::PointSurfel>();
  const auto expected = to_pcl(surfels_);
  for (std::size_t n = 0; n < cloud.size(); ++n) EXPECT_EQ(std::memcmp(&cloud[n], &expected[n], sizeof cloud[n]), 0) << n;
}

template <typename Point>
void expect_position(const Point& point, const Surfel& surfel) {
  EXPECT_EQ(point.getVector3fMap(), surfel.position);
  EXPECT_EQ(point.data[3], 1);
}
template <typename Point>
void expect_normal(const Point& point, const Surfel& surfel) {
  EXPECT_EQ(point.getNormalVector3fMap(), surfel.normal);
  EXPECT_EQ(point.data_n[3], 0);
  EXPECT_EQ(point.curvature, 0);
}
template <typename Point>
void expect_color(const Point& point, const Surfel& surfel) {
  EXPECT_EQ(point.rgba, to_cloud_color(surfel));
}
template <typename Point>
void expect_label(const Point& point, const Surfel& surfel) {
  EXPECT_EQ(point.label, surfel.label == Label::kOccupied ? 1u : 0u);
}

TEST_F(Pcl, SavedMapsAreReadAsOtherPoints) {
  const auto xyz = load<pcl::PointXYZ>();
  const auto xyzrgb = load<pcl::PointXYZRGB>();
  const auto xyzl = load<pcl::PointXYZL>();
  const auto xyzrgbl = load<pcl::PointXYZRGBL>();
  const auto normal = load<pcl::Normal>();
  const auto xyzrgbnormal = load<pcl::PointXYZRGBNormal>();
  const auto xyzlnormal = load<pcl::PointXYZLNormal>();
  const auto xyzinormal = load<pcl::PointXYZINormal>();
  for (std::size_t n = 0; n < surfels_.size(); ++n) {
    const Surfel& surfel = surfels_[n];
    expect_position(xyz[n], surfel);
    expect_position(xyzrgb[n], surfel);
    expect_color(xyzrgb[n], surfel);
    expect_position(xyzl[n], surfel);
    expect_label(xyzl[n], surfel);
    expect_position(xyzrgbl[n], surfel);
    expect_color(xyzrgbl[n], surfel);
    expect_label(xyzrgbl[n], surfel);
    expect_normal(normal[n], surfel);
    expect_position(xyzrgbnormal[n], surfel);
    expect_normal(xyzrgbnormal[n], surfel);
    expect_color(xyzrgbnormal[n], surfel);
    expect_position(xyzlnormal[n], surfel);
    expect_normal(xyzlnormal[n], surfel);
    expect_label(xyzlnormal[n], surfel);
    expect_position(xyzinormal[n], surfel);
    expect_normal(xyzinormal[n], surfel);
  }
}

TEST_F(Pcl, WhatPclSavesIsRead) {
  pcl::io::savePCDFileBinary(path_, to_pcl(surfels_));
  EXPECT_TRUE(same_but_ids(surfels_, read_map(path_))) << "binary";

  const auto rounded = [&] {  // PCL writes eight digits into a text
    auto cloud = to_pcl(surfels_);
    for (auto& point : cloud) point.getVector3fMap() = (1024 * point.getVector3fMap()).array().round() / 1024;
    return cloud;
  }();
  pcl::io::savePCDFileASCII(path_, rounded);
  const std::vector<Surfel> read = read_map(path_), expected = from_pcl(rounded);
  ASSERT_EQ(read.size(), expected.size());
  for (std::size_t n = 0; n < read.size(); ++n) {
    EXPECT_EQ(read[n].position, expected[n].position);
    EXPECT_TRUE(read[n].normal.isApprox(expected[n].normal, 1e-6f));
    EXPECT_NEAR(read[n].radius, expected[n].radius, 1e-6f);
    EXPECT_EQ(read[n].label, expected[n].label);
    EXPECT_EQ(read[n].rgb, expected[n].rgb);
  }

  pcl::io::savePCDFileBinaryCompressed(path_, to_pcl(surfels_));
  EXPECT_TRUE(contains(file_fault([&] { read_map(path_); }), "save it with DATA binary"));
  pcl::io::savePCDFileBinary(path_, load<pcl::PointXYZRGBNormal>());
  EXPECT_TRUE(contains(file_fault([&] { read_map(path_); }), "has no field radius"));
}

TEST_F(Pcl, WhatPclHasReadAndSavedAgainIsRead) {
  write_map(path_, surfels_);
  pcl::PCLPointCloud2 cloud;
  ASSERT_EQ(pcl::io::loadPCDFile(path_, cloud), 0);
  ASSERT_EQ(pcl::io::savePCDFile(path_, cloud, Eigen::Vector4f::Zero(), Eigen::Quaternionf::Identity(), true), 0);
  EXPECT_TRUE(same_but_ids(surfels_, read_map(path_))) << "label, colour and all other fields have stayed";
}

}  // namespace
}  // namespace frontier_surfels
