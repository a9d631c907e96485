// Thin gaps: our addition to the paper. Frontier on a sheet of unknown that is thinner than min_gap and known on both sides bounds nothing
// worth a look, so it is left out. Surfaces of thin bodies stay.

// The kept views that may know something near LANES candidates: those of the tiles that the candidates are in.
typedef struct {
  __global const View* views;
  __global const ushort* tile_views;
  int view_groups;
  int tiles[LANES], tile_count;
} ViewsAround;

INLINE void find_views_around(const Grid* g, __global const View* views, __global const ushort* tile_views, int view_groups, Voxels v,
                              ViewsAround* around) {
  around->views = views;
  around->tile_views = tile_views;
  around->view_groups = view_groups;
  around->tile_count = 0;
  const int tiles_i = grid_tiles(g->size_i), tiles_k = WORD_TILES * g->words_k;
  int tiles[LANES];
  vstorev((v.j / VIEW_TILE * tiles_k + v.k / VIEW_TILE_K) * tiles_i + v.i / VIEW_TILE, 0, tiles);
  for (int n = 0; n < LANES; ++n) {
    bool is_new = true;
    for (int m = 0; m < around->tile_count; ++m) is_new = is_new && around->tiles[m] != tiles[n];
    if (is_new) around->tiles[around->tile_count++] = tiles[n];
  }
}

// Which of LANES points near the candidates does a kept view know?
//   p: camera frame;  asked: marks of the points in question
intv any_view_knows(const ViewsAround* around, __global const ushort* depths, Points p, intv asked) {
  intv open = asked;
  for (int group = 0; group < around->view_groups; ++group) {
    uint left = 0;
    for (int n = 0; n < around->tile_count; ++n) left |= around->tile_views[around->tiles[n] * around->view_groups + group];
    for (; left != 0; left &= left - 1) {
      const View view = around->views[group * VIEW_GROUP + lowest_lane(left)];
      open &= ~knows(&view, depths, p, asked);
      if (!any_lane(open)) return asked;
    }
  }
  return asked & ~open;
}

// One work item handles a chunk of LANES listed candidates.
//   in  depth, column_end: of 1_observed_space;  views: the kept ones;  tile_views: of settle_candidates;  depths: images of views, this
//       frame's among them;  slots, tables, bricks: of points that were taken back;  voxels[length[0]], directions: of find_directions
//   i/o candidates: bit field by tiles, as 32-bit halves: those with known space again `min_gap` behind them are cleared
__kernel void close_gaps(const Frame f, __global const View* views, __global const ushort* tile_views, const int view_groups,
                         __global const ushort* depths, __global const float* layer_depth, __global const float* depth,
                         __global const int* column_end, __global const int* slots, __global const int* tables, __global const int* bricks,
                         __global const int* voxels, __global const uint* length, __global const float* directions,
                         __global uint* candidates) {
  const int chunk = get_global_id(0), count = (int)length[0];
  if (chunk * LANES >= count) return;
  intv exist;
  const intv numbers = load_chunk(voxels, count, chunk, &exist);
  const Voxels v = voxels_of(&f.grid, numbers);
  const Points center = voxel_centers(&f.grid, layer_depth, v), direction = load_directions(directions, chunk);
  intv pixel, open = exist & MARK(lengths(direction) >= f.limits.normal_min);
  open &= ~at_surface(&f.grid, depth, column_end, f.limits.surface_depth, v, center.z, open, &pixel);
  const intv asked = open;
  if (!any_lane(open)) return;
  const Points behind = add_scaled(center, -f.limits.min_gap, normalized(direction));
  open &= ~own_view_knows(&f.own_view, depths, behind, open);
  ViewsAround around;
  find_views_around(&f.grid, views, tile_views, view_groups, v, &around);
  const SeenPoints taken = {slots, tables, bricks};
  intv left_out = 0;  // what views know there does not count
  if (f.has_taken) left_out = seen_before(&f, &taken, center, open) | seen_before(&f, &taken, behind, open);
  open &= ~any_view_knows(&around, depths, behind, open & ~left_out);
  int closed[LANES];
  vstorev(numbers, 0, closed);
  for (uint left = lane_bits(asked & ~open); left != 0; left &= left - 1) {
    const int number = closed[lowest_lane(left)];
    atomic_and(&candidates[number / 32], ~(1u << number % 32));
  }
}
