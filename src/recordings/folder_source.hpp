/// Reads recordings that are folders of images and text files.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "recordings/frame_source.hpp"
#include "recordings/selection.hpp"

namespace frontier_surfels::replay {

/// The pose tx ty tz qx qy qz qw of a line of poses.txt. @throws BadFrame if the numbers are not a pose
Eigen::Isometry3d to_pose(const std::vector<double>& numbers);

/// A folder has one of two layouts:
///   depth/NAME.png (16 bit, mm) or .tiff (32-bit float, m) + poses.txt + camera.txt, optionally color/NAME.jpg or .png
///   TUM RGB-D: depth.txt + groundtruth.txt (16-bit images, 5000 units for a metre), optionally rgb.txt and camera.txt
/// poses.txt and groundtruth.txt have lines `stamp tx ty tz qx qy qz qw`, camera to world, optical frame; camera.txt has `fx fy cx cy width
/// height`.
class FolderSource : public FrameSource {
 public:
  /// The files and the pose of a frame, before any image is read.
  struct Entry {
    double stamp = 0;  ///< [s]
    std::filesystem::path depth;
    std::filesystem::path color;  ///< empty if there is none
    std::vector<double> pose;     ///< tx ty tz qx qy qz qw as recorded; empty if there is none
  };

  FolderSource(const std::filesystem::path& folder, const SourceOptions& options);

  std::size_t size() const override { return selection_.count; }
  std::optional<RecordedFrame> next() override;
  const std::vector<std::string>& skipped() const override { return skipped_; }
  const std::vector<std::string>& notes() const override { return notes_; }
  std::string world_frame() const override { return "world of " + poses_file(); }
  std::string if_still() const override { return "correct the poses in " + poses_file(); }

  /// All frames of the recording, selected or not, in their order.
  const std::vector<Entry>& entries() const { return entries_; }
  const Intrinsics& intrinsics() const { return intrinsics_; }
  /// Reads the frame with this place in entries(). @throws BadFrame if it cannot be used
  RecordedFrame read(std::size_t index);

 private:
  std::string poses_file() const { return tum_layout_ ? "groundtruth.txt" : "poses.txt"; }
  void list_numbered_images();
  void list_tum_images();
  void choose_tum_camera();
  cv::Mat read_depth(const Entry& entry) const;
  cv::Mat read_color(const Entry& entry, const cv::Size& size);

  std::filesystem::path folder_;
  std::vector<Entry> entries_;
  Intrinsics intrinsics_;
  bool tum_layout_ = false;
  Selection selection_;
  std::size_t done_ = 0;  ///< frames of the selection that are read
  std::vector<std::string> skipped_;
  std::vector<std::string> notes_;
};

}  // namespace frontier_surfels::replay
