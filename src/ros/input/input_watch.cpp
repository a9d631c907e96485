#include "ros/input/input_watch.hpp"

#include <utility>

namespace frontier_surfels {
namespace {

constexpr auto kPatience = std::chrono::seconds(5);

}  // namespace

InputWatch::InputWatch(const ros::NodeHandle& nh, const std::vector<std::unique_ptr<CameraInput>>& cameras, Tell tell)
    : cameras_(cameras), tell_(std::move(tell)) {
  timer_ = ros::NodeHandle(nh).createWallTimer(ros::WallDuration(1), [this](const ros::WallTimerEvent&) { look(); });
}

void InputWatch::look() {
  const WarningThrottle::Clock::time_point now = WarningThrottle::Clock::now();
  if (now - start_ < kPatience) return;
  std::vector<std::string> sentences;
  if (ros::Time::isSimTime() && ros::Time::now().isZero())
    sentences.emplace_back(
        "No /clock has come, although /use_sim_time is true: start what publishes it (`rosbag play --clock`, or a simulator), or set "
        "/use_sim_time to false and start the mapper again.");
  for (const auto& camera : cameras_) {
    for (const std::string& sentence : camera->missing()) sentences.push_back(sentence);
  }
  for (const std::string& sentence : sentences) {
    if (told_.due(sentence, now) > 0) tell_(sentence);
  }
}

}  // namespace frontier_surfels
