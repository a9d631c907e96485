/// The thread that answers the mapper's services, and what all of its answers have in common.
#pragma once

#include <ros/callback_queue.h>
#include <ros/console.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <ros/spinner.h>

#include <exception>
#include <future>
#include <string>
#include <vector>

namespace frontier_surfels {

/// Has a callback queue of its own, because services wait for the current frame and must not hold up the images.
class ServiceThread {
 public:
  explicit ServiceThread(const ros::NodeHandle& pnh) : nh_(pnh) { nh_.setCallbackQueue(&queue_); }
  ~ServiceThread() { stop(); }

  /// Offers a service. @param handler  outlives the calls of this thread
  template <typename Message, typename Server>
  void serve(const std::string& name, bool (Server::*handler)(typename Message::Request&, typename Message::Response&), Server* server) {
    servers_.push_back(nh_.advertiseService(name, handler, server));
  }

  void start() { spinner_.start(); }

  /// No service is answered after this.
  void stop() {
    spinner_.stop();
    servers_.clear();
  }

 private:
  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;
  std::vector<ros::ServiceServer> servers_;
  ros::AsyncSpinner spinner_{1, &queue_};
};

/// Runs the job, and fills the response with the sentence that it returns or throws. @return false if the mapper is shutting down
template <typename Response, typename Job>
bool answer(Response& response, Job job) {
  try {
    response.message = job();
    response.success = true;
  } catch (const std::future_error&) {
    return false;
  } catch (const std::exception& fault) {
    response.message = fault.what();
    response.success = false;
    ROS_WARN("%s", fault.what());
  }
  return true;
}

}  // namespace frontier_surfels
