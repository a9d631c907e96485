/// Clouds of surfels as PCL reads them: every field of nine types of points.
#include <gtest/gtest.h>
#include <pcl/conversions.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl_conversions/pcl_conversions.h>

#include <array>
#include <cstring>
#include <type_traits>

#include "ros/output/surfel_messages.hpp"
#include "ros/surfel_input.hpp"

namespace frontier_surfels::messages {
namespace {

/// Whether a type of points has a member, by name.
#define HAS_MEMBER(member)                   \
  template <typename Point, typename = void> \
  struct has_##member : std::false_type {};  \
  template <typename Point>                  \
  struct has_##member<Point, std::void_t<decltype(Point::member)>> : std::true_type {};
HAS_MEMBER(x)
HAS_MEMBER(normal_x)
HAS_MEMBER(r)
HAS_MEMBER(label)
HAS_MEMBER(curvature)
HAS_MEMBER(radius)
HAS_MEMBER(confidence)
#undef HAS_MEMBER

std::array<std::uint8_t, 3> shown_color(const Surfel& surfel) {
  if (surfel.rgb != std::array<std::uint8_t, 3>{0, 0, 0}) return surfel.rgb;
  if (surfel.label == Label::kFrontier) return {0, 0, 255};
  return {128, 128, 128};
}

float curvature_of(std::size_t index) { return 0.5F + static_cast<float>(index); }

/// Compares the fields that the type has. @return the number of fields that were compared
template <typename Point>
int compare(const Point& point, const Surfel& surfel, float curvature) {
  int fields = 0;
  if constexpr (has_x<Point>()) {
    EXPECT_EQ(point.x, surfel.position.x());
    EXPECT_EQ(point.y, surfel.position.y());
    EXPECT_EQ(point.z, surfel.position.z());
    fields += 3;
  }
  if constexpr (has_normal_x<Point>()) {
    EXPECT_EQ(point.normal_x, surfel.normal.x());
    EXPECT_EQ(point.normal_y, surfel.normal.y());
    EXPECT_EQ(point.normal_z, surfel.normal.z());
    fields += 3;
  }
  if constexpr (has_r<Point>()) {
    EXPECT_EQ((std::array<std::uint8_t, 3>{point.r, point.g, point.b}), shown_color(surfel));
    ++fields;
  }
  if constexpr (has_label<Point>()) {
    EXPECT_EQ(point.label, surfel.label == Label::kOccupied ? 1U : 0U);
    ++fields;
  }
  if constexpr (has_curvature<Point>()) {
    EXPECT_EQ(point.curvature, curvature);
    ++fields;
  }
  if constexpr (has_radius<Point>()) {
    EXPECT_EQ(point.radius, surfel.radius);
    ++fields;
  }
  if constexpr (has_confidence<Point>()) {
    EXPECT_EQ(point.confidence, surfel.label == Label::kFrontier ? 1 : 0);
    ++fields;
  }
  return fields;
}

/// @param fields  number of fields that the type shares with the clouds
template <typename Point>
void check_type(const std::vector<Surfel>& surfels, int fields) {
  sensor_msgs::PointCloud2 cloud = to_cloud(surfels);
  for (std::size_t n = 0; n < surfels.size(); ++n) {  // it is 0 in the clouds, which a field that is not read would be as well
    const float curvature = curvature_of(n);
    std::memcpy(&cloud.data[n * cloud.point_step + cloud.fields.back().offset], &curvature, sizeof(curvature));
  }
  ASSERT_EQ(cloud.fields.back().name, "curvature");
  pcl::PointCloud<Point> points;
  pcl::fromROSMsg(cloud, points);
  ASSERT_EQ(points.size(), surfels.size());
  EXPECT_TRUE(points.is_dense);
  for (std::size_t n = 0; n < surfels.size() && !testing::Test::HasFailure(); ++n)
    EXPECT_EQ(compare(points[n], surfels[n], curvature_of(n)), fields);
}

std::vector<Surfel> surfels() {
  Rng rng(1);
  return random_surfels(rng, 5000, 100);
}

TEST(PclClouds, XYZ) { check_type<pcl::PointXYZ>(surfels(), 3); }
TEST(PclClouds, XYZRGB) { check_type<pcl::PointXYZRGB>(surfels(), 4); }
TEST(PclClouds, XYZL) { check_type<pcl::PointXYZL>(surfels(), 4); }
TEST(PclClouds, XYZRGBL) { check_type<pcl::PointXYZRGBL>(surfels(), 5); }
TEST(PclClouds, Normal) { check_type<pcl::Normal>(surfels(), 4); }
TEST(PclClouds, XYZRGBNormal) { check_type<pcl::PointXYZRGBNormal>(surfels(), 8); }
TEST(PclClouds, XYZLNormal) { check_type<pcl::PointXYZLNormal>(surfels(), 8); }
TEST(PclClouds, XYZINormal) { check_type<pcl::PointXYZINormal>(surfels(), 7); }  // it has an intensity, which no surfel has
TEST(PclClouds, Surfel) { check_type<pcl::PointSurfel>(surfels(), 10); }

TEST(PclClouds, LieInMemoryAsPclPointSurfel) { EXPECT_EQ(to_cloud({Surfel()}).point_step, sizeof(pcl::PointSurfel)); }

}  // namespace
}  // namespace frontier_surfels::messages
