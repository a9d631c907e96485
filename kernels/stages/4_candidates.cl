// Candidates: where new surfels may be created - paper 3.5, eq. (13): voxels that are not observed, beside observed ones. 5_visit takes
// those off that have a surfel. Whether others are known is asked of the kept views first, and of the surfels where those leave it open.

// One work item handles the words of LANES columns: work item (j words_k + w) chunks + chunk has columns LANES chunk ... of row j, where
// the grid's rows and columns are filled up to whole tiles of VIEW_TILE.
//   in  observed: bit field C~, with SPARE_WORDS behind it
//   out candidates: bit field by tiles, of all their columns; voxels with a surfel that stays are among them
//       counts[COUNTS]: 0, for what 5_visit counts next and what decide_to_go_on decides
__kernel void find_candidates(const Grid g, __global const ulong* observed, __global ulong* candidates, __global uint* counts) {
  if (get_global_id(0) < COUNTS) counts[get_global_id(0)] = 0;
  const int chunks = chunks_of(VIEW_TILE * grid_tiles(g.size_i)), i = LANES * (get_global_id(0) % chunks),
            w = get_global_id(0) / chunks % g.words_k, j = get_global_id(0) / chunks / g.words_k;
  if (j >= VIEW_TILE * grid_tiles(g.size_j)) return;
  ulongv found = 0;
  if (j < g.size_j) {
    __global const ulong* own = observed + word_index(&g, i, j, w);
    const ulongv here = vloadv(0, own);
    const intv columns = i + lane_numbers(), exist = MARK(columns < g.size_i), has_next = MARK(columns + 1 < g.size_i);
    ulongv beside = here << 1 | here >> 1 | (vloadv(0, own + 1) & as_ulongv(convert_longv(has_next)));
    beside |= i > 0 ? vloadv(0, own - 1) : from_lane_before(here);
    if (w > 0) beside |= vloadv(0, own - g.size_i) >> 63;
    if (w + 1 < g.words_k) beside |= vloadv(0, own + g.size_i) << 63;
    if (j > 0) beside |= vloadv(0, own - g.words_k * g.size_i);
    if (j + 1 < g.size_j) beside |= vloadv(0, own + g.words_k * g.size_i);
    found = beside & ~here & valid_layers(&g, w) & as_ulongv(convert_longv(exist));
  }
  store_runs_of_8(found, candidates + tile_word_index(&g, i, j, w), TILE_COLUMNS, i + VIEW_TILE < g.size_i);
}
