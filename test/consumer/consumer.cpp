// Maps one frame, saves the map in both formats and reads it again. Exit code 0 if that worked.
#include <frontier_surfels/map_file.hpp>
#include <frontier_surfels/mapper.hpp>
#include <iostream>
#include <string>

#include "wall.hpp"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  frontier_surfels::Config config;
  config.decimation = 1;
  frontier_surfels::Mapper mapper(config);
  const std::size_t surfels = mapper.integrate(Wall().frame).surfels;
  bool good = surfels > 0;
  for (const char* ending : {".ply", ".pcd"}) {
    mapper.save(argv[1] + std::string(ending));
    good = good && frontier_surfels::read_map(argv[1] + std::string(ending)).size() == surfels;
  }
  std::cout << surfels << " surfels on " << mapper.device() << "\n";
  return good ? 0 : 1;
}
