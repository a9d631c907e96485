/// The parameters of the simulated camera's node.
#pragma once

#include <ros/node_handle.h>

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "synthetic/coverage.hpp"
#include "synthetic/simulated_camera.hpp"

namespace frontier_surfels {

/// All parameters under `~`.
struct SimulationConfig {
  std::string world_frame = "map";
  std::string body_frame = "base_link";
  std::string camera_frame = "camera_optical";
  double start_x = 0.8, start_y = 3.95, start_z = 1.2, start_yaw = 0;
  double radius = 0.2;
  int width = 320, height = 240;
  double fov = replay::kKinectView;
  bool noise = false;
  double dropouts = 0;
  int seed = 1;
  double publish_rate = 0;
  double z_min = 0.5, z_max = 3;
  double coverage_spacing = 0.05;
  double lowest = 0.4, highest = 2.1;
  int threads = 0;

  /// Every fault, one sentence each; empty when the configuration can be used.
  std::vector<std::string> problems() const;

  Eigen::Isometry3d start() const;  ///< T_world_body
  replay::SimulatedCameraOptions camera() const;
  replay::CoverageOptions coverage() const;
};

/// Calls visit(FieldInfo, field) for every field, in order; see for_each_field.
template <typename ConfigT, typename Visitor>
void for_each_simulation_field(ConfigT& config, Visitor&& visit) {
  constexpr double kFar = 1000;
  visit(FieldInfo{"world_frame", "", "tf frame in which the flat stands"}, config.world_frame);
  visit(FieldInfo{"body_frame", "", "tf frame of the body that is moved: x forward, y left, z up"}, config.body_frame);
  visit(FieldInfo{"camera_frame", "", "tf frame of the images: x right, y down, z forward, with the body's origin"}, config.camera_frame);
  visit(FieldInfo{"start_x", "m", "where the camera starts; the flat lies from 0 to 10 in x, ...", -kFar, kFar}, config.start_x);
  visit(FieldInfo{"start_y", "m", "... from 0 to 8 in y ...", -kFar, kFar}, config.start_y);
  visit(FieldInfo{"start_z", "m", "... and from 0 to 2.5 in z", -kFar, kFar}, config.start_z);
  visit(FieldInfo{"start_yaw", "rad", "direction in which it looks then, from x towards y", -kFar, kFar}, config.start_yaw);
  visit(FieldInfo{"radius", "m", "of a ball around the camera that must stay free of solids", 0, 1}, config.radius);
  visit(FieldInfo{"width", "pixel", "of the images", 8, 4096}, config.width);
  visit(FieldInfo{"height", "pixel", "of the images", 8, 4096}, config.height);
  visit(FieldInfo{"fov", "degree", "horizontal field of view", 5, 150}, config.fov);
  visit(FieldInfo{"noise", "", "whether the depth has a Kinect's noise; images are then 16UC1 [mm] instead of 32FC1 [m]"}, config.noise);
  visit(FieldInfo{"dropouts", "", "share of pixels lost in blobs; above 0, most at edges are lost as well, and images are 16UC1", 0, 0.9},
        config.dropouts);
  visit(FieldInfo{"seed", "", "of noise and dropouts", 0, 2147483647}, config.seed);
  visit(FieldInfo{"publish_rate", "Hz", "images from where the camera is; 0: only one after each move and for each ~capture", 0, 100},
        config.publish_rate);
  visit(FieldInfo{"z_min", "m", "nearest depth that counts for ~coverage; the mapper's", 0.001, 100}, config.z_min);
  visit(FieldInfo{"z_max", "m", "farthest depth that counts for ~coverage; the mapper's", 0.001, 100}, config.z_max);
  visit(FieldInfo{"lowest", "m", "height from which on the camera can be anywhere, for what can be seen at all", -kFar, kFar},
        config.lowest);
  visit(FieldInfo{"highest", "m", "height up to which it can", -kFar, kFar}, config.highest);
  visit(FieldInfo{"coverage_spacing", "m", "of the points that are counted for ~coverage", 0.01, 1}, config.coverage_spacing);
  visit(FieldInfo{"threads", "", "0: as many as the machine has", 0, 1024}, config.threads);
}

/// Reads all parameters in the namespace of `pnh`.
/// @param warnings  gets a sentence for every unknown parameter there
/// @throws Error with every fault: wrong types, values out of range
SimulationConfig read_simulation_parameters(const ros::NodeHandle& pnh, std::vector<std::string>& warnings);

/// The table of the parameters, for --help.
std::string simulation_parameter_table();

}  // namespace frontier_surfels
