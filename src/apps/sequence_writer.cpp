#include "apps/sequence_writer.hpp"

#include <cstdio>
#include <opencv2/imgcodecs.hpp>

namespace frontier_surfels::replay {
namespace fs = std::filesystem;
namespace {

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

void write_camera(const fs::path& path, const Intrinsics& camera) {
  std::ofstream file = open_text(path);
  file << camera.fx << ' ' << camera.fy << ' ' << camera.cx << ' ' << camera.cy << ' ' << camera.width << ' ' << camera.height << '\n';
  close_text(file, path);
}

}  // namespace

SequenceWriter::SequenceWriter(const fs::path& folder, const Intrinsics& camera) : folder_(folder) {
  make_folder(folder / "depth");
  if (!fs::is_empty(folder / "depth"))
    throw FileError((folder / "depth").string() + " already has images: choose another folder, or remove it.");
  write_camera(folder / "camera.txt", camera);
  poses_ = open_text(folder / "poses.txt");
  poses_ << "# timestamp tx ty tz qx qy qz qw (camera to world, optical frame)\n";
}

void SequenceWriter::add(const RecordedFrame& frame) {
  char name[32];
  std::snprintf(name, sizeof(name), "%06zu", frame.index);
  write_image(folder_ / "depth" / (std::string(name) + (frame.depth.type() == CV_32FC1 ? ".tiff" : ".png")), frame.depth);
  if (!frame.color.empty()) {
    make_folder(folder_ / "color");
    write_image(folder_ / "color" / (std::string(name) + ".jpg"), frame.color);
  }
  const Eigen::Vector3d translation = frame.T_world_camera.translation();
  const Eigen::Quaterniond rotation(frame.T_world_camera.rotation());
  poses_ << frame.stamp << ' ' << translation.x() << ' ' << translation.y() << ' ' << translation.z() << ' ' << rotation.x() << ' '
         << rotation.y() << ' ' << rotation.z() << ' ' << rotation.w() << '\n';
}

void SequenceWriter::close() { close_text(poses_, folder_ / "poses.txt"); }

void write_text(const fs::path& path, const std::string& text) {
  std::ofstream file = open_text(path);
  file << text;
  close_text(file, path);
}

}  // namespace frontier_surfels::replay
