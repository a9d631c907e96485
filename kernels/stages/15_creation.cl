// Creation - paper 3.5, eq. (14)-(16): a surfel at the centre of each candidate that has a normal.

// So far before a surfel, 7/4 of its radius, known space is expected.
INLINE float16 front_distances(const Grid* g, float16 z) { return 1.75f * 0.8660254f * voxel_sizes(g, z); }

// Normals of new surfels: the mean direction; if that leaves known space again at 7/4 r (thin or ragged space), the direction to a single
// observed voxel nearest to it that does not, and the surfel is ragged.
//   around: the voxels' observed_around
INLINE Points surfel_normals(const Grid* g, const View* view, __global const ushort* depths, __global const float* layer_depth, Voxels v,
                             Points center, Points mean, int16 around, int16 asked, int16* ragged) {
  const float16 reach = front_distances(g, center.z);
  *ragged = asked & ~own_view_knows(view, depths, add_scaled(center, reach, mean), asked);
  if (lane_bits(*ragged) == 0) return mean;
  Points best = mean;
  float16 best_cosine = -1.0f;
  for (int dk = -1; dk <= 1; ++dk) {
    LayerOffsets layer;
    layer_around(g, layer_depth, v, center, dk, &layer);
    for (int n = 0; n < 9; ++n) {
      int16 better = *ragged & ((around & 1 << AROUND(n % 3 - 1, n / 3 - 1, dk)) != 0);
      if (lane_bits(better) == 0) continue;
      const Points direction = normalized((Points){layer.x[n % 3], layer.y[n / 3], layer.z});
      const float16 cosine = direction.x * mean.x + direction.y * mean.y + direction.z * mean.z;
      better &= cosine > best_cosine;
      better = own_view_knows(view, depths, add_scaled(center, reach, direction), better);
      best.x = better ? direction.x : best.x;
      best.y = better ? direction.y : best.y;
      best.z = better ? direction.z : best.z;
      best_cosine = better ? cosine : best_cosine;
    }
  }
  return best;
}

// Where in their voxels surfels stand: slid along their normals until they are near the boundary, in steps of a tenth of a voxel. A step
// is left in hand before what this view or a kept one knows, and a surfel that has known space before it (at 7/4 r) does not lose it.
INLINE Points slide_to_boundary(const Grid* g, const View* view, const ViewsAround* around, __global const ushort* depths, Voxels v,
                                Points center, Points normal, int16 asked) {
  const float16 step = 0.1f * voxel_sizes(g, center.z), front = front_distances(g, center.z);
  const Points forward = {step * normal.x, step * normal.y, step * normal.z};
  const Points ahead = {front * normal.x, front * normal.y, front * normal.z};
  const int16 has_front = own_view_knows(view, depths, add_scaled(center, 1.0f, ahead), asked);
  int16 moving = asked, steps = 0;
  for (int n = 1; n <= 4 && lane_bits(moving) != 0; ++n) {
    const Points next = add_scaled(center, (float)n, forward);
    moving &= same_voxels(voxels_at(g, next), v);
    moving &= ~own_view_knows(view, depths, next, moving);
    moving &= ~own_view_knows(view, depths, add_scaled(next, 1.0f, forward), moving);
    moving &= ~has_front | own_view_knows(view, depths, add_scaled(next, 1.0f, ahead), moving & has_front);
    steps -= moving;
  }
  int16 open = asked & (steps > 0);
  while (lane_bits(open) != 0) {
    int16 known = any_view_knows(around, depths, add_scaled(center, convert_float16(steps + 1), forward), open);
    known |= any_view_knows(around, depths, add_scaled(center, convert_float16(steps), forward), open & ~known);
    steps += known;
    open = known & (steps > 0);
  }
  return add_scaled(center, convert_float16(steps), forward);
}

// One work item a chunk of LANES new surfels.
//   in  created[count]: their numbers among the listed candidates, whose voxels, around and directions are find_directions'
//       refine: whether they leave their voxel's centre and mean normal
//       view: this frame's, views: the kept ones, both in this frame's camera;  tile_views: of settle_candidates;  depths: their images
//   out new_surfels[count], new_cells[count]: for the map
__kernel void create_surfels(const Grid g, const Limits limits, const Window window, const Transform T_local_camera, const int refine,
                             const View view, __global const View* views, __global const ushort* tile_views, const int view_groups,
                             __global const ushort* depths, __global const float* layer_depth, __global const int* created, const int count,
                             __global const int* voxels, __global const int* around, __global const float* directions,
                             __global uint4* new_surfels, __global uint* new_cells) {
  const int chunk = get_global_id(0);
  if (chunk * LANES >= count) return;
  int16 exist, ragged = 0;
  const int16 numbers = load_chunk(created, count, chunk, &exist);
  const Voxels v = voxels_of(&g, gather_int(voxels, numbers));
  const Points center = voxel_centers(&g, layer_depth, v);
  const int16 at = numbers / LANES * 3 * LANES + numbers % LANES;
  Points p = center;
  Points normal = normalized((Points){gather(directions, at), gather(directions, at + LANES), gather(directions, at + 2 * LANES)});
  if (refine) {
    ViewsAround near;
    find_views_around(&g, views, tile_views, view_groups, v, &near);
    normal = surfel_normals(&g, &view, depths, layer_depth, v, center, normal, gather_int(around, numbers), exist, &ragged);
    p = slide_to_boundary(&g, &view, &near, depths, v, center, normal, exist);
  }
  float shaped[8][LANES];
  vstore16(p.x, 0, shaped[0]);
  vstore16(p.y, 0, shaped[1]);
  vstore16(p.z, 0, shaped[2]);
  vstore16(limits.create_radius * voxel_sizes(&g, center.z), 0, shaped[3]);
  vstore16(normal.x, 0, shaped[4]);
  vstore16(normal.y, 0, shaped[5]);
  vstore16(normal.z, 0, shaped[6]);
  vstore16(as_float16(ragged ? (int16)(SURFEL_RAGGED) : 0), 0, shaped[7]);
  for (int n = 0; n < LANES && chunk * LANES + n < count; ++n) {
    const float3 position = transform_point(&T_local_camera, (float3)(shaped[0][n], shaped[1][n], shaped[2][n]));
    const float3 direction = rotate(&T_local_camera, (float3)(shaped[4][n], shaped[5][n], shaped[6][n]));
    uint cell;
    new_surfels[chunk * LANES + n] = pack_surfel(&window, position, shaped[3][n], direction, as_uint(shaped[7][n]), &cell);
    new_cells[chunk * LANES + n] = cell;
  }
}
