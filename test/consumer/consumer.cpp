// Maps one frame of a wall, saves the map and reads it again. Exit code 0 if that worked.
#include <frontier_surfels/mapper.hpp>
#include <frontier_surfels/ply.hpp>
#include <frontier_surfels/scoring/exact_test.hpp>
#include <iostream>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::vector<std::uint16_t> wall(160 * 120, 1500);  // [mm]
  frontier_surfels::DepthFrame frame;
  frame.intrinsics = {131.25, 131.25, 79.5, 59.5, 160, 120};
  frame.depth.width = 160;
  frame.depth.height = 120;
  frame.depth.step = 160 * sizeof(std::uint16_t);
  frame.depth.data = wall.data();
  frame.T_world_camera = Eigen::Isometry3d::Identity();

  frontier_surfels::Config config;
  config.decimation = 1;
  frontier_surfels::Mapper mapper(config);
  const std::size_t surfels = mapper.integrate(frame).surfels;
  mapper.save(argv[1]);
  const std::size_t read = frontier_surfels::read_ply(argv[1]).size();
  frontier_surfels::scoring::ExactTest test(config.z_min, config.z_max, config.decimation);
  test.add(frame);
  std::cout << surfels << " surfels on " << mapper.device() << "\n";
  return surfels > 0 && read == surfels && test.known({0, 0, 1}) && !test.known({0, 0, 1.6}) ? 0 : 1;
}
