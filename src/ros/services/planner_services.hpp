/// Services that planners ask: ~get_states, ~cast_rays, ~evaluate_views, ~get_state_grid, ~save_octomap.
#pragma once

#include <frontier_surfels/CastRays.h>
#include <frontier_surfels/EvaluateViews.h>
#include <frontier_surfels/GetStateGrid.h>
#include <frontier_surfels/GetStates.h>
#include <frontier_surfels/MapFile.h>

#include <functional>

#include "frontier_surfels/mapper.hpp"
#include "ros/input/parameters.hpp"
#include "ros/output/planner_publisher.hpp"
#include "ros/services/service_thread.hpp"
#include "ros/worker.hpp"

namespace frontier_surfels {

/// Each request is answered between two frames, and so by one map. What is wrong with a request is thrown, and becomes the error that its
/// caller gets, since the responses have no field for one.
class PlannerServices {
 public:
  /// @param mapper   only used by jobs of the worker. All references outlive the thread
  /// @param refresh  called by such jobs: brings the publisher's grid up to date
  PlannerServices(ServiceThread& thread, const NodeConfig& config, Mapper& mapper, Worker& worker, PlannerPublisher& publisher,
                  std::function<void()> refresh);

 private:
  bool get_states(GetStates::Request& request, GetStates::Response& response);
  bool cast_rays(CastRays::Request& request, CastRays::Response& response);
  bool evaluate_views(EvaluateViews::Request& request, EvaluateViews::Response& response);
  bool get_state_grid(GetStateGrid::Request&, GetStateGrid::Response& response);
  bool save_octomap(MapFile::Request& request, MapFile::Response& response);

  const NodeConfig& config_;
  Mapper& mapper_;
  Worker& worker_;
  PlannerPublisher& publisher_;
  const std::function<void()> refresh_;
};

}  // namespace frontier_surfels
