#include "opencl/work_shape.hpp"

#include <algorithm>

#include "common/shared.h"

namespace frontier_surfels {

WorkShape shape_for(const Device& device) {
  WorkShape shape;
  shape.is_near = device.is_cpu && device.lanes != 1;
  shape.many_items = device.lanes == 1;
  shape.heavy_group = device.is_pocl_cpu ? 1 : 64;
  shape.evidence_team = shape.many_items && shape.heavy_group > 1 ? 16 : 1;
  shape.view_items = shape.heavy_group == 1 ? 64 : 1 << 14;
  if (shape.many_items) {
    shape.scan_alone = 16;
    shape.scan_by_group = 1 << 14;
    shape.scan_group = std::min<std::size_t>(MOST_SCAN_ITEMS, device.device.getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>());
    shape.list_chunk = 4;
    shape.sort_chunks = 512;
    shape.sort_group = 64;
  } else if (device.is_pocl_cpu) {
    shape.scan_alone = 1 << 16;
    shape.list_alone = 1 << 18;
    shape.sort_alone = 1 << 14;
  }
  return shape;
}

}  // namespace frontier_surfels
