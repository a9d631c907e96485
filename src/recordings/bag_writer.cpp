#include "recordings/bag_writer.hpp"

#include <cv_bridge/cv_bridge.h>
#include <rosbag/bag.h>
#include <sensor_msgs/image_encodings.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>
#include <opencv2/imgcodecs.hpp>

#include "config/config_text.hpp"
#include "ros/input/conversions.hpp"

namespace frontier_surfels::replay {

using messages::CompressedDepthHeader;
using messages::InverseDepthQuantisation;

namespace {

namespace encodings = sensor_msgs::image_encodings;
constexpr float kMillimetresPerMetre = 1000.0f;

/// The parameters of inverse depth that compressed_depth_image_transport itself uses.
InverseDepthQuantisation default_quantisation() {
  constexpr float kLargestDepth = 10, kQuantisation = 100;
  const float a = kQuantisation * (kQuantisation + 1);
  return {a, 1 - a / kLargestDepth};
}

/// Depth as CV_32FC1 [m], where NaN means no measurement (REP 118). @param depth_unit  of 16-bit images [m]
cv::Mat to_metres(const cv::Mat& depth, double depth_unit) {
  if (depth.type() == CV_32FC1) return depth;
  cv::Mat metres(depth.size(), CV_32FC1);
  std::transform(depth.begin<std::uint16_t>(), depth.end<std::uint16_t>(), metres.begin<float>(), [depth_unit](std::uint16_t value) {
    return value == 0 || value == 65535 ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(value * depth_unit);
  });
  return metres;
}

/// `value` as 16 bits, or 0 (no measurement) if it does not fit.
std::uint16_t to_sixteen_bits(float value) {
  return std::isfinite(value) && value > 0 && value < 65535.5f ? static_cast<std::uint16_t>(std::lround(value)) : 0;
}

cv::Mat to_millimetres(const cv::Mat& depth, double depth_unit) {
  if (depth.type() == CV_16UC1 && depth_unit == BagOptions().depth_unit) return depth;
  const cv::Mat metres = to_metres(depth, depth_unit);
  cv::Mat millimetres(depth.size(), CV_16UC1);
  std::transform(metres.begin<float>(), metres.end<float>(), millimetres.begin<std::uint16_t>(),
                 [](float value) { return to_sixteen_bits(value * kMillimetresPerMetre); });
  return millimetres;
}

sensor_msgs::CompressedImage to_compressed_depth(const cv::Mat& depth, const std::string& encoding) {
  CompressedDepthHeader header{};
  cv::Mat values = depth;
  if (encoding == encodings::TYPE_32FC1) {
    header.quantisation = default_quantisation();
    values = cv::Mat(depth.size(), CV_16UC1);
    std::transform(depth.begin<float>(), depth.end<float>(), values.begin<std::uint16_t>(),
                   [&](float metres) { return to_sixteen_bits(header.quantisation.a / metres + header.quantisation.b); });
  }
  std::vector<std::uint8_t> png;
  cv::imencode(".png", values, png);

  sensor_msgs::CompressedImage message;
  message.format = encoding + "; compressedDepth";
  message.data.resize(sizeof(header));
  std::memcpy(message.data.data(), &header, sizeof(header));
  message.data.insert(message.data.end(), png.begin(), png.end());
  return message;
}

sensor_msgs::CompressedImage to_jpeg(const cv::Mat& color) {
  sensor_msgs::CompressedImage message;
  message.format = "bgr8; jpeg compressed bgr8";
  cv::imencode(".jpg", color, message.data, {cv::IMWRITE_JPEG_QUALITY, 95});
  return message;
}

struct Link {
  const char* parent;
  const char* child;
  Eigen::Isometry3d T_parent_child;
};

/// The chain of frames from the tracked body to the optical frame. The numbers are made up but plausible: the camera sits a few centimetres
/// from the centre of the body, and the optical frame has z forward instead of x.
std::vector<Link> constant_links() {
  const Eigen::Isometry3d optical(Eigen::Quaterniond(-0.5, 0.5, -0.5, 0.5));
  return {{"kinect", "openni_camera", Eigen::Isometry3d(Eigen::Translation3d(0.03125, 0, 0.0625))},
          {"openni_camera", "openni_rgb_frame", Eigen::Isometry3d(Eigen::Translation3d(0, -0.046875, 0))},
          {"openni_rgb_frame", "openni_rgb_optical_frame", optical}};
}

/// The destructor of a bag that is open closes it, and ends the program if that fails, as it does on a full disk. A bag that could not be
/// closed is therefore kept and never destroyed.
struct BagDeleter {
  void operator()(rosbag::Bag* bag) const {
    static auto* const unclosed = new std::vector<rosbag::Bag*>();
    if (bag->isOpen()) {
      unclosed->push_back(bag);
    } else {
      delete bag;
    }
  }
};

class Writer {
 public:
  Writer(const std::string& path, const BagOptions& options) : options_(options), links_(constant_links()) {
    bag_->open(path, rosbag::bagmode::Write);
    if (options.compression == "lz4") bag_->setCompression(rosbag::compression::LZ4);
    if (options.compression == "bz2") bag_->setCompression(rosbag::compression::BZ2);
  }

  void write(const RecordedFrame& frame, const ros::Time& stamp) {
    write_transforms(frame.T_world_camera, stamp);
    write_depth(frame, stamp);
    if (!frame.color.empty()) write_color(frame, stamp);
    first_ = false;
  }

  void close() { bag_->close(); }

 private:
  void write_transforms(const Eigen::Isometry3d& T_world_camera, const ros::Time& stamp) {
    Eigen::Isometry3d T_kinect_camera = Eigen::Isometry3d::Identity();
    tf2_msgs::TFMessage constant;
    for (const Link& link : links_) {
      T_kinect_camera = T_kinect_camera * link.T_parent_child;
      constant.transforms.push_back(to_message(link, stamp));
    }
    tf2_msgs::TFMessage moving;
    moving.transforms.push_back(to_message({"world", "kinect", T_world_camera * T_kinect_camera.inverse()}, stamp));
    if (!options_.static_transforms) {
      moving.transforms.insert(moving.transforms.end(), constant.transforms.begin(), constant.transforms.end());
    } else if (first_) {
      bag_->write("/tf_static", stamp, constant, latched_header());
    }
    bag_->write("/tf", stamp, moving);
  }

  void write_depth(const RecordedFrame& frame, const ros::Time& stamp) {
    const cv::Mat depth = options_.encoding == encodings::TYPE_32FC1 ? to_metres(frame.depth, options_.depth_unit)
                                                                     : to_millimetres(frame.depth, options_.depth_unit);
    if (options_.compressed) {
      publish(options_.depth_topic + "/compressedDepth", to_compressed_depth(depth, options_.encoding), stamp);
    } else {
      publish(options_.depth_topic, *cv_bridge::CvImage(std_msgs::Header(), options_.encoding, depth).toImageMsg(), stamp);
    }
    publish(options_.depth_info_topic, messages::to_camera_info(frame.intrinsics), stamp);
  }

  void write_color(const RecordedFrame& frame, const ros::Time& stamp) {
    if (options_.compressed) {
      publish(options_.color_topic + "/compressed", to_jpeg(frame.color), stamp);
    } else {
      publish(options_.color_topic, *cv_bridge::CvImage(std_msgs::Header(), encodings::BGR8, frame.color).toImageMsg(), stamp);
    }
    publish(options_.color_info_topic, messages::to_camera_info(frame.intrinsics), stamp);
  }

  template <typename Message>
  void publish(const std::string& topic, Message message, const ros::Time& stamp) {
    message.header.stamp = stamp;
    message.header.frame_id = frame_name("openni_rgb_optical_frame");
    bag_->write(topic, stamp, message);
  }

  std::string frame_name(const std::string& name) const { return (options_.leading_slashes ? "/" : "") + name; }

  geometry_msgs::TransformStamped to_message(const Link& link, const ros::Time& stamp) const {
    geometry_msgs::TransformStamped message;
    message.header.stamp = stamp;
    message.header.frame_id = frame_name(link.parent);
    message.child_frame_id = frame_name(link.child);
    const Eigen::Vector3d translation = link.T_parent_child.translation();
    const Eigen::Quaterniond rotation = Eigen::Quaterniond(link.T_parent_child.rotation()).normalized();
    message.transform.translation.x = translation.x();
    message.transform.translation.y = translation.y();
    message.transform.translation.z = translation.z();
    message.transform.rotation.x = rotation.x();
    message.transform.rotation.y = rotation.y();
    message.transform.rotation.z = rotation.z();
    message.transform.rotation.w = rotation.w();
    return message;
  }

  /// With this header `rosbag play` publishes the message latched, so that late subscribers get it as well.
  static boost::shared_ptr<ros::M_string> latched_header() {
    namespace traits = ros::message_traits;
    return boost::make_shared<ros::M_string>(ros::M_string{{"latching", "1"},
                                                           {"callerid", "/sequence_to_bag"},
                                                           {"type", traits::datatype<tf2_msgs::TFMessage>()},
                                                           {"md5sum", traits::md5sum<tf2_msgs::TFMessage>()},
                                                           {"message_definition", traits::definition<tf2_msgs::TFMessage>()}});
  }

  BagOptions options_;
  std::vector<Link> links_;
  std::unique_ptr<rosbag::Bag, BagDeleter> bag_{new rosbag::Bag()};
  bool first_ = true;
};

void check(const BagOptions& options) {
  if (options.encoding != "32FC1" && options.encoding != "16UC1") {
    throw Error("Depth is written as 32FC1 or 16UC1, not as '" + options.encoding + "'.");
  }
  if (!(options.depth_unit > 0 && std::isfinite(options.depth_unit))) throw Error("The depth unit must be above 0.");
  if (options.compression != "none" && options.compression != "lz4" && options.compression != "bz2") {
    throw Error("A bag's compression is none, lz4 or bz2, not '" + options.compression + "'.");
  }
}

ros::Time to_ros_time(double stamp) {
  if (!(stamp > 0) || stamp >= std::numeric_limits<std::uint32_t>::max()) {
    throw Error("The stamp " + to_text(stamp) +
                " s is not a valid time of ROS, which must be above 0 and below 2^32 s: correct the stamps of the recording.");
  }
  return ros::Time(stamp);
}

}  // namespace

BagSummary write_bag(FrameSource& source, const std::string& path, const BagOptions& options) {
  check(options);
  const std::string temporary = path + ".active";
  BagSummary summary;
  try {
    Writer writer(temporary, options);
    while (const std::optional<RecordedFrame> frame = source.next()) {
      if (summary.frames == 0 && frame->stamp < 1) summary.stamp_shift = 1 - std::floor(frame->stamp);
      writer.write(*frame, to_ros_time(frame->stamp + summary.stamp_shift));
      ++summary.frames;
    }
    writer.close();
    if (summary.frames == 0)
      throw Error("No frame of the recording can be used, so no bag is written: check the recording with replay_score.");
    std::filesystem::rename(temporary, path);
  } catch (const std::exception& error) {
    std::error_code ignored;
    std::filesystem::remove(temporary, ignored);
    if (dynamic_cast<const Error*>(&error)) throw;
    throw FileError(path + " cannot be written (" + error.what() + "): check that the folder exists and has space.");
  }
  return summary;
}

}  // namespace frontier_surfels::replay
