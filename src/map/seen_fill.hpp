/// What has been seen, from the surfels of a map alone: for maps that were saved without it.
#pragma once

#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Points near surfels are seen if they lie before them: by the sign of a sum over the surfels around, each weighted by its distance. All
/// other points get the label of the nearest of these, by a search that spreads from seen and unseen points at the same speed: a hole in
/// the cloud lets little through. The search ends, and leaves the rest unseen, when it has come so far from the surfels that it needs much
/// more memory than they do.
/// @param shift    logarithm of the number of bricks along a block's edge (SeenPoints)
/// @param threads  of the host; 0: as many as it has. The result does not depend on it
/// @throws std::bad_alloc, std::system_error  memory or threads are missing
SeenSpace fill_seen(const std::vector<Surfel>& surfels, double block_size, int shift, int threads);

/// A shift for fill_seen(): its points are as far apart as those of a mapper that makes surfels of these sizes.
int shift_for(const std::vector<Surfel>& surfels, double block_size);

/// What has been seen of a map; filled in where it was not saved with the map, or with blocks of another size.
/// @throws FileError  it is damaged. @throws Error  memory or threads are missing to fill it in
SeenSpace seen_of(const std::vector<Surfel>& surfels, const SeenSpace& saved, double block_size, int threads);

}  // namespace frontier_surfels
