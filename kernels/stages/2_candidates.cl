// Where new surfels may be created - paper 3.5, eq. (13): unobserved voxels beside observed ones. 3_visit takes those off that have a
// surfel. Whether they are known is asked of the recent views first, and of the surfels only where those leave it open.

// Candidates by their numbers, 64 word + bit.
INLINE Voxels voxels_of(const Grid* g, int16 numbers) {
  const int16 tiles = numbers / (64 * TILE_COLUMNS), columns = numbers / 64 & (TILE_COLUMNS - 1);
  const int16 rows = quotients(tiles, grid_tiles(g->size_i)), tiles_j = quotients(rows, g->words_k);
  Voxels v;
  v.i = VIEW_TILE * (tiles - rows * grid_tiles(g->size_i)) + columns % VIEW_TILE;
  v.j = VIEW_TILE * tiles_j + columns / VIEW_TILE;
  v.k = 64 * (rows - tiles_j * g->words_k) + (numbers & 63);
  return v;
}

// F^-1 of voxels' centres.
INLINE Points voxel_centers(const Grid* g, __global const float* layer_depth, Voxels v) {
  Points p;
  p.z = gather(layer_depth, clamp(v.k, 0, g->size_k - 1));
  const float16 width = convert_float16(v.k) < g->k_min ? g->z_min : p.z;
  p.x = (convert_float16(v.i) - g->center_i) * width / g->fx;
  p.y = (convert_float16(v.j) - g->center_j) * width / g->fy;
  return p;
}

// One work item words of LANES columns; of all rows of the tiles.
//   in  observed: C~, with LANES words to spare;   out candidates: also those that surviving surfels take; 3_visit knows them
//       counts: 0, for what 3_visit counts next
__kernel void find_candidates(const Grid g, __global const ulong* observed, __global ulong* candidates, __global uint* counts) {
  if (get_global_id(0) < COUNTS) counts[get_global_id(0)] = 0;
  const int chunks = grid_chunks(g.size_i), i = LANES * (get_global_id(0) % chunks), w = get_global_id(0) / chunks % g.words_k,
            j = get_global_id(0) / chunks / g.words_k;
  if (j >= VIEW_TILE * grid_tiles(g.size_j)) return;
  ulong16 found = 0;
  if (j < g.size_j) {
    __global const ulong* own = observed + word_index(&g, i, j, w);
    const ulong16 here = vload16(0, own);
    const int16 columns = i + lane_numbers();
    const ulong16 left = i > 0 ? vload16(0, own - 1) : (ulong16)(0, here.s0123, here.s4567, here.s89ab, here.scd, here.se);
    ulong16 beside = here << 1 | here >> 1 | left | (vload16(0, own + 1) & as_ulong16(convert_long16(columns + 1 < g.size_i)));
    if (w > 0) beside |= vload16(0, own - g.size_i) >> 63;
    if (w + 1 < g.words_k) beside |= vload16(0, own + g.size_i) << 63;
    if (j > 0) beside |= vload16(0, own - g.words_k * g.size_i);
    if (j + 1 < g.size_j) beside |= vload16(0, own + g.words_k * g.size_i);
    found = beside & ~here & valid_layers(&g, w) & as_ulong16(convert_long16(columns < g.size_i));
  }
  __global ulong* row = candidates + tile_word_index(&g, i, j, w);
  vstore8(found.lo, 0, row);
  if (i + VIEW_TILE < g.size_i) vstore8(found.hi, 0, row + TILE_COLUMNS);
}
