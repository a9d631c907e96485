/// Services about the whole map: ~reset, ~pause, ~save_map, ~load_map, ~get_surfels.
#pragma once

#include <frontier_surfels/GetSurfels.h>
#include <frontier_surfels/MapFile.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <functional>
#include <vector>

#include "frontier_surfels/mapper.hpp"
#include "ros/input/parameters.hpp"
#include "ros/services/service_thread.hpp"
#include "ros/worker.hpp"

namespace frontier_surfels {

class MapServices {
 public:
  /// What else happens with a request.
  struct Hooks {
    std::function<void()> show_other_map;  ///< on the mapping thread: reset or load has replaced the map
    std::function<void()> reset_cameras;   ///< on the mapping thread: images that wait are of no use to an empty map
    std::function<void(bool paused)> pause;
  };

  /// @param mapper  only used by jobs of the worker. All references outlive the thread
  MapServices(ServiceThread& thread, const NodeConfig& config, Mapper& mapper, Worker& worker, Hooks hooks);

 private:
  bool reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool pause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  bool save_map(MapFile::Request& request, MapFile::Response& response);
  bool load_map(MapFile::Request& request, MapFile::Response& response);
  std::uint32_t take_part(std::vector<Surfel>& surfels, std::uint32_t first_id, std::size_t most) const;
  bool get_surfels(GetSurfels::Request& request, GetSurfels::Response& response);

  const NodeConfig& config_;
  Mapper& mapper_;
  Worker& worker_;
  const Hooks hooks_;
};

}  // namespace frontier_surfels
