// New surfel filter - paper 3.5: candidates that are known, or whose directions cancel, make no surfel.

// One work item handles a chunk of LANES listed candidates; there are work items for all `words` of 64 that the list has room for.
//   in  voxels[length[0]], directions: of find_directions;  candidates: bit field by tiles, as 32-bit halves: those that close_gaps has
//   left
//       known: bit field K~, as 32-bit halves, if has_known
//   out kept[words]: a bit for each listed candidate that makes a surfel, as 32-bit halves; at width 1 zero before
__kernel void filter_candidates(const Frame f, __global const int* voxels, __global const uint* length, const int words,
                                __global const float* directions, __global const int* candidates, const int has_known,
                                __global const int* known, __global uint* kept) {
  const int chunk = get_global_id(0), count = (int)length[0];
  if (chunk >= words * (64 / LANES)) return;
  uint open_bits = 0;
  if (chunk * LANES < count) {
    intv exist;
    const intv numbers = load_chunk(voxels, count, chunk, &exist), bit = half_bits(numbers);
    intv open = exist & MARK((gather_int(candidates, numbers / 32) & bit) != 0) &
                MARK(lengths(load_directions(directions, chunk)) >= f.limits.normal_min);
    if (has_known) open &= MARK((gather_int(known, voxel_halves(&f.grid, voxels_of(&f.grid, numbers))) & bit) == 0);
    open_bits = lane_bits(open);
  }
  store_lane_bits(open_bits, chunk, kept);
}
