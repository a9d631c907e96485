/// Large messages that are published without holding up other threads.
///
/// roscpp serialises messages in publish(), with a lock that every publisher of the process needs: a report of 1 kB then waits for a cloud
/// of 80 MB of another thread. A Serialized message is serialised before, fits every topic, and is published at once. Subscribers in the
/// same process get a copy of it; for them a shared pointer to the message is better.
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
