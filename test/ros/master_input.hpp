/// A ROS master for a test that is a single program.
#pragma once

#include <gtest/gtest.h>
#include <ros/init.h>
#include <ros/master.h>
#include <ros/spinner.h>
#include <ros/time.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <iostream>
#include <string>

namespace frontier_surfels {

/// Starts a master on a port of its own, and sets ROS_MASTER_URI to it. To be made before ros::init().
class Master {
 public:
  Master() {
    const std::string port = std::to_string(20000 + getpid() % 20000);
    setenv("ROS_MASTER_URI", ("http://localhost:" + port).c_str(), 1);
    setenv("ROS_HOSTNAME", "localhost", 1);
    process_ = fork();
    if (process_ != 0) return;
    prctl(PR_SET_PDEATHSIG, SIGTERM);  // also if the test crashes
    execlp("rosmaster", "rosmaster", "--core", "-p", port.c_str(), nullptr);
    _exit(1);
  }
  Master(const Master&) = delete;
  Master& operator=(const Master&) = delete;
  ~Master() {
    kill(process_, SIGTERM);
    waitpid(process_, nullptr, 0);
  }

  /// Waits until it answers. @return false if it does not
  bool wait() const {
    for (int i = 0; i < 300; ++i) {
      if (ros::master::check()) return true;
      ros::WallDuration(0.1).sleep();
    }
    return false;
  }

 private:
  pid_t process_;
};

/// The main() of such a test. @return its exit code
inline int run_tests_with_master(int argc, char** argv, const char* name) {
  testing::InitGoogleTest(&argc, argv);
  const Master master;
  ros::init(argc, argv, name);
  if (!master.wait()) {
    std::cerr << "The ROS master does not start: run scripts/install_dependencies --test.\n";
    return 1;
  }
  ros::AsyncSpinner spinner(1);  // for what topics call back
  spinner.start();
  const int result = RUN_ALL_TESTS();
  spinner.stop();
  ros::shutdown();
  return result;
}

}  // namespace frontier_surfels
