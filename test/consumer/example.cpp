#include <frontier_surfels/mapper.hpp>
#include <iostream>
using namespace frontier_surfels;

int main() {
  const std::vector<std::uint16_t> depth(640 * 480, 1500);  // a wall at 1.5 m: depth along the optical axis [mm]
  DepthFrame frame;
  frame.depth = {640, 480, 640 * sizeof(std::uint16_t), DepthImage::Encoding::kStepsU16, depth.data()};
  frame.intrinsics = {525, 525, 319.5, 239.5, 640, 480};  // fx, fy, cx, cy, width, height
  frame.T_world_camera = Eigen::Isometry3d::Identity();   // pose of the optical frame

  Mapper mapper;
  mapper.integrate(frame);
  std::size_t frontier = 0;
  for (const Surfel& surfel : mapper.surfels()) frontier += surfel.label == Label::kFrontier;
  std::cout << frontier << " of " << mapper.size() << " surfels are frontier.\n";
  mapper.save("wall.ply");
}
