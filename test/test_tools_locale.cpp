/// Text files, options and tables of the tools are in the C locale, whatever locale the program has.
#include <fstream>

#include "frontier_surfels/scoring/octomap_truth.hpp"
#include "locale_input.hpp"
#include "recordings/text_files.hpp"
#include "replay/progress.hpp"
#include "replay/summary.hpp"
#include "replay/sweep.hpp"

namespace frontier_surfels::replay {
namespace {

void write(const std::filesystem::path& path, const std::string& text) { std::ofstream(path) << text; }

/// Everything that is read and said, as one text.
std::string all_texts(const std::filesystem::path& folder) {
  std::ostringstream said;
  said.imbue(std::locale::classic());
  said.precision(17);
  write(folder / "poses.txt", "1234567.5 0.25 -1e-3 2 0 0 0 1\n12345678.125 nan 0 inf 0 0 0 1\n");
  for (const StampedPose& pose : read_poses(folder / "poses.txt")) {
    said << pose.stamp;
    for (const double number : pose.pose) said << " " << number;
    said << "\n";
  }
  write(folder / "depth.txt", "1234567.5 depth/1.png\n");
  said << read_file_list(folder / "depth.txt").front().stamp << "\n";
  write(folder / "camera.txt", "525.5 525.25 319.5 239.5 1640 1480\n");
  const Intrinsics camera = read_camera(folder / "camera.txt");
  for (const double number : {camera.fx, camera.fy, camera.cx, camera.cy}) said << number << " ";
  said << camera.width << " " << camera.height << "\n";
  write(folder / "camera.txt", "525,5 525,25 319,5 239,5 640 480\n");
  try {
    read_camera(folder / "camera.txt");
  } catch (const Error& error) {
    said << error.what() << "\n";
  }

  Config config;
  const auto fault_of_octomap = [&](double resolution) {
    try {
      const scoring::OctomapTruth truth(resolution, config);
    } catch (const Error& error) {
      said << error.what() << "\n";
    }
  };
  fault_of_octomap(-0.5);
  config.z_max = 0.125;
  fault_of_octomap(0.5);
  config.z_max = 2.5;
  config.depth_unit = -0.5;
  fault_of_octomap(0.5);

  for (const Config& swept : parse_sweep("th_d=0.125:0.375:3", Config()).configs) said << swept.th_d << "\n";
  said << Progress::line("Mapping", 1234, 5678, "frames", 12.5) << "\n";
  FrameRecord frame;
  frame.report.stamp = 1234567.5;
  frame.report.surfels = 1234567;
  frame.report.total_ms = 1.5;
  frame.T_world_camera.setIdentity();
  frame.T_world_camera.translation().x() = 0.1;
  said << frames_csv({frame}) << trajectory_text({frame});
  return said.str();
}

TEST_F(LocaleTest, OfStreamsChangesNoTextOfTheTools) {
  compare_with_streams([&] { return all_texts(folder_); });
}

TEST_F(LocaleTest, OfTheCLibraryChangesNoTextOfTheTools) {
  compare_with_the_c_library([&] { return all_texts(folder_); });
}

}  // namespace
}  // namespace frontier_surfels::replay
