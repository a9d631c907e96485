// Creation - paper 3.5, eq. (14)-(16): a surfel for each candidate that is left and has a normal, at its voxel's centre. Ours, if refine:
// its normal ends in known space, and it slides towards the boundary.

// Normals of new surfels: the mean direction; or, where that leaves known space again at front_probe (thin or ragged space), the direction
// to a single observed voxel that does not and that is nearest to the mean. Such a surfel is ragged.
//   center: of the voxels, mean: normalised, both camera frame;  around: observed_around the voxels;   out ragged: marks
INLINE Points surfel_normals(const Grid* g, const Limits* limits, const View* view, __global const ushort* depths,
                             __global const float* layer_depth, Voxels v, Points center, Points mean, intv around, intv asked,
                             intv* ragged) {
  const floatv front = limits->front_probe * voxel_size(g, center.z);
  *ragged = asked & ~own_view_knows(view, depths, add_scaled(center, front, mean), asked);
  if (!any_lane(*ragged)) return mean;
  Points best = mean;
  floatv best_cosine = -1.0f;
  for (int dk = -1; dk <= 1; ++dk) {
    LayerOffsets layer;
    layer_around(g, layer_depth, v, center, dk, &layer);
    for (int n = 0; n < 9; ++n) {
      intv better = *ragged & MARK((around & 1 << AROUND(n % 3 - 1, n / 3 - 1, dk)) != 0);
      if (!any_lane(better)) continue;
      const Points direction = normalized((Points){layer.x[n % 3], layer.y[n / 3], layer.z});
      const floatv cosine = dot_products(direction, mean);
      better &= MARK(cosine > best_cosine);
      better = own_view_knows(view, depths, add_scaled(center, front, direction), better);
      best.x = better ? direction.x : best.x;
      best.y = better ? direction.y : best.y;
      best.z = better ? direction.z : best.z;
      best_cosine = better ? cosine : best_cosine;
    }
  }
  return best;
}

// Positions of new surfels in their voxels: they slide along their normals until they are near the boundary, by whole steps. A step is left
// in hand before what this view or a kept one knows, and a surfel that has known space at front_probe before it does not lose it.
//   taken: marks of those at points that were taken back, for which this view alone counts
INLINE Points slide_to_boundary(const Frame* f, ViewsAround* around, const SeenPoints* seen, bool ask_seen, __global const ushort* depths,
                                Voxels v, Points center, Points normal, intv taken, intv asked) {
  const Grid* g = &f->grid;
  const Limits* limits = &f->limits;
  const View* view = &f->own_view;
  const floatv voxel = voxel_size(g, center.z);
  const Points forward = scaled(SLIDE_STEP * voxel, normal), ahead = scaled(limits->front_probe * voxel, normal);
  const intv has_front = own_view_knows(view, depths, add_scaled(center, 1.0f, ahead), asked);
  intv moving = asked, steps = 0;
  for (int n = 1; n <= SLIDE_STEPS && any_lane(moving); ++n) {
    const Points next = add_scaled(center, (float)n, forward);
    moving &= same_voxels(voxels_at(g, next), v);
    moving &= ~own_view_knows(view, depths, next, moving);
    moving &= ~own_view_knows(view, depths, add_scaled(next, 1.0f, forward), moving);
    moving &= ~has_front | own_view_knows(view, depths, add_scaled(next, 1.0f, ahead), moving & has_front);
    steps -= moving;
  }
  intv open = asked & ~taken & MARK(steps > 0);
  for (int n = 0; n < SLIDE_STEPS && must_ask(open); ++n) {
    intv known = any_view_knows(around, depths, add_scaled(center, convert_floatv(steps + 1), forward), open);
    known |= any_view_knows(around, depths, add_scaled(center, convert_floatv(steps), forward), open & ~known);
    if (ask_seen && any_lane(open & ~known))
      known |= seen_before(f, seen, add_scaled(center, convert_floatv(steps), forward), open & ~known);
    steps += known;
    open = known & MARK(steps > 0);
  }
  return add_scaled(center, convert_floatv(steps), forward);
}

// One work item handles a chunk of LANES new surfels, or `team` of them handle one.
//   in  seen_..., taken_...: slots, tables, bricks of the seen points (common/seen_points.cl), and of those that were taken back
//       created[length[0]]: their numbers among the listed candidates, whose voxels, around and directions are find_directions'
//       views: the kept ones;  tile_views: of settle_candidates;  depths: images of views, this frame's among them
//   out new_surfels[length[0]], new_cells[length[0]]: packed for the map, and their cells of the window
__kernel void create_surfels(const Frame f, __global const View* views, __global const ushort* tile_views, const int view_groups,
                             __global const ushort* depths, __global const float* layer_depth, __global const int* seen_slots,
                             __global const int* seen_tables, __global const int* seen_bricks, __global const int* taken_slots,
                             __global const int* taken_tables, __global const int* taken_bricks, __global const uchar* tile_seen,
                             __global const int* created, __global const uint* length, __global const int* voxels,
                             __global const int* around, __global const float* directions, const int team, __global uint4* new_surfels,
                             __global int* new_cells) {
  __local Answers told;
  const int count = (int)length[0];
  int chunk;
  bool writes;
  if (!find_chunk(count, team, &chunk, &writes)) return;
  intv exist, ragged = 0;
  const intv numbers = load_chunk(created, count, chunk, &exist);
  const Voxels v = voxels_of(&f.grid, gather_int(voxels, numbers));
  const Points center = voxel_centers(&f.grid, layer_depth, v);
  Points p = center, normal = normalized(gather_directions(directions, numbers));
  if (f.limits.refine) {
    ViewsAround near;
    find_views_around(&f.grid, views, tile_views, view_groups, v, team, &told, &near);
    normal = surfel_normals(&f.grid, &f.limits, &f.own_view, depths, layer_depth, v, center, normal, gather_int(around, numbers), exist,
                            &ragged);
    const SeenPoints seen = {seen_slots, seen_tables, seen_bricks}, taken = {taken_slots, taken_tables, taken_bricks};
    bool ask_seen = false;
    for (int n = 0; n < near.tile_count; ++n) ask_seen = ask_seen || tile_seen[near.tiles[n]] != SEEN_NONE;
    const intv is_taken = f.has_taken ? seen_before(&f, &taken, center, exist) : 0;
    p = slide_to_boundary(&f, &near, &seen, f.has_seen && ask_seen, depths, v, center, normal, is_taken, exist);
  }
  if (!writes) return;
  const floatv radius = f.limits.create_radius * voxel_size(&f.grid, center.z);
  const uintv attributes = ragged ? (uintv)(SURFEL_RAGGED) : (uintv)(0);
  intv cells;
  const Quads packed =
      pack_surfels(&f.window, transformed(&f.T_local_camera, p), radius, rotated(&f.T_local_camera, normal), attributes, &cells);
  scatter_quads(packed, chunk * LANES + lane_numbers(), exist, new_surfels);
  store_first(cells, count - chunk * LANES, new_cells + chunk * LANES);
}
