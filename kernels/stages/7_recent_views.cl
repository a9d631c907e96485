// Recent views: our addition to the paper. A candidate whose centre a kept view has seen is known: no surfel there.
//
// A tile's candidates are listed, and kept views asked of all of them, LANES at once; a candidate that one knows is settled. The views that
// know some of a few probes are asked first, as they settle most. What is left has a box, and the other views that may know something of
// that box are asked; 9_thin_gaps and 17_creation ask the same ones.
//
// Candidates at points that were taken back (3_taking_back) stay, whatever the views know: no view is asked for them, neither here nor
// later.

// The centre of a tile's entry, camera frame.
INLINE float3 entry_center(const Grid* g, int3 tile, __global const float* layer_depth, int entry) {
  const int column = entry / VIEW_TILE_K;
  const float z = layer_depth[tile.z * VIEW_TILE_K + entry % VIEW_TILE_K], depth = fmax(z, g->z_min);
  return (float3)(((float)(tile.x * VIEW_TILE + column % VIEW_TILE) - g->center_i) * depth / g->fx,
                  ((float)(tile.y * VIEW_TILE + column / VIEW_TILE) - g->center_j) * depth / g->fy, z);
}

// How many of PROBES candidates of a tile each of LANES views knows, but for rounding: it decides who is asked first, no more.
INLINE intv count_known(const Grid* g, int3 tile, __global const float* layer_depth, const ViewLanes* v, __global const ushort* depths,
                        float depth_step, __local const Tile* own) {
  intv counts = 0;
  for (int n = 0; n < PROBES; ++n) {
    const int entry = own->entries[(own->entry_count - 1) * n / (PROBES - 1)];
    const Points p = point_in_views(v, entry_center(g, tile, layer_depth, entry));
    const floatv scale = 1.0f / p.z, s = p.x * v->fx * scale + v->cx, t = p.y * v->fy * scale + v->cy;
    const intv seen = MARK(p.z > 0.0f) & MARK(s >= 0.0f) & MARK(t >= 0.0f) & MARK(s < v->width) & MARK(t < v->height);
    const uintv pixel = v->first_pixel + view_pixels(convert_uintv(v->width), convert_uintv(s), convert_uintv(t));
    counts -= seen & MARK(p.z < view_depths(depths, seen & as_intv(pixel), depth_step));
  }
  return counts;
}

// Lists those views of the first group that know some of the probes, those that know most first.
INLINE void list_likely_views(const Grid* g, int3 tile, __global const float* layer_depth, __global const View* views,
                              __global const float* view_lanes, __global const ushort* depths, __local Tile* own) {
  const int item = get_local_id(0), items = get_local_size(0);
  for (int known = item; known <= PROBES; known += items) own->known_by[known] = 0;
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
  for (int part = item; part < VIEW_PARTS; part += items) {
    const ViewLanes lanes = load_view_lanes(view_lanes, part);
    const intv counts = count_known(g, tile, layer_depth, &lanes, depths, views->depth_step, own);
    for (int known = 1; known <= PROBES; ++known) atomic_or(&own->known_by[known], lane_bits(MARK(counts == known)) << (part * LANES));
  }
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
  if (item != 0) return;
  uint count = 0;
  own->likely_views = 0;
  for (int known = PROBES; known > 0; --known) {
    for (uint left = own->known_by[known]; left != 0; left &= left - 1) own->views[count++] = (ushort)lowest_lane(left);
    own->likely_views |= own->known_by[known];
  }
  own->view_count = count;
}

// Finds the views that may know something of a box. At width 1 the work items share the views, else the groups of views.
//   out own_views[view_groups]: a bit for each of them
INLINE void find_near_views(__global const View* views, __global const float* view_lanes, int view_groups, __global const ushort* depths,
                            const Box* box, __local Tile* own, __global ushort* own_views) {
  const int item = get_local_id(0), items = get_local_size(0);
#if LANES == 1
  for (int n = item; n < view_groups; n += items) own->near[n] = 0;
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
  for (int n = item; n < view_groups * VIEW_GROUP; n += items) {
    __global const float* group = view_lanes + n / VIEW_GROUP * (VIEW_LANE_FIELDS * VIEW_GROUP);
    if (part_of_box(group, n % VIEW_GROUP, views + n, depths, box) != 0) atomic_or(&own->near[n / VIEW_GROUP], 1u << n % VIEW_GROUP);
  }
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
  for (int n = item; n < view_groups; n += items) own_views[n] = (ushort)own->near[n];
#else
  for (int n = item; n < view_groups; n += items)
    own_views[n] = views_of_box(view_lanes + n * VIEW_LANE_FIELDS * VIEW_GROUP, views + n * VIEW_GROUP, depths, box);
#endif
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
}

// Lists the others that may know something near a tile's candidates. Each work item has a share of their groups, and counts what those
// before it have.
INLINE void list_views(__local Tile* own, __global const ushort* tile_views, int view_groups) {
  const int item = get_local_id(0), items = get_local_size(0), first = view_groups * item / items, last = view_groups * (item + 1) / items;
  uint count = 0;
  for (int group = 0; group < last; ++group) {
    uint left = tile_views[group];
    if (group == 0) left &= ~own->likely_views;
    if (group < first) {
      count += popcount(left);
      continue;
    }
    for (; left != 0; left &= left - 1) own->views[count++] = (ushort)(group * VIEW_GROUP + lowest_lane(left));
  }
  if (item == items - 1) own->view_count = count;
}

// Makes a work item's chunks of the entries; returns how many there are.
INLINE uint open_chunks(const Grid* g, int3 tile, __global const float* layer_depth, __local Tile* own) {
  const int item = get_local_id(0), items = get_local_size(0), entries = own->entry_count;
  uint count = 0;
  for (int chunk = item; chunk * LANES < entries; chunk += items) {
    const intv exist = MARK(lane_numbers() < entries - chunk * LANES);
#if LANES != 1
    const intv candidate = exist ? convert_intv(vloadv(chunk, own->entries)) : 0, column = candidate / VIEW_TILE_K;
    const Voxels v = {tile.x * VIEW_TILE + column % VIEW_TILE, tile.y * VIEW_TILE + column / VIEW_TILE,
                      tile.z * VIEW_TILE_K + candidate % VIEW_TILE_K};
    const Points center = voxel_centers(g, layer_depth, v);
    vstorev(center.x, 0, own->centers[chunk][0]);
    vstorev(center.y, 0, own->centers[chunk][1]);
    vstorev(center.z, 0, own->centers[chunk][2]);
#endif
    own->open[chunk] = (ushort)lane_bits(exist);
    own->chunks[count++ * items + item] = (ushort)chunk;
  }
  return count;
}

// Closes the entries in a work item's chunks that lie at points of a lattice: seen points, or those that were taken back.
INLINE void ask_lattice(const Frame* f, const SeenPoints* lattice, uint chunks, __local Tile* own) {
  const int item = get_local_id(0), items = get_local_size(0);
  for (uint n = 0; n < chunks; ++n) {
    const int chunk = own->chunks[n * items + item];
    const Points center = entry_centers(own, chunk);
    const intv open = lane_marks(own->open[chunk]);
    own->open[chunk] = (ushort)lane_bits(open & ~seen_before(f, lattice, center, open));
  }
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
}

// Takes those off a tile's list that lie at points that were taken back, and notes them. Returns whether any point near the tile's
// candidates was taken back.
INLINE bool set_taken_aside(const Frame* f, const SeenPoints* taken, int3 tile, __global const float* layer_depth, __local Tile* own) {
  Box box;
  find_candidates_box(&f->grid, own, tile, layer_depth, f->limits.min_gap, &box);
  if (seen_in_box(f, taken, &box) == SEEN_NONE) return false;
  ask_lattice(f, taken, open_chunks(&f->grid, tile, layer_depth, own), own);
  for (uint n = get_local_id(0); n < own->entry_count; n += get_local_size(0))
    if (!entry_is_open(own, n)) add_entry(own->taken, tile, own->entries[n]);
  drop_settled(own, tile);
  return true;
}

// Asks a view of all chunks of a work item, one after the other: what is asked of one does not wait for another, and no branch has to be
// guessed. Returns how many have entries left.
INLINE uint ask_view(const View* view, __global const ushort* depths, uint chunks, __local Tile* own) {
  const int item = get_local_id(0), items = get_local_size(0);
  uint left = 0;
  for (uint n = 0; n < chunks; ++n) {
    const int chunk = own->chunks[n * items + item];
    const Points center = entry_centers(own, chunk);
    const intv open = lane_marks(own->open[chunk]);
    const uint still = lane_bits(open & ~knows(view, depths, center, open));
    own->open[chunk] = (ushort)still;
    own->chunks[left * items + item] = (ushort)chunk;
    left += still != 0 ? 1 : 0;
  }
  return left;
}

// Asks the listed views of a tile's candidates, and drops those that one knows. The first views settle most of them; those left are listed
// anew before more views are asked, FIRST_VIEWS at first, then twice as many and so on, so that vectors have few lanes to spare.
INLINE void ask_views(const Grid* g, int3 tile, __global const float* layer_depth, __global const View* views,
                      __global const ushort* depths, __local Tile* own) {
  for (uint first = 0, count = FIRST_VIEWS; first < own->view_count && own->entry_count != 0; first += count, count *= 2) {
    const uint last = min(first + count, own->view_count);
    uint chunks = open_chunks(g, tile, layer_depth, own);
    for (uint n = first; n < last && chunks != 0; ++n) {
      const View view = views[own->views[n]];
      chunks = ask_view(&view, depths, chunks, own);
    }
    GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
    drop_settled(own, tile);
  }
}

// Drops a tile's candidates that lie in space that was seen before. Returns how many of the points near them are seen.
//   box: around them
INLINE int ask_memory(const Frame* f, const SeenPoints* seen, int3 tile, __global const float* layer_depth, const Box* box,
                      __local Tile* own) {
  const int in_box = seen_in_box(f, seen, box);
  if (in_box == SEEN_NONE) return in_box;
  ask_lattice(f, seen, in_box == SEEN_ALL ? 0 : open_chunks(&f->grid, tile, layer_depth, own), own);
  if (in_box != SEEN_ALL) {
    drop_settled(own, tile);
    return in_box;
  }
  if (get_local_id(0) == 0) own->entry_count = 0;
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
  return in_box;
}

// One work-group has tiles of a word of VIEW_TILE x VIEW_TILE columns, which are WORD_TILES tiles one above the other: all of them, or one.
// Word (tile_j words_k + w) tiles_i + tile_i is that of group 0, 1, ..., or of the groups 0 to WORD_TILES - 1, and so on.
//   in  counts[COUNTS]: of 5_visit
//       views[view_count];  view_lanes: the same by fields (common/views.cl);  depths: their images;  layer_depth[size_k]
//       seen_..., taken_...: slots, tables, bricks of the seen points (common/seen_points.cl), and of those that were taken back
//   out tile_views[tiles_j][tiles_k][tiles_i][groups of views]: for tiles with candidates left, a bit for each view that may know something
//       near them
//       tile_seen[tiles_j][tiles_k][tiles_i]: for the same tiles, how many of the lattice points near them are seen
//   i/o candidates: bit field by tiles: those that a view knows, or that were seen before, are cleared, unless they were taken back. If
//       5_visit has found surfels to be split, all are cleared: all this is repeated after that
__kernel void settle_candidates(const Frame f, __global const View* views, __global const float* view_lanes, const int view_count,
                                __global const ushort* depths, __global const float* layer_depth, __global const int* seen_slots,
                                __global const int* seen_tables, __global const int* seen_bricks, __global const int* taken_slots,
                                __global const int* taken_tables, __global const int* taken_bricks, __global ushort* tile_views,
                                __global uchar* tile_seen, __global const uint* counts, __global ulong* candidates) {
  const int item = get_local_id(0), items = get_local_size(0), view_groups = (view_count + VIEW_GROUP - 1) / VIEW_GROUP;
  const int groups = WORD_TILES / GROUP_TILES, word = get_group_id(0) / groups, part = get_group_id(0) % groups,
            tiles_i = grid_tiles(f.grid.size_i);
  __global ulong* own_candidates = candidates + word * TILE_COLUMNS;
  const SeenPoints seen = {seen_slots, seen_tables, seen_bricks}, taken = {taken_slots, taken_tables, taken_bricks};
  __local Tile own;
  if (counts[COUNT_LARGE] > 0) return clear_words(&own, part, own_candidates);
  load_words(own_candidates, part, &own);
  int3 tile = (int3)(word % tiles_i, word / tiles_i / f.grid.words_k, word / tiles_i % f.grid.words_k * WORD_TILES + part * GROUP_TILES);
  if (own.layers == 0) return;

  for (const int last_tile = tile.z + GROUP_TILES - 1; tile.z <= last_tile; ++tile.z) {
    if (tile_layers(own.layers, tile) == 0) continue;
    const int tile_number = (tile.y * f.grid.words_k * WORD_TILES + tile.z) * tiles_i + tile.x;
    __global ushort* own_views = tile_views + tile_number * view_groups;
    list_entries(&own, tile);
    find_coordinates(&f.grid, tile, layer_depth, &own);
    GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
    if (f.has_taken && set_taken_aside(&f, &taken, tile, layer_depth, &own)) {
      for (int n = item; n < view_groups; n += items) own_views[n] = 0;  // no candidate may be left that sets them
      if (item == 0) tile_seen[tile_number] = SEEN_NONE;
    }
    if (item == 0) own.view_count = own.likely_views = 0;
    if (view_count > 0 && own.entry_count != 0) list_likely_views(&f.grid, tile, layer_depth, views, view_lanes, depths, &own);
    GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
    ask_views(&f.grid, tile, layer_depth, views, depths, &own);
    if (own.entry_count != 0) {
      keep_entries(&own, tile);
      Box box;
      find_candidates_box(&f.grid, &own, tile, layer_depth, f.limits.min_gap, &box);
      const int in_box = f.has_seen ? ask_memory(&f, &seen, tile, layer_depth, &box, &own) : SEEN_NONE;
      if (item == 0) tile_seen[tile_number] = (uchar)in_box;
    }
    if (own.entry_count != 0) {
      keep_entries(&own, tile);
      Box box;
      find_candidates_box(&f.grid, &own, tile, layer_depth, f.limits.min_gap, &box);
      find_near_views(views, view_lanes, view_groups, depths, &box, &own, own_views);
      list_views(&own, own_views, view_groups);
      GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
      ask_views(&f.grid, tile, layer_depth, views, depths, &own);
    }
    keep_entries(&own, tile);
  }

  store_words(&own, part, own_candidates);
}
