/// What views would see of the map, for planners: kernels/planner/view_values.cl.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/shared.h"
#include "frontier_surfels/planner/views.hpp"
#include "map/surfel_map.hpp"
#include "opencl/commands.hpp"
#include "planner/merged_surfels.hpp"

namespace frontier_surfels {

/// @throws Error  names the field of the question that makes no sense
void check_question(const ViewQuestion& question);

class ViewValues {
 public:
  explicit ViewValues(Commands& commands);

  /// Areas and pixels of each view; `state` and `clearance` are left as they are. The question must have been checked.
  /// @param now  number of the map
  std::vector<ViewValue> find(const ViewQuestion& question, const SurfelMap& map, std::uint64_t now);

 private:
  struct Plan;
  void find_some(const ViewQuestion& question, std::size_t begin, std::size_t end, const SurfelMap& map, std::uint64_t now,
                 std::vector<ViewValue>& values);
  std::size_t items_per_view(std::size_t views) const;

  Commands& commands_;
  MergedSurfels merged_;
  SentArray<AskedView> views_;
  SentArray<cl_uint> blocks_;
  DeviceArray<cl_uint> images_, tiles_;
  DeviceArray<cl_ulong> areas_;
  DeviceArray<cl_uint> counts_;
};

}  // namespace frontier_surfels
