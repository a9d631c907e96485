/// Finds the topics of a bag that make up a depth recording.
#pragma once

#include <rosbag/bag.h>
#include <rosbag/message_instance.h>

#include <string>

#include "recordings/frame_source.hpp"
#include "ros/input/conversions.hpp"

namespace frontier_surfels::replay {

using messages::ImageMessage;

/// Names as they stand in the bag.
struct BagTopics {
  std::string depth;
  std::string info;
  std::string color;  ///< empty where there is none
};

/// Takes the topics named in `options`; finds the others by their names, types and first messages.
/// @throws Error that lists the candidates if one is missing or there are several
BagTopics find_topics(const rosbag::Bag& bag, const SourceOptions& options);

/// The image of a bag's message; an empty one if it is of another type.
ImageMessage to_image_message(const rosbag::MessageInstance& message);

}  // namespace frontier_surfels::replay
