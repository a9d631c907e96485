#include "opencl/work_shape.hpp"

#include <algorithm>

#include "common/shared.h"

namespace frontier_surfels {

std::size_t WorkShape::team(std::size_t jobs) const {
  constexpr std::size_t kBusy = 1 << 18;  // work items
  std::size_t team = view_team;
  while (team > 1 && jobs * team > kBusy) team /= 2;
  return team;
}

std::size_t WorkShape::sort_chunks(std::size_t blocks) const {
  constexpr std::size_t kCounts = 1 << 17, kLeast = 32;  // summing up the counts must not take longer than sorting
  return many_items ? std::clamp(kCounts / std::max<std::size_t>(blocks, 1), kLeast, most_sort_chunks) : most_sort_chunks;
}

WorkShape shape_for(const Device& device) {
  WorkShape shape;
  shape.is_near = device.is_cpu && device.lanes != 1;
  shape.many_items = device.lanes == 1;
  shape.heavy_group = device.is_pocl_cpu && !device.has_teams ? 1 : 64;
  shape.tile_group = device.is_pocl_cpu ? 1 : 64;
  shape.view_team = shape.many_items && device.has_teams ? 16 : 1;
  shape.view_items = shape.heavy_group == 1 ? 64 : 1 << 14;
  if (shape.many_items) {
    shape.scan_alone = 16;
    shape.scan_by_group = 1 << 14;
    shape.scan_group = std::min<std::size_t>(MOST_SCAN_ITEMS, device.device.getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>());
    shape.list_chunk = 4;
    shape.sort_group = SORT_GROUP;
    shape.most_sort_chunks = 512;
  } else if (device.is_pocl_cpu) {
    shape.scan_alone = 1 << 16;
    shape.list_alone = 1 << 18;
    shape.sort_alone = 1 << 14;
  }
  return shape;
}

}  // namespace frontier_surfels
