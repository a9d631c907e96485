#include "ros/services/map_services.hpp"

#include <algorithm>
#include <filesystem>
#include <future>
#include <string>
#include <utility>

#include "frontier_surfels/map_file.hpp"
#include "frontier_surfels/paths.hpp"
#include "ros/input/conversions.hpp"
#include "ros/output/surfel_messages.hpp"

namespace frontier_surfels {

MapServices::MapServices(ServiceThread& thread, const NodeConfig& config, Mapper& mapper, Worker& worker, Hooks hooks)
    : config_(config), mapper_(mapper), worker_(worker), hooks_(std::move(hooks)) {
  thread.serve<std_srvs::Trigger>("reset", &MapServices::reset, this);
  thread.serve<std_srvs::SetBool>("pause", &MapServices::pause, this);
  thread.serve<MapFile>("save_map", &MapServices::save_map, this);
  thread.serve<MapFile>("load_map", &MapServices::load_map, this);
  thread.serve<GetSurfels>("get_surfels", &MapServices::get_surfels, this);
}

bool MapServices::reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  return answer(response, [&] {
    worker_.run_job([&] {
      mapper_.reset();
      hooks_.show_other_map();
      hooks_.reset_cameras();
    });
    return std::string("The map is empty.");
  });
}

bool MapServices::pause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
  hooks_.pause(request.data);
  response.success = true;
  response.message = request.data ? "Mapping is paused." : "Mapping continues.";
  return true;
}

bool MapServices::save_map(MapFile::Request& request, MapFile::Response& response) {
  return answer(response, [&] {
    if (request.path.empty()) throw FileError("No path was given: give the path of the file to be written, which ends in .ply or .pcd.");
    const SavedMap map = worker_.run_job([&] { return mapper_.saved_map(); });
    const std::string path = absolute_path(request.path);
    std::error_code ignored;  // a name may be too long to be asked for
    if (map.surfels.empty() && std::filesystem::is_regular_file(path, ignored))
      throw FileError("The map is empty, and was not written over the existing file " + path +
                      ": delete the file, or choose another path.");
    write_map(path, map);  // on this thread, so that mapping goes on
    const std::string done = std::to_string(map.surfels.size()) + " surfels were written to " + path + ".";
    ROS_INFO("%s", done.c_str());
    return done;
  });
}

bool MapServices::load_map(MapFile::Request& request, MapFile::Response& response) {
  return answer(response, [&] {
    const std::string path = absolute_path(request.path);
    const std::size_t surfels = worker_.run_job([&] {
      mapper_.load(path);
      hooks_.show_other_map();
      return mapper_.size();
    });
    const std::string done = std::to_string(surfels) + " surfels were read from " + path + ".";
    ROS_INFO("%s", done.c_str());
    return done;
  });
}

/// Takes the surfels from first_id on, and of these at most `most` or as many as go into a message. @return next_id of the answer
/// @throws Error if `most` is 0 and they do not go into a message
std::uint32_t MapServices::take_part(std::vector<Surfel>& surfels, std::uint32_t first_id, std::size_t most) const {
  const auto before = [](const Surfel& surfel, std::uint32_t id) { return surfel.id < id; };
  surfels.erase(surfels.begin(), std::lower_bound(surfels.begin(), surfels.end(), first_id, before));
  const std::size_t limit = static_cast<std::size_t>(config_.message_limit);
  if (most == 0 || surfels.size() <= std::min(most, limit)) return 0;  // to_cloud() refuses too many
  const std::uint32_t next_id = surfels[std::min(most, limit)].id;
  surfels.resize(std::min(most, limit));
  return next_id;
}

/// The response has no field for an error. What is thrown becomes the error that the caller of the service gets.
bool MapServices::get_surfels(GetSurfels::Request& request, GetSurfels::Response& response) {
  const Eigen::AlignedBox3f box(messages::to_vector(request.box_min), messages::to_vector(request.box_max));
  try {
    auto surfels = worker_.run_job([&] {
      response.sequence = mapper_.sequence();
      return box.min() == box.max() ? mapper_.surfels() : mapper_.surfels(box);
    });
    response.next_id = take_part(surfels, request.first_id, request.most);
    response.surfels = messages::to_cloud(surfels, config_.confident_label(), static_cast<std::size_t>(config_.message_limit));
  } catch (const std::future_error&) {
    return false;  // the mapper is shutting down
  }
  response.surfels.header.frame_id = config_.world_frame;
  response.surfels.header.stamp = ros::Time::now();
  return true;
}

}  // namespace frontier_surfels
