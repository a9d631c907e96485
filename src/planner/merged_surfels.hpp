/// Surfels merged by cells, for views that see them from afar: kernels/planner/merged_surfels.cl.
#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "map/surfel_map.hpp"
#include "opencl/commands.hpp"

namespace frontier_surfels {

/// What has been merged is kept as long as its block does not change: between two questions most of the map stays as it is.
class MergedSurfels {
 public:
  explicit MergedSurfels(Commands& commands);

  /// Merges the surfels of blocks of the map.
  /// @param pages   of each block
  /// @param levels  of each block: those that are needed, bit 0 for level 1
  /// @param now     number of the map: pages that a failed frame has changed have a later one, which the next frame will use again
  void merge(const char* stage, const SurfelMap& map, const std::vector<const BlockIndex::Pages*>& pages,
             const std::vector<cl_uint>& levels, std::uint64_t now);

  /// Keeps nothing. To be called if the device has failed before the answer came.
  void forget();

  /// @name Results, for kernels.
  /// @{
  const cl::Buffer& pages() const { return pages_(); }
  const cl::Buffer& page_begin() const { return page_begin_(); }
  const cl::Buffer& places() const { return places_(); }
  const cl::Buffer& surfels() const { return merged_(); }
  const cl::Buffer& counts() const { return counts_(); }
  /// @}

 private:
  /// What is merged of a block.
  struct Kept {
    BlockIndex::Pages pages;    ///< that the block had
    std::uint32_t changed = 0;  ///< frame that had changed them last, or kNeverAgain
    cl_uint levels = 0;         ///< bit 0 for level 1
    cl_uint place = 0;
  };

  static constexpr std::uint32_t kNeverAgain = ~std::uint32_t{0};

  Kept& keep(const BlockIndex::Pages& pages, std::uint32_t changed, std::uint64_t now);
  std::vector<cl_uint> plan(const SurfelMap& map, const std::vector<const BlockIndex::Pages*>& pages, const std::vector<cl_uint>& levels,
                            std::uint64_t now);
  void merge_listed(const char* stage, const SurfelMap& map, std::size_t most_pages, std::vector<cl_uint> list);

  Commands& commands_;
  std::unordered_map<std::uint32_t, Kept> kept_;  ///< by the block's first page
  cl_uint end_ = 0;                               ///< of the places
  SentArray<cl_uint> pages_, page_begin_, places_, list_;
  DeviceArray<cl_uint> sums_, table_, counts_;
  DeviceArray<cl_uint4> merged_;
};

}  // namespace frontier_surfels
