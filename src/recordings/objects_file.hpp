/// The file objects.json of a truth: which things stand where, and in which frames.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "frontier_surfels/scoring/scene_object.hpp"

namespace frontier_surfels::replay {

/// Poses are [tx, ty, tz, qx, qy, qz, qw]: of the centre of a part in the frame of its object, and of the object in the world, in the
/// frames `first` to `last`, counted from 0:
///   {"objects": [{"name": "box",
///                 "parts": [{"size": [0.4, 0.3, 0.2], "pose": [0, 0, 0.1, 0, 0, 0, 1]}],
///                 "stands": [{"first": 10, "last": 99, "pose": [1, 2, 0, 0, 0, 0, 1]}]}]}
/// @throws Error  the file cannot be read, or what is wrong in it
std::vector<scoring::SceneObject> read_objects(const std::filesystem::path& path);

/// The content of such a file.
std::string objects_text(const std::vector<scoring::SceneObject>& objects);

}  // namespace frontier_surfels::replay
