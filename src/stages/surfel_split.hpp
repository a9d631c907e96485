/// Split of surfels that are too large for this view - paper 3.4; kernels/stages/6_split.cl.
#pragma once

#include "map/surfel_map.hpp"
#include "opencl/lists.hpp"
#include "stages/frame.hpp"
#include "stages/new_surfels.hpp"

namespace frontier_surfels {

class SurfelSplit {
 public:
  SurfelSplit(Commands& commands, Lists& lists);

  /// Replaces large surfels by smaller ones. Candidates and SurfelVisit must run again after that.
  /// @param large  SurfelVisit::large()
  /// @return number of surfels that the map has gained
  std::size_t split(const Frame& frame, const BitField& large, SurfelMap& map);

  const NewSurfels& children() const { return children_; }

 private:
  Commands& commands_;
  Lists& lists_;
  DeviceArray<cl_uint> parents_, offsets_;
  NewSurfels children_;
};

}  // namespace frontier_surfels
