/// Finds the topics of a bag that make up a depth recording.
#pragma once

#include <rosbag/bag.h>
#include <rosbag/message_instance.h>

#include <string>

#include "recordings/frame_source.hpp"
#include "ros/input/conversions.hpp"

namespace frontier_surfels::replay {

using messages::ImageMessage;
using messages::is_believed;

/// Names of topics, as they are written in the bag.
struct BagTopics {
  std::string depth;
  std::string info;
  std::string color;  ///< empty where there is none
};

/// Uses the topics named in `options`, and finds the others by their names, types and first messages.
/// @throws Error if a topic is missing, or there are several candidates; it lists them
BagTopics find_topics(const rosbag::Bag& bag, const SourceOptions& options);

/// The image of a message of a bag; empty if the message has another type.
ImageMessage to_image_message(const rosbag::MessageInstance& message);

}  // namespace frontier_surfels::replay
