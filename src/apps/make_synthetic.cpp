/// make_synthetic OUT: writes a recording of a synthetic furnished room as a folder of images with exact poses.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "apps/command.hpp"
#include "frontier_surfels/paths.hpp"
#include "synthetic/synthetic_room.hpp"

namespace fs = std::filesystem;
namespace replay = frontier_surfels::replay;
using frontier_surfels::FileError;

namespace {

struct Options {
  std::string output;
  int frames = 60;
  int width = 640;
  int height = 480;
  double focal = 0;  ///< [pixel]; 0: that of a Kinect
  replay::CameraPath path = replay::CameraPath::kOrbit;
  replay::SensorModel sensor;
};

/// Reads a size such as "640x480". @return an empty text, or what is wrong, as CLI11 validators do
std::string read_size(const std::string& text, int& width, int& height) {
  char rest = 0;
  const bool well_formed = std::sscanf(text.c_str(), "%dx%d%c", &width, &height, &rest) == 2;
  const bool fits = well_formed && std::min(width, height) >= 8 && std::max(width, height) <= 8192;
  return fits ? "" : "must be WIDTHxHEIGHT with 8 to 8192 pixels each, such as 640x480, not '" + text + "'.";
}

std::ofstream open_text(const fs::path& path) {
  std::ofstream file(path);
  file.precision(17);  // doubles are read back bit for bit
  if (!file) throw FileError(path.string() + " cannot be written: check that the folder is yours and has space.");
  return file;
}

void close_text(std::ofstream& file, const fs::path& path) {
  file.close();
  if (!file) throw FileError(path.string() + " cannot be written: check that there is space.");
}

void write_image(const fs::path& path, const cv::Mat& image) {
  bool written = false;
  try {
    written = cv::imwrite(path.string(), image);
  } catch (const cv::Exception&) {
  }
  if (!written) throw FileError(path.string() + " cannot be written: check that the folder is yours and has space.");
}

void make_folder(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error) throw FileError(path.string() + " cannot be made: " + error.message() + "; choose another folder.");
}

void write_camera(const fs::path& path, const frontier_surfels::Intrinsics& camera) {
  std::ofstream file = open_text(path);
  file << camera.fx << ' ' << camera.fy << ' ' << camera.cx << ' ' << camera.cy << ' ' << camera.width << ' ' << camera.height << '\n';
  close_text(file, path);
}

void write_pose(std::ofstream& file, const replay::RecordedFrame& frame) {
  const Eigen::Vector3d translation = frame.T_world_camera.translation();
  const Eigen::Quaterniond rotation(frame.T_world_camera.rotation());
  file << frame.stamp << ' ' << translation.x() << ' ' << translation.y() << ' ' << translation.z() << ' ' << rotation.x() << ' '
       << rotation.y() << ' ' << rotation.z() << ' ' << rotation.w() << '\n';
}

void write_sequence(const Options& options) {
  auto camera = replay::synthetic_camera(options.width, options.height);
  if (options.focal > 0) camera.fx = camera.fy = options.focal;
  const fs::path folder = frontier_surfels::absolute_path(options.output);
  make_folder(folder / "depth");
  if (!fs::is_empty(folder / "depth"))
    throw FileError((folder / "depth").string() + " already has images: choose another folder, or remove it.");
  make_folder(folder / "color");
  write_camera(folder / "camera.txt", camera);
  std::ofstream poses = open_text(folder / "poses.txt");
  poses << "# timestamp tx ty tz qx qy qz qw (camera to world, optical frame)\n";

  const replay::Room room;
  for (int index = 0; index < options.frames; ++index) {
    const replay::RecordedFrame frame = room.render(index, options.frames, camera, options.sensor, options.path);
    char name[32];
    std::snprintf(name, sizeof(name), "%06d", index);
    write_image(folder / "depth" / (std::string(name) + ".png"), frame.depth);
    write_image(folder / "color" / (std::string(name) + ".jpg"), frame.color);
    write_pose(poses, frame);
  }
  close_text(poses, folder / "poses.txt");
  std::printf("%d frames are in %s.\n", options.frames, folder.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Writes a synthetic sequence of depth and colour images with exact poses: depth/, color/, poses.txt, camera.txt.",
               "make_synthetic");
  app.option_defaults()->always_capture_default();
  app.add_option("OUT", options.output, "folder to write")->required()->check(replay::not_empty());
  app.add_option("--frames", options.frames, "number of frames along the whole path")->check(replay::whole_number(1, 999999));
  const std::map<std::string, replay::CameraPath> paths = {{"orbit", replay::CameraPath::kOrbit},
                                                           {"explore", replay::CameraPath::kExplore},
                                                           {"turn", replay::CameraPath::kTurn},
                                                           {"walk", replay::CameraPath::kWalk},
                                                           {"close", replay::CameraPath::kClose}};
  std::string path = "orbit";
  app.add_option(
         "--path", path,
         "path of the camera: orbit (around the table), explore (around the table, looking everywhere), turn (on the spot), walk (into "
         "the corridor) or close (near the furniture)")
      ->check(replay::one_of({"orbit", "explore", "turn", "walk", "close"}));
  app.add_option("--focal", options.focal, "focal length [pixel]; 0: fx and fy of a Kinect")->check(replay::number(0, 1e5));
  app.add_flag("--noise", options.sensor.noise,
               "depth noise like that of a Kinect: standard deviation 1.425e-3 z^2 [m], whole steps of disparity");
  app.add_option("--dropouts", options.sensor.dropouts,
                 "share of pixels that are lost in blobs; above 0, most pixels at edges and at grazing angles are lost as well")
      ->check(replay::number(0, 0.9));
  app.add_option("--seed", options.sensor.seed, "seed of noise and dropouts");
  std::string size = "640x480";
  app.add_option("--size", size, "width and height of the images [pixel]")->check([&](const std::string& text) {
    return read_size(text, options.width, options.height);
  });
  return replay::run_command("make_synthetic", "make smaller images (--size).", [&] {
    replay::parse_arguments(app, argc, argv);
    options.path = paths.at(path);
    write_sequence(options);
  });
}
