/// Large messages without holding up the process.
///
/// roscpp serialises in publish(), under a lock that every publisher of the process needs: a thread with a report of 1 kB waits for another
/// one's cloud of 80 MB. A Serialized is published in no time; it fits every topic. Subscribers of the same process get a copy, though:
/// for them a shared pointer is better.
#pragma once

#include <ros/message_traits.h>
#include <ros/serialization.h>

namespace frontier_surfels {

struct Serialized {
  ros::SerializedMessage bytes;
};

template <typename Message>
Serialized serialized(const Message& message) {
  return {ros::serialization::serializeMessage(message)};
}

}  // namespace frontier_surfels

namespace ros {
namespace message_traits {

template <>
struct MD5Sum<frontier_surfels::Serialized> {
  static const char* value() { return "*"; }
  static const char* value(const frontier_surfels::Serialized&) { return "*"; }
};

template <>
struct DataType<frontier_surfels::Serialized> {
  static const char* value() { return "*"; }
  static const char* value(const frontier_surfels::Serialized&) { return "*"; }
};

}  // namespace message_traits

namespace serialization {

template <>
inline SerializedMessage serializeMessage(const frontier_surfels::Serialized& message) {
  return message.bytes;
}

}  // namespace serialization
}  // namespace ros
