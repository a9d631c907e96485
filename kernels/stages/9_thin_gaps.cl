// Thin gaps: our addition to the paper. Frontier on a sheet of unknown that is thinner than min_gap and known on both sides bounds nothing
// worth a look, so it is left out. Surfaces of thin bodies stay.

// What the work items of a group tell each other: does a kept view know the point? By turns, so that one may be written while others still
// read the last answers.
typedef struct {
  uchar known[2][HEAVY_GROUP];
} Answers;

// The kept views that may know something near LANES candidates: those of the tiles that the candidates are in.
typedef struct {
  __global const View* views;
  __global const ushort* tile_views;
  int view_groups;
  int tiles[LANES], tile_count;
  int team, turn;  // this work item is one of so many that have the candidate together
  __local Answers* told;
} ViewsAround;

INLINE void find_views_around(const Grid* g, __global const View* views, __global const ushort* tile_views, int view_groups, Voxels v,
                              int team, __local Answers* told, ViewsAround* around) {
  around->views = views;
  around->tile_views = tile_views;
  around->view_groups = view_groups;
  around->tile_count = 0;
  around->team = team;
  around->turn = 0;
  around->told = told;
  const int tiles_i = grid_tiles(g->size_i), tiles_k = WORD_TILES * g->words_k;
  int tiles[LANES];
  vstorev((v.j / VIEW_TILE * tiles_k + v.k / VIEW_TILE_K) * tiles_i + v.i / VIEW_TILE, 0, tiles);
  for (int n = 0; n < LANES; ++n) {
    bool is_new = true;
    for (int m = 0; m < around->tile_count; ++m) is_new = is_new && around->tiles[m] != tiles[n];
    if (is_new) around->tiles[around->tile_count++] = tiles[n];
  }
}

#if VIEW_TEAM == 1
// Which chunk of LANES of `count` candidates is a work item's? Returns whether there is one.
//   out writes: what comes of it is written by this work item
INLINE bool find_chunk(int count, int team, int* chunk, bool* writes) {
  *chunk = get_global_id(0);
  *writes = true;
  return *chunk * LANES < count;
}

// Must any_view_knows() be called at all?
INLINE bool must_ask(intv asked) { return any_lane(asked); }

// Which of LANES points near the candidates does a kept view know?
//   p: camera frame;  asked: marks of the points in question
intv any_view_knows(ViewsAround* around, __global const ushort* depths, Points p, intv asked) {
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
#else
// Where `team` work items have a candidate together, each asks its share of every group of views. All of a work-group must call these. A
// group returns only as a whole, if none of its teams has a candidate; teams beyond the last candidate repeat that one and write nothing.
INLINE bool find_chunk(int count, int team, int* chunk, bool* writes) {
  const int own = (int)get_global_id(0) / team;
  *chunk = max(min(own, count - 1), 0);
  *writes = own < count && get_global_id(0) % team == 0;
  return (int)(get_group_id(0) * get_local_size(0)) / team < count;
}

INLINE bool must_ask(intv asked) { return true; }

INLINE intv any_view_knows(ViewsAround* around, __global const ushort* depths, Points p, intv asked) {
  const int item = get_local_id(0), team = around->team, own = item % team;
  bool known = false;
  for (int n = own; asked && !known && n < around->view_groups * VIEW_GROUP; n += team) {
    if (((around->tile_views[around->tiles[0] * around->view_groups + n / VIEW_GROUP] >> n % VIEW_GROUP) & 1) == 0) continue;
    const View view = around->views[n];
    known = knows(&view, depths, p, asked);
  }
  if (team == 1) return known ? asked : 0;
  __local uchar* answers = around->told->known[around->turn];
  around->turn = 1 - around->turn;
  answers[item] = known;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int n = item - own; n < item - own + team; ++n) known = known || answers[n];
  return known ? asked : 0;
}
#endif

// One work item handles a chunk of LANES listed candidates, or `team` of them handle one.
//   in  depth, column_end: of 1_observed_space;  views: the kept ones;  tile_views: of settle_candidates;  depths: images of views, this
//       frame's among them;  slots, tables, bricks: of points that were taken back;  voxels[length[0]], directions: of find_directions
//   i/o candidates: bit field by tiles, as 32-bit halves: those with known space again `min_gap` behind them are cleared
__kernel void close_gaps(const Frame f, __global const View* views, __global const ushort* tile_views, const int view_groups,
                         __global const ushort* depths, __global const float* layer_depth, __global const float* depth,
                         __global const int* column_end, __global const int* slots, __global const int* tables, __global const int* bricks,
                         __global const int* voxels, __global const uint* length, __global const float* directions, const int team,
                         __global uint* candidates) {
  __local Answers told;
  const int count = (int)length[0];
  int chunk;
  bool writes;
  if (!find_chunk(count, team, &chunk, &writes)) return;
  intv exist;
  const intv numbers = load_chunk(voxels, count, chunk, &exist);
  const Voxels v = voxels_of(&f.grid, numbers);
  const Points center = voxel_centers(&f.grid, layer_depth, v), direction = load_directions(directions, chunk);
  intv pixel, open = exist & MARK(lengths(direction) >= f.limits.normal_min);
  open &= ~at_surface(&f.grid, depth, column_end, f.limits.surface_depth, v, center.z, open, &pixel);
  const intv asked = open;
  if (!must_ask(open)) return;
  const Points behind = add_scaled(center, -f.limits.min_gap, normalized(direction));
  open &= ~own_view_knows(&f.own_view, depths, behind, open);
  ViewsAround around;
  find_views_around(&f.grid, views, tile_views, view_groups, v, team, &told, &around);
  const SeenPoints taken = {slots, tables, bricks};
  intv left_out = 0;  // what views know there does not count
  if (f.has_taken) left_out = seen_before(&f, &taken, center, open) | seen_before(&f, &taken, behind, open);
  open &= ~any_view_knows(&around, depths, behind, open & ~left_out);
  if (!writes) return;
  int closed[LANES];
  vstorev(numbers, 0, closed);
  for (uint left = lane_bits(asked & ~open); left != 0; left &= left - 1) {
    const int number = closed[lowest_lane(left)];
    atomic_and(&candidates[number / 32], ~(1u << number % 32));
  }
}
