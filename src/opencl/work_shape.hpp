/// How work is cut for a device: the one place that knows what a CPU likes and what a graphics processor likes.
#pragma once

#include <cstddef>

#include "opencl/device.hpp"

namespace frontier_surfels {

/// A CPU has few cores with wide vectors. PoCL runs the items of a group there one after the other on one core, takes minutes to compile
/// barriers within branches, and one more launch, or a group's barrier, costs it more than a small job done by one work item. (llvmpipe
/// ends loops after 65535 turns: there no item may do a job alone.) A graphics processor wants a hundred thousand work items, a work item
/// alone is a hundred times slower there than on a CPU, and each time the host waits the device runs dry. The results are the same, bit by
/// bit.
struct WorkShape {
  bool is_near = true;          ///< asking costs little: the host waits for the length of each list, so that no work item is idle, and
                                ///< looks for what it wants in the device's memory, which is its own; else the device also carries
                                ///< out what it has found before the host knows of it
  bool many_items = false;      ///< as a graphics processor likes it; chosen where a work item has one lane
  std::size_t heavy_group = 1;  ///< group size for kernels with much work per item
  std::size_t tile_group = 1;   ///< and for kernels whose work items have a job together, with many barriers
  std::size_t view_team = 1;  ///< at most so many work items have a pixel, a candidate or a surfel together, where it mostly waits for the
                              ///< images of kept views
  std::size_t scan_alone = 2048;      ///< so many values are summed up by one work item
  std::size_t scan_by_group = 0;      ///< so many by one work-group
  std::size_t scan_group = 1;         ///< work items of this group
  std::size_t list_alone = 0;         ///< the bits of so many words are listed by one work item
  std::size_t list_chunk = 16;        ///< otherwise each of many lists those of so many words
  std::size_t sort_alone = 0;         ///< if about so many new surfels are expected, one work item sorts them; 0: never
  std::size_t sort_group = 1;         ///< otherwise groups of so many work items sort them by block, each group a chunk
  std::size_t most_sort_chunks = 64;  ///< of so many
  std::size_t view_items = 64;        ///< work items that draw planners' views at a time

  /// Work items that have each of so many jobs together: fewer where the jobs alone keep the device busy. A power of two.
  std::size_t team(std::size_t jobs) const;

  /// Chunks in which new surfels are sorted by so many blocks. Each has a count for each block: fewer where it has many work items.
  std::size_t sort_chunks(std::size_t blocks) const;
};

WorkShape shape_for(const Device& device);

}  // namespace frontier_surfels
