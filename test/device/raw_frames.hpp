/// Frames of a recording in one file that needs no image library: for machines that have nothing but an OpenCL driver.
///
/// The file: the line "frontier_surfels raw frames 1", then numbers of this machine, which is little endian: int32 width, height, frames;
/// double fx, fy, cx, cy, depth_unit; and for each frame double stamp, T_world_camera (3 x 4, by rows), uint16 depth[height][width].
#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

constexpr const char* kRawFramesTitle = "frontier_surfels raw frames 1\n";
constexpr double kRawDepthUnit = 0.0002;  ///< [m] both of millimetres and of TUM's depths a whole number of steps

struct RawFrame {
  double stamp = 0;  ///< [s]
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  std::vector<std::uint16_t> depth;  ///< [height][width], in steps of kRawDepthUnit; 0: no measurement
};

/// All of one camera.
struct RawFrames {
  Intrinsics intrinsics;
  std::vector<RawFrame> frames;

  DepthFrame view(std::size_t n) const {
    const RawFrame& raw = frames[n];
    DepthFrame frame;
    frame.stamp = raw.stamp;
    frame.T_world_camera = raw.T_world_camera;
    frame.intrinsics = intrinsics;
    frame.depth.width = intrinsics.width;
    frame.depth.height = intrinsics.height;
    frame.depth.step = sizeof(std::uint16_t) * static_cast<std::size_t>(intrinsics.width);
    frame.depth.data = raw.depth.data();
    return frame;
  }
};

namespace raw_frames {

template <typename T>
void put(std::ostream& file, const T* values, std::size_t count) {
  file.write(reinterpret_cast<const char*>(values), static_cast<std::streamsize>(count * sizeof(T)));
}

template <typename T>
void get(std::istream& file, T* values, std::size_t count) {
  file.read(reinterpret_cast<char*>(values), static_cast<std::streamsize>(count * sizeof(T)));
}

}  // namespace raw_frames

/// @throws FileError
inline void write_raw_frames(const std::string& path, const RawFrames& all) {
  std::ofstream file(path, std::ios::binary);
  file << kRawFramesTitle;
  const Intrinsics& camera = all.intrinsics;
  const std::int32_t sizes[] = {camera.width, camera.height, static_cast<std::int32_t>(all.frames.size())};
  const double numbers[] = {camera.fx, camera.fy, camera.cx, camera.cy, kRawDepthUnit};
  raw_frames::put(file, sizes, 3);
  raw_frames::put(file, numbers, 5);
  for (const RawFrame& frame : all.frames) {
    const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> T = frame.T_world_camera.matrix().topRows<3>();
    raw_frames::put(file, &frame.stamp, 1);
    raw_frames::put(file, T.data(), 12);
    raw_frames::put(file, frame.depth.data(), frame.depth.size());
  }
  file.close();
  if (!file) throw FileError("Cannot write the frames to " + path + ": is the disk full, or the folder missing?");
}

/// @throws FileError
inline RawFrames read_raw_frames(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw FileError("Cannot read " + path + ".");
  std::string title(std::string(kRawFramesTitle).size(), ' ');
  raw_frames::get(file, title.data(), title.size());
  std::int32_t sizes[3] = {};
  double numbers[5] = {};
  raw_frames::get(file, sizes, 3);
  raw_frames::get(file, numbers, 5);
  if (!file || title != kRawFramesTitle || sizes[0] < 1 || sizes[1] < 1 || sizes[2] < 1 || sizes[0] > 10000 || sizes[1] > 10000)
    throw FileError(path + " is no file of raw frames: make one with raw_frames RECORDING FILE.");
  RawFrames all;
  all.intrinsics = {numbers[0], numbers[1], numbers[2], numbers[3], sizes[0], sizes[1]};
  for (std::int32_t n = 0; n < sizes[2]; ++n) {
    RawFrame frame;
    Eigen::Matrix<double, 3, 4, Eigen::RowMajor> T;
    frame.depth.resize(static_cast<std::size_t>(sizes[0]) * static_cast<std::size_t>(sizes[1]));
    raw_frames::get(file, &frame.stamp, 1);
    raw_frames::get(file, T.data(), 12);
    raw_frames::get(file, frame.depth.data(), frame.depth.size());
    if (!file) throw FileError(path + " ends in frame " + std::to_string(n) + ": make it anew.");
    frame.T_world_camera.matrix().topRows<3>() = T;
    all.frames.push_back(std::move(frame));
  }
  return all;
}

}  // namespace frontier_surfels
