/// Surfels are packed into clouds and read again bit for bit, and damaged clouds are refused.
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <limits>

#include "mapper_input.hpp"
#include "ros/input/conversions.hpp"
#include "ros/output/serialized.hpp"
#include "ros/output/surfel_messages.hpp"
#include "ros/surfel_input.hpp"

namespace frontier_surfels::messages {
namespace {

using sensor_msgs::PointCloud2;
using sensor_msgs::PointField;

std::vector<Surfel> awkward_surfels() {
  Rng rng(1);
  std::vector<Surfel> surfels = random_surfels(rng, 3000);
  surfels[0].position = {-0.0F, std::numeric_limits<float>::denorm_min(), std::numeric_limits<float>::max()};
  surfels[1].normal = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 0};
  surfels[2].rgb = {255, 255, 255};
  surfels[3].rgb = {0, 0, 1};
  surfels[4].id = std::numeric_limits<std::uint32_t>::max();
  return surfels;
}

SurfelMirror mirror_of(const std::vector<Surfel>& surfels) {
  SurfelMirror mirror;
  mirror.apply(Changes{1, surfels, {}}, 0);
  return mirror;
}

/// An update that goes into one message.
SurfelUpdate whole_message(const Changes& changes, std::uint64_t since, const Eigen::AlignedBox3f& box,
                           Label confident = Label::kFrontier) {
  UpdateMessages messages(changes, since, box, confident, kMostSurfels);
  EXPECT_EQ(messages.size(), 1U);
  const SurfelUpdate update = messages.next();
  EXPECT_TRUE(messages.done());
  EXPECT_EQ(update.part, 0U);
  EXPECT_EQ(update.parts, 1U);
  return update;
}

/// Puts the parts of an update together. Checks what they must have in common.
Changes together(UpdateMessages messages, std::uint64_t since, std::size_t most) {
  Changes changes;
  for (std::uint32_t part = 0; !messages.done(); ++part) {
    const SurfelUpdate message = messages.next();
    changes.sequence = message.sequence;
    EXPECT_EQ(message.since, since);
    EXPECT_EQ(message.part, part);
    EXPECT_EQ(message.parts, messages.size());
    const auto surfels = to_surfels(message.surfels);
    EXPECT_LE(surfels.size(), most);
    EXPECT_LE(message.removed.size(), most);
    EXPECT_TRUE(message.removed.empty() || changes.updated.empty()) << "ids are removed after surfels have been added";
    changes.updated.insert(changes.updated.end(), surfels.begin(), surfels.end());
    changes.removed.insert(changes.removed.end(), message.removed.begin(), message.removed.end());
  }
  return changes;
}

/// Indices of fields in a cloud.
constexpr std::size_t kId = 3, kLabel = 7, kRgb = 8, kRadius = 9, kConfidence = 10, kCurvature = 11;

template <typename T>
T read(const PointCloud2& cloud, std::size_t point, std::size_t field) {
  T value;
  std::memcpy(&value, &cloud.data[point * cloud.point_step + cloud.fields[field].offset], sizeof(value));
  return value;
}

TEST(SurfelClouds, ComeBackBitForBit) {
  const auto surfels = awkward_surfels();
  for (const Label confident : {Label::kFrontier, Label::kOccupied}) EXPECT_TRUE(same(to_surfels(to_cloud(surfels, confident)), surfels));
  EXPECT_TRUE(to_surfels(to_cloud(std::vector<Surfel>())).empty());
}

TEST(SurfelClouds, HaveTheFieldsThatOthersExpect) {
  Surfel surfel;
  surfel.position = {1, 2, 3};
  surfel.id = 4;
  surfel.normal = {5, 6, 7};
  surfel.label = Label::kOccupied;
  surfel.rgb = {0x12, 0x34, 0x56};
  surfel.radius = 8;
  const PointCloud2 cloud = to_cloud({Surfel(), surfel});
  EXPECT_EQ(cloud.height, 1U);
  EXPECT_EQ(cloud.width, 2U);
  EXPECT_EQ(cloud.point_step, 48U);
  EXPECT_EQ(cloud.row_step, 96U);
  EXPECT_EQ(cloud.data.size(), 96U);

  const std::vector<std::string> names = {"x",        "y",     "z",   "id",     "normal_x",   "normal_y",
                                          "normal_z", "label", "rgb", "radius", "confidence", "curvature"};
  ASSERT_EQ(cloud.fields.size(), names.size());
  for (std::size_t n = 0; n < names.size(); ++n) {
    EXPECT_EQ(cloud.fields[n].name, names[n]);
    EXPECT_EQ(cloud.fields[n].offset, 4 * n);
    EXPECT_EQ(cloud.fields[n].count, 1U);
    EXPECT_EQ(cloud.fields[n].datatype, n == kId || n == kLabel ? PointField::UINT32 : PointField::FLOAT32);
  }
  for (const std::size_t n : {0, 1, 2, 4, 5, 6}) EXPECT_EQ(read<float>(cloud, 1, n), static_cast<float>(n + 1));
  EXPECT_EQ(read<std::uint32_t>(cloud, 1, kId), 4U);
  EXPECT_EQ(read<std::uint32_t>(cloud, 1, kLabel), 1U);
  EXPECT_EQ(read<std::uint32_t>(cloud, 0, kLabel), 0U);
  EXPECT_EQ(read<std::uint32_t>(cloud, 1, kRgb), 0x123456U);
  EXPECT_EQ(read<float>(cloud, 1, kRadius), 8);
  EXPECT_EQ(read<float>(cloud, 1, kCurvature), 0);
}

TEST(SurfelClouds, ShowSurfelsWithoutAColour) {
  Surfel frontier, occupied, grey, blue;
  occupied.label = grey.label = Label::kOccupied;
  grey.rgb = {128, 128, 128};
  blue.rgb = {0, 0, 255};
  const std::vector<Surfel> surfels = {frontier, occupied, grey, blue};
  const PointCloud2 cloud = to_cloud(surfels);
  const auto rgb = [&](std::size_t point) { return read<std::uint32_t>(cloud, point, kRgb) & 0xffffff; };
  EXPECT_EQ(rgb(0), 0x0000ffU);
  EXPECT_EQ(rgb(1), 0x808080U);
  EXPECT_EQ(rgb(2), 0x808080U);
  EXPECT_EQ(rgb(3), 0x0000ffU);
  EXPECT_TRUE(same(to_surfels(cloud), surfels)) << "the colours in the cloud are only for show";
}

TEST(SurfelClouds, AreConfidentOfOneLabel) {
  Surfel frontier, occupied;
  occupied.label = Label::kOccupied;
  for (const Label confident : {Label::kFrontier, Label::kOccupied}) {
    const PointCloud2 cloud = to_cloud({frontier, occupied}, confident);
    EXPECT_EQ(read<float>(cloud, 0, kConfidence), confident == Label::kFrontier ? 1 : 0);
    EXPECT_EQ(read<float>(cloud, 1, kConfidence), confident == Label::kOccupied ? 1 : 0);
    frontier.radius = 1;
    const SurfelUpdate update = whole_message(Changes{1, {frontier}, {}}, 0, Eigen::AlignedBox3f(), confident);
    EXPECT_EQ(read<float>(update.surfels, 0, kConfidence), confident == Label::kFrontier ? 1 : 0);
  }
  EXPECT_EQ(to_cloud({frontier, occupied}).data, to_cloud({frontier, occupied}, Label::kFrontier).data);
}

TEST(SurfelClouds, OfAMapLeaveOutItsGaps) {
  Rng rng(2);
  SurfelMirror mirror = mirror_of(random_surfels(rng, 5000));
  mirror.apply(random_changes(rng, 1, 6000, 2000), 1);
  ASSERT_LT(mirror.size(), mirror.surfels().back().id);
  EXPECT_TRUE(same(to_surfels(to_cloud(mirror)), mirror.surfels()));
  for (const Label label : {Label::kOccupied, Label::kFrontier})
    EXPECT_TRUE(same(to_surfels(to_cloud(mirror, Label::kFrontier, label)), mirror.surfels(label)));
}

/// Fields in another order and with gaps, and rows with gaps.
TEST(SurfelClouds, AreReadByTheirFieldsNames) {
  const auto surfels = awkward_surfels();
  const PointCloud2 plain = to_cloud(surfels);
  PointCloud2 cloud = plain;
  std::reverse(cloud.fields.begin(), cloud.fields.end());
  for (std::size_t n = 0; n < cloud.fields.size(); ++n) cloud.fields[n].offset = static_cast<std::uint32_t>(3 + 5 * n);
  cloud.fields.insert(cloud.fields.begin() + 4, PointField());
  cloud.width = 300;
  cloud.height = 10;
  cloud.point_step = 67;
  cloud.row_step = 300 * 67 + 11;
  cloud.data.assign(10 * cloud.row_step - 11, 0xee);
  for (std::size_t point = 0; point < surfels.size(); ++point) {
    for (const PointField& field : plain.fields) {
      const auto to = std::find_if(cloud.fields.begin(), cloud.fields.end(), [&](const PointField& f) { return f.name == field.name; });
      std::memcpy(&cloud.data[point / 300 * cloud.row_step + point % 300 * 67 + to->offset], &plain.data[point * 48 + field.offset], 4);
    }
  }
  EXPECT_TRUE(same(to_surfels(cloud), surfels));
}

/// @return the sentence of the error that a damaged cloud causes; empty if it is read
std::string refusal(const std::function<void(PointCloud2&)>& damage) {
  Rng rng(3);
  PointCloud2 cloud = to_cloud(random_surfels(rng, 10));
  damage(cloud);
  try {
    to_surfels(cloud);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(SurfelClouds, AreRefusedWithoutOneOfTheFields) {
  for (std::size_t n = 0; n < kConfidence; ++n) {
    std::string name;
    const std::string missing = refusal([&](PointCloud2& cloud) {
      name = cloud.fields[n].name;
      cloud.fields.erase(cloud.fields.begin() + static_cast<std::ptrdiff_t>(n));
    });
    EXPECT_NE(missing.find("no field " + name), std::string::npos) << missing;
    const std::string retyped = refusal([&](PointCloud2& cloud) { cloud.fields[n].datatype = PointField::INT16; });
    EXPECT_NE(retyped.find("field " + name + " is not of the type"), std::string::npos) << retyped;
    EXPECT_NE(refusal([&](PointCloud2& cloud) { cloud.fields[n].count = 2; }), "");
    const std::string outside = refusal([&](PointCloud2& cloud) { cloud.fields[n].offset = 48; });
    EXPECT_NE(outside.find("outside"), std::string::npos) << outside;
    EXPECT_NE(refusal([&](PointCloud2& cloud) { cloud.fields[n].offset = 0xfffffffe; }), "");
  }
}

TEST(SurfelClouds, NeedNoFieldsThatNoSurfelHas) {
  EXPECT_EQ(refusal([](PointCloud2& cloud) { cloud.fields.resize(kConfidence); }), "");
}

TEST(SurfelClouds, AreRefusedWhenTheDataAreDamaged) {
  EXPECT_EQ(refusal([](PointCloud2&) {}), "");
  const std::string cut = refusal([](PointCloud2& cloud) { cloud.data.pop_back(); });
  EXPECT_NE(cut.find("cut short"), std::string::npos) << cut;
  EXPECT_NE(cut.find("479 bytes instead of 480"), std::string::npos) << cut;
  EXPECT_NE(refusal([](PointCloud2& cloud) { cloud.data.clear(); }), "");
  EXPECT_NE(refusal([](PointCloud2& cloud) { cloud.width = 0xffffffff; }), "");
  EXPECT_NE(refusal([](PointCloud2& cloud) { cloud.height = 0xffffffff; }), "");
  EXPECT_NE(refusal([](PointCloud2& cloud) { cloud.width = cloud.height = cloud.point_step = cloud.row_step = 0xffffffff; }), "");
  EXPECT_NE(refusal([](PointCloud2& cloud) {
              cloud.height = 2;
              cloud.row_step = 0;
            }),
            "");
  const std::string order = refusal([](PointCloud2& cloud) { cloud.is_bigendian = !cloud.is_bigendian; });
  EXPECT_NE(order.find("byte order"), std::string::npos) << order;
  const std::string label = refusal([](PointCloud2& cloud) { cloud.data[7 * 48 + cloud.fields[kLabel].offset] = 2; });
  EXPECT_NE(label.find("2 is no label"), std::string::npos) << label;
}

TEST(SurfelUpdates, SayWhatHasChanged) {
  Rng rng(4);
  const Changes changes = random_changes(rng, 41, 1000, 300);
  const SurfelUpdate update = whole_message(changes, 41, Eigen::AlignedBox3f(Eigen::Vector3f(1, 2, 3), Eigen::Vector3f(4, 5, 6)));
  EXPECT_EQ(update.since, 41U);
  EXPECT_EQ(update.sequence, changes.sequence);
  EXPECT_EQ(update.removed, changes.removed);
  EXPECT_TRUE(same(to_surfels(update.surfels), changes.updated));
  EXPECT_EQ(update.box_min.x, 1);
  EXPECT_EQ(update.box_min.y, 2);
  EXPECT_EQ(update.box_min.z, 3);
  EXPECT_EQ(update.box_max.x, 4);
  EXPECT_EQ(update.box_max.y, 5);
  EXPECT_EQ(update.box_max.z, 6);

  const SurfelUpdate none = whole_message(Changes{8, {}, {}}, 7, Eigen::AlignedBox3f());
  EXPECT_GT(none.box_min.x, none.box_max.x);
}

TEST(SurfelUpdates, ComeInPartsThatHaveEverything) {
  Rng rng(6);
  const Changes changes = random_changes(rng, 41, 1000, 300);
  for (const std::size_t most : {7, 100, 299, 300, 301, 1000}) {
    UpdateMessages messages(changes, 41, Eigen::AlignedBox3f(), Label::kFrontier, most);
    const std::size_t surfels = changes.updated.size(), removed = changes.removed.size();
    EXPECT_EQ(messages.size(), (surfels + most - 1) / most + (removed + most - 1) / most - 1);
    const Changes all = together(messages, 41, most);
    EXPECT_EQ(all.sequence, changes.sequence);
    EXPECT_EQ(all.removed, changes.removed);
    EXPECT_TRUE(same(all.updated, changes.updated)) << "at most " << most;
  }
}

TEST(SurfelUpdates, OfAWholeMapComeInParts) {
  Rng rng(7);
  SurfelMirror mirror = mirror_of(random_surfels(rng, 5000));
  mirror.apply(random_changes(rng, 1, 6000, 2000), 1);
  for (const std::size_t most : {std::size_t{100}, mirror.size() - 1, mirror.size(), kMostSurfels}) {
    const Changes all = together({mirror, Eigen::AlignedBox3f(), Label::kFrontier, most}, 0, most);
    EXPECT_EQ(all.sequence, mirror.sequence());
    EXPECT_TRUE(same(all.updated, mirror.surfels())) << "at most " << most;
  }
}

TEST(SurfelClouds, AboveTheLimitAreRefusedWithTheWaysOut) {
  Rng rng(8);
  const auto surfels = random_surfels(rng, 100);
  const SurfelMirror mirror = mirror_of(surfels);
  EXPECT_TRUE(same(to_surfels(to_cloud(surfels, Label::kFrontier, 100)), surfels));
  EXPECT_TRUE(same(to_surfels(to_cloud(mirror, Label::kFrontier, std::nullopt, mirror.size())), mirror.surfels()));
  const auto refusal = [](const auto& make) -> std::string {
    try {
      make();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  for (const std::string& text : {refusal([&] { to_cloud(surfels, Label::kFrontier, 99); }),
                                  refusal([&] { to_cloud(mirror, Label::kFrontier, std::nullopt, mirror.size() - 1); })}) {
    for (const char* part : {"surfels are more than a message may have", "~message_limit", "~get_surfels with smaller boxes", "~update"})
      EXPECT_NE(text.find(part), std::string::npos) << text;
  }
}

TEST(SerializedMessages, AreNotSerialisedAgain) {
  Rng rng(5);
  const PointCloud2 cloud = to_cloud(random_surfels(rng, 100));
  const Serialized packed = serialized(cloud);
  const ros::SerializedMessage bytes = ros::serialization::serializeMessage(packed);
  EXPECT_EQ(bytes.buf.get(), packed.bytes.buf.get());
  PointCloud2 back;
  ros::serialization::deserializeMessage(bytes, back);
  EXPECT_EQ(back.data, cloud.data);
  EXPECT_STREQ(ros::message_traits::md5sum(packed), "*") << "a serialised message must fit every topic";
}

TEST(FrameReports, SayWhatTheMapperSays) {
  Report report;
  report.sequence = 1234567890123;
  report.surfels = 1;
  report.in_view = 2;
  report.measured_pixels = 7;
  report.created = 3;
  report.removed = 4;
  report.split = 5;
  report.view_kept = true;
  report.T_world_camera = Eigen::Translation3d(1, 2, 3) * Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -2) / 3);
  report.total_ms = 6.5;
  report.stages = {{"first", 1.5}, {"second", 2.5}};
  const FrameReport message = to_message(report);
  EXPECT_EQ(message.sequence, 1234567890123U);
  EXPECT_EQ(message.surfels, 1U);
  EXPECT_EQ(message.in_view, 2U);
  EXPECT_EQ(message.measured_pixels, 7U);
  EXPECT_EQ(message.created, 3U);
  EXPECT_EQ(message.removed, 4U);
  EXPECT_EQ(message.split, 5U);
  EXPECT_TRUE(message.view_kept);
  EXPECT_TRUE(to_isometry(message.pose).isApprox(report.T_world_camera, 1e-12));
  EXPECT_EQ(message.total_ms, 6.5);
  EXPECT_EQ(message.stage_names, (std::vector<std::string>{"first", "second"}));
  EXPECT_EQ(message.stage_ms, (std::vector<double>{1.5, 2.5}));
}

}  // namespace
}  // namespace frontier_surfels::messages
