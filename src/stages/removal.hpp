/// Removal - paper 3.4, eq. (12) - and labels - 3.5. Both carry out what SurfelVisit has decided;
/// kernels/stages/16_removal.cl and 18_labels.cl.
#pragma once

#include "map/surfel_map.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {

/// Frees the slots of removed surfels, after a backup of all that the rest of the frame may overwrite.
/// @param removed  SurfelVisit::removed(); @param count  surfels in it; 0 after SurfelMap::go_ahead(), as went_on() is told
void remove_surfels(Commands& commands, const BitField& removed, std::size_t count, SurfelMap& map);

/// Labels and colours surfels at measured surfaces. It looks at the surfels that are marked as changed: new ones, and those that
/// SurfelVisit has marked.
/// @param column_end  ObservedSpace::column_end()
void label_surfels(Commands& commands, const Frame& frame, const Camera& camera, const DeviceArray<cl_int>& column_end, SurfelMap& map);

}  // namespace frontier_surfels
