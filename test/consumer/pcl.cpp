// Reads a saved map and turns it into a cloud of PCL and back. Exit code 0 if nothing of it was lost.
#include <frontier_surfels/map_file.hpp>
#include <frontier_surfels/pcl.hpp>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const auto surfels = frontier_surfels::read_map(argv[1]);
  const pcl::PointCloud<pcl::PointSurfel> cloud = frontier_surfels::to_pcl(surfels);
  const auto back = frontier_surfels::from_pcl(cloud);
  bool good = !surfels.empty() && cloud.size() == surfels.size() && back.size() == surfels.size();
  for (std::size_t n = 0; good && n < back.size(); ++n)
    good = back[n].position == surfels[n].position && back[n].label == surfels[n].label && back[n].rgb == surfels[n].rgb;
  return good ? 0 : 1;
}
