// New surfel filter - paper 3.5: candidates that are known, or whose directions cancel, make no surfel.

// New surfel filter. One work item a chunk of LANES listed candidates: those that are known, or whose directions cancel, make no surfel.
//   in  voxels, directions: of find_directions;  candidates: those that close_gaps has left, as 32-bit halves;  known: K~, where it has
//       been computed
//   out kept[words]: a bit for each that makes one, as 16-bit quarters
__kernel void filter_candidates(const Grid g, const Limits limits, __global const int* voxels, const int count,
                                __global const float* directions, __global const int* candidates, const int has_known,
                                __global const int* known, __global ushort* kept) {
  const int chunk = get_global_id(0);
  if (chunk * LANES >= count) {
    if (chunk < 64 / LANES * ((count + 63) / 64)) kept[chunk] = 0;  // the rest of the last word
    return;
  }
  int16 exist;
  const int16 numbers = load_chunk(voxels, count, chunk, &exist), at = numbers / 32, bit = (int16)(1) << numbers % 32;
  const Points direction = {vload16(3 * chunk, directions), vload16(3 * chunk + 1, directions), vload16(3 * chunk + 2, directions)};
  int16 open = exist & ((gather_int(candidates, at) & bit) != 0) & (lengths(direction) >= limits.normal_min);
  if (has_known) open &= (gather_int(known, voxel_halves(&g, voxels_of(&g, numbers))) & bit) == 0;
  kept[chunk] = (ushort)lane_bits(open);
}
