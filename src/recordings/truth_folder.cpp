#include "recordings/truth_folder.hpp"

#include <cmath>
#include <optional>

#include "frontier_surfels/number_text.hpp"
#include "recordings/objects_file.hpp"

namespace frontier_surfels::replay {
namespace fs = std::filesystem;
namespace {

constexpr double kStampTolerance = 1e-3;   // [s]
constexpr double kFocalTolerance = 1e-3;   // relative
constexpr double kCentreTolerance = 0.5;   // [pixel]
constexpr double kLargestShift = 0.5;      // [m] between a recorded and the true pose
constexpr double kLargestTurn = M_PI / 6;  // [rad]

FolderSource open_folder(const std::string& folder) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) throw Error("--truth: there is no folder '" + folder + "'.");
  return FolderSource(folder, {});
}

/// Empty if the numbers are not a pose.
std::optional<Eigen::Isometry3d> pose_of(const std::vector<double>& numbers) {
  try {
    return to_pose(numbers);
  } catch (const BadFrame&) {
    return std::nullopt;
  }
}

std::string frame_name(std::size_t index) { return "frame " + std::to_string(index); }

}  // namespace

TruthFolder::TruthFolder(const std::string& folder, const std::string& recording) : path_(folder), source_(open_folder(folder)) {
  std::error_code ignored;
  if (fs::exists(fs::path(folder) / "objects.json", ignored)) objects_ = read_objects(fs::path(folder) / "objects.json");
  if (fs::is_directory(recording, ignored)) check_entries(FolderSource(recording, {}));
}

void TruthFolder::refuse(const std::string& fault) const {
  throw Error("--truth: '" + path_ + "' must have the same frames as the recording, but " + fault + ".");
}

void TruthFolder::check_entries(const FolderSource& recording) const {
  check_camera(recording.intrinsics());
  const auto &recorded = recording.entries(), &ideal = source_.entries();
  if (recorded.size() != ideal.size())
    refuse("it has " + std::to_string(ideal.size()) + " frames instead of " + std::to_string(recorded.size()));
  for (std::size_t i = 0; i < recorded.size(); ++i) {
    if (recorded[i].depth.stem() != ideal[i].depth.stem())
      refuse(frame_name(i) + " is " + ideal[i].depth.filename().string() + " instead of " + recorded[i].depth.filename().string());
    const auto pose = pose_of(recorded[i].pose);
    if (pose) check_stamp_and_pose(i, recorded[i].stamp, *pose);  // a frame without a pose is skipped
  }
}

void TruthFolder::check_camera(const Intrinsics& camera) const {
  const Intrinsics& own = source_.intrinsics();
  const auto text = [](const Intrinsics& c) {
    return std::to_string(c.width) + "x" + std::to_string(c.height) + " pixels with f = " + fixed_text(c.fx, 1) + ", " +
           fixed_text(c.fy, 1) + " and the centre " + fixed_text(c.cx, 1) + ", " + fixed_text(c.cy, 1);
  };
  const auto close = [](double a, double b, double tolerance) { return std::abs(a - b) <= tolerance; };
  const bool same = own.width == camera.width && own.height == camera.height && close(own.fx, camera.fx, kFocalTolerance * camera.fx) &&
                    close(own.fy, camera.fy, kFocalTolerance * camera.fy) && close(own.cx, camera.cx, kCentreTolerance) &&
                    close(own.cy, camera.cy, kCentreTolerance);
  if (!same) refuse("its camera has " + text(own) + ", the recording's " + text(camera));
}

void TruthFolder::check_stamp_and_pose(std::size_t index, double stamp, const Eigen::Isometry3d& T_world_camera) const {
  const FolderSource::Entry& entry = source_.entries()[index];
  if (!(std::abs(entry.stamp - stamp) <= kStampTolerance))
    refuse(frame_name(index) + " has the stamp " + fixed_text(entry.stamp, 6) + " instead of " + fixed_text(stamp, 6));
  const auto own = pose_of(entry.pose);
  if (!own) refuse(frame_name(index) + " has no pose");
  const double shift = (own->translation() - T_world_camera.translation()).norm();
  const double turn = Eigen::AngleAxisd(own->linear().transpose() * T_world_camera.linear()).angle();
  if (shift > kLargestShift || turn > kLargestTurn)
    refuse(frame_name(index) + " has a pose " + fixed_text(shift, 2) + " m and " + fixed_text(turn * 180 / M_PI, 0) +
           " degrees away from the recorded one");
}

RecordedFrame TruthFolder::frame_for(std::size_t index, const DepthFrame& recorded) {
  if (index >= source_.entries().size())
    refuse("it ends after " + std::to_string(source_.entries().size()) + " frames, before " + frame_name(index) + " of the recording");
  check_camera(recorded.intrinsics);
  check_stamp_and_pose(index, recorded.stamp, recorded.T_world_camera);
  try {
    return source_.read(index);
  } catch (const BadFrame& fault) {
    throw Error("--truth: " + source_.entries()[index].depth.string() + " cannot be used: " + fault.what() + ".");
  }
}

}  // namespace frontier_surfels::replay
