/// What an ideal sensor would have seen in the frames of a recording: a folder with the same frames.
#pragma once

#include <string>
#include <vector>

#include "frontier_surfels/scoring/scene_object.hpp"
#include "recordings/folder_source.hpp"

namespace frontier_surfels::replay {

/// A folder as FolderSource reads it, optionally with an objects.json (objects_file.hpp). Frame n of the recording is frame n of the
/// folder. Poses may differ a little: the folder has the true ones.
class TruthFolder {
 public:
  /// Checks, if the recording is a folder as well, that both have the same frames. @throws Error that says what is wrong
  TruthFolder(const std::string& folder, const std::string& recording);

  const std::string& path() const { return path_; }
  const std::vector<scoring::SceneObject>& objects() const { return objects_; }

  /// The ideal frame for a recorded one.
  /// @param index  of the recorded frame. @throws Error if there is no such frame, or it cannot be used
  RecordedFrame frame_for(std::size_t index, const DepthFrame& recorded);

 private:
  [[noreturn]] void refuse(const std::string& fault) const;
  void check_entries(const FolderSource& recording) const;
  void check_stamp_and_pose(std::size_t index, double stamp, const Eigen::Isometry3d& T_world_camera) const;
  void check_camera(const Intrinsics& camera) const;

  std::string path_;
  FolderSource source_;
  std::vector<scoring::SceneObject> objects_;
};

}  // namespace frontier_surfels::replay
