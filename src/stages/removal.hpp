/// Removal - paper 3.4, eq. (12) - and labels - 3.5: what SurfelVisit has decided of the surfels that were there is done;
/// kernels/stages/14_removal.cl and 16_labels.cl.
#pragma once

#include "map/surfel_map.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {

/// Frees the slots of surfels. @param removed  SurfelVisit::removed(): `count` surfels
void remove_surfels(Commands& commands, const BitField& removed, std::size_t count, SurfelMap& map);

/// Labels and colours surfels at measured surfaces: of those that the frame has changed, which new ones and those that the visit has noted
/// are.
/// @param column_end  ObservedSpace::column_end()
void label_surfels(Commands& commands, const Frame& frame, const Camera& camera, const DeviceArray<cl_int>& column_end, SurfelMap& map);

}  // namespace frontier_surfels
