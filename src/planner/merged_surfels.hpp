/// Surfels merged by cells, for views that see them from afar: kernels/planner/merged_surfels.cl.
#pragma once

#include <cstddef>
#include <vector>

#include "map/surfel_map.hpp"
#include "opencl/commands.hpp"

namespace frontier_surfels {

class MergedSurfels {
 public:
  explicit MergedSurfels(Commands& commands);

  /// Merges the surfels of blocks of the map.
  /// @param pages   of each block
  /// @param levels  of each block: those that are needed, bit 0 for level 1
  void merge(const char* stage, const SurfelMap& map, const std::vector<const BlockIndex::Pages*>& pages,
             const std::vector<cl_uint>& levels);

  /// @name Results, for kernels.
  /// @{
  const cl::Buffer& pages() const { return pages_(); }
  const cl::Buffer& page_begin() const { return page_begin_(); }
  const cl::Buffer& surfels() const { return merged_(); }
  const cl::Buffer& counts() const { return counts_(); }
  /// @}

 private:
  Commands& commands_;
  SentArray<cl_uint> pages_, page_begin_, list_;
  DeviceArray<cl_uint> sums_, table_, counts_;
  DeviceArray<cl_uint4> merged_;
};

}  // namespace frontier_surfels
