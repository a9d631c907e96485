#include "ros/simulation/simulation_parameters.hpp"

#include <cmath>
#include <set>

#include "ros/input/conversions.hpp"
#include "ros/input/parameter_reader.hpp"

namespace frontier_surfels {

std::vector<std::string> SimulationConfig::problems() const {
  std::vector<std::string> faults;
  for_each_simulation_field(*this, RangeCheck(faults));
  const std::set<std::string> frames = {messages::strip_slash(world_frame), messages::strip_slash(body_frame),
                                        messages::strip_slash(camera_frame)};
  if (frames.size() < 3 || frames.count("") > 0)
    faults.emplace_back("world_frame, body_frame and camera_frame must be three different names, none of them empty.");
  if (z_max <= z_min) faults.emplace_back("z_max must be above z_min.");
  if (highest < lowest) faults.emplace_back("highest must not be below lowest.");
  return faults;
}

Eigen::Isometry3d SimulationConfig::start() const {
  return Eigen::Translation3d(start_x, start_y, start_z) * Eigen::Isometry3d(Eigen::AngleAxisd(start_yaw, Eigen::Vector3d::UnitZ()));
}

replay::SimulatedCameraOptions SimulationConfig::camera() const {
  replay::SimulatedCameraOptions options;
  options.intrinsics = replay::camera_of_view(width, height, fov);
  options.sensor.noise = noise;
  options.sensor.dropouts = dropouts;
  options.sensor.seed = static_cast<std::uint64_t>(seed);
  options.radius = radius;
  options.threads = threads;
  return options;
}

replay::CoverageOptions SimulationConfig::coverage() const {
  replay::CoverageOptions options;
  options.spacing = coverage_spacing;
  options.lowest = lowest;
  options.highest = highest;
  options.clearance = radius;
  options.z_min = z_min;
  options.z_max = z_max;
  options.noise_growth = noise ? replay::kKinectNoiseGrowth : 0;
  options.threads = threads;
  return options;
}

SimulationConfig read_simulation_parameters(const ros::NodeHandle& pnh, std::vector<std::string>& warnings) {
  SimulationConfig config;
  std::string faults;
  Parameters parameters = list_parameters(pnh.getNamespace());
  for_each_simulation_field(config, ParameterReader(parameters, faults));
  for (const std::string& problem : config.problems()) faults += problem + "\n";
  throw_if_any(faults);
  for (std::string* frame : {&config.world_frame, &config.body_frame, &config.camera_frame}) *frame = messages::strip_slash(*frame);
  for (const auto& entry : parameters)
    warnings.push_back("There is no parameter ~" + entry.first + ": `simulated_camera --help` lists them.");
  return config;
}

std::string simulation_parameter_table() {
  ParameterTable table;
  const SimulationConfig defaults;
  for_each_simulation_field(defaults, [&table](FieldInfo info, const auto& value) {
    info.group = "Simulated camera";
    table(info, value);
  });
  return table.text();
}

}  // namespace frontier_surfels
