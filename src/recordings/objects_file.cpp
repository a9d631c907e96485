#include "recordings/objects_file.hpp"

#include <array>
#include <fstream>
#include <nlohmann/json.hpp>

#include "frontier_surfels/types.hpp"
#include "recordings/folder_source.hpp"

namespace frontier_surfels::replay {

using nlohmann::ordered_json;
using scoring::OrientedBox;
using scoring::SceneObject;
using scoring::Stand;

namespace {

/// A fault of one object; the caller adds the name of the file.
void refuse_if(bool wrong, const std::string& object, const char* fault) {
  if (wrong) throw Error("the object '" + object + "' " + fault);
}

Eigen::Isometry3d pose_of(const ordered_json& json, const std::string& object) {
  const auto numbers = json.at("pose").get<std::array<double, 7>>();
  try {
    return to_pose({numbers.begin(), numbers.end()});
  } catch (const BadFrame&) {
    throw Error("the object '" + object +
                "' has a pose that is none: it must be [tx, ty, tz, qx, qy, qz, qw] with a quaternion of length 1");
  }
}

ordered_json pose_json(const Eigen::Isometry3d& pose) {
  const Eigen::Vector3d p = pose.translation();
  const Eigen::Quaterniond q(pose.linear());
  return {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()};
}

SceneObject object_of(const ordered_json& json) {
  SceneObject object;
  object.name = json.at("name").get<std::string>();
  for (const ordered_json& part : json.at("parts")) {
    const auto size = part.at("size").get<std::array<double, 3>>();
    OrientedBox box{pose_of(part, object.name), Eigen::Vector3d(size[0], size[1], size[2]) / 2};
    refuse_if(!(box.half_size.allFinite() && (box.half_size.array() > 0).all()), object.name, "has a part whose size is not above 0");
    object.parts.push_back(box);
  }
  refuse_if(object.parts.empty(), object.name, "has no parts");
  for (const ordered_json& stand : json.at("stands")) {
    const Stand read{stand.at("first").get<std::size_t>(), stand.at("last").get<std::size_t>(), pose_of(stand, object.name)};
    const bool is_next = object.stands.empty() || read.first > object.stands.back().last;
    refuse_if(!is_next || read.last < read.first, object.name,
              "has stands that are not in the order of their frames: each must have first <= last, and begin after the one before it");
    object.stands.push_back(read);
  }
  return object;
}

}  // namespace

std::vector<SceneObject> read_objects(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw Error(path.string() + " cannot be read.");
  std::vector<SceneObject> objects;
  try {
    const ordered_json json = ordered_json::parse(file);
    for (const ordered_json& object : json.at("objects")) objects.push_back(object_of(object));
  } catch (const ordered_json::exception& fault) {
    throw Error(path.string() + " is not as it must be (" + fault.what() + "); make_synthetic --scene box_appears writes an example.");
  } catch (const Error& fault) {
    throw Error(path.string() + ": " + fault.what() + ".");
  }
  return objects;
}

/// A line for each part and stand: a walk has hundreds.
std::string objects_text(const std::vector<SceneObject>& objects) {
  const auto lines = [](const ordered_json& list) {
    std::string text;
    for (std::size_t i = 0; i < list.size(); ++i) text += (i > 0 ? ",\n      " : "\n      ") + list[i].dump();
    return "[" + text + "]";
  };
  std::string text;
  for (const SceneObject& object : objects) {
    ordered_json parts = ordered_json::array(), stands = ordered_json::array();
    for (const OrientedBox& box : object.parts) {
      const Eigen::Vector3d size = 2 * box.half_size;
      parts.push_back({{"size", {size.x(), size.y(), size.z()}}, {"pose", pose_json(box.T_frame_box)}});
    }
    for (const Stand& stand : object.stands)
      stands.push_back({{"first", stand.first}, {"last", stand.last}, {"pose", pose_json(stand.T_world_object)}});
    text += std::string(text.empty() ? "" : ",") + "\n  {\"name\": " + ordered_json(object.name).dump() +
            ",\n    \"parts\": " + lines(parts) + ",\n    \"stands\": " + lines(stands) + "}";
  }
  return "{\"objects\": [" + text + "]}\n";
}

}  // namespace frontier_surfels::replay
