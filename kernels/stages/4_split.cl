// Split of surfels that are large for this view - paper 3.4.

// How many times a large surfel must be halved until it is small enough.
INLINE int split_levels(const Grid* g, const Limits* limits, float z, float radius) {
  int levels = 1;
  for (float r = 0.5f * radius / voxel_size(g, z); r >= limits->split_radius && levels < 6; r *= 0.5f) ++levels;
  return levels;
}

// One work item a surfel to be split.
//   out children[count]: surfels that it is split into
__kernel void count_children(const Grid g, const Limits limits, const Window window, const Transform T_camera_local,
                             __global const int4* page_block, __global const uint4* surfels, __global const uint* split_slots,
                             const uint count, __global uint* children) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const uint4 surfel = surfels[split_slots[n]];
  const float3 p = transform_point(&T_camera_local, surfel_position(&window, surfel, page_block[split_slots[n] / PAGE_SLOTS]));
  children[n] = 1u << (2 * split_levels(&g, &limits, p.z, surfel_radius(surfel)));
}

// One work item a surfel to be split. A surfel of radius r becomes 2^L x 2^L of radius r / 2^L, which is L times: four of r/2 at
// p +- r/(2 sqrt 2) x_psi +- r/(2 sqrt 2) y_psi. It leaves the map.
//   in  split_slots[count];  offset[count]: prefix sum of count_children's
//   out new_surfels, new_cells: the children, for the map
__kernel void split(const Grid g, const Limits limits, const Window window, const Transform T_camera_local, __global const int4* page_block,
                    __global const uint4* surfels, __global const uint* split_slots, const uint count, __global const uint* offset,
                    __global uint4* new_surfels, __global uint* new_cells, __global uint* alive, __global uint* changed) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const uint slot = split_slots[n];
  const uint4 surfel = surfels[slot];
  const float3 p = surfel_position(&window, surfel, page_block[slot / PAGE_SLOTS]), normal = unpack_normal(surfel.z);
  const float3 axis = fabs(normal.x) < 0.6f ? (float3)(1.0f, 0.0f, 0.0f) : (float3)(0.0f, 1.0f, 0.0f);
  const float3 x_psi = normalize(cross(normal, axis)), y_psi = cross(normal, x_psi);
  const int side = 1 << split_levels(&g, &limits, transform_point(&T_camera_local, p).z, surfel_radius(surfel));
  const float radius = surfel_radius(surfel) / side, spacing = radius * M_SQRT2_F;
  for (int child = 0; child < side * side; ++child) {
    const float a = ((float)(child % side) - 0.5f * (side - 1)) * spacing, b = ((float)(child / side) - 0.5f * (side - 1)) * spacing;
    uint cell;
    new_surfels[offset[n] + child] = pack_surfel(&window, p + a * x_psi + b * y_psi, radius, normal, surfel.w, &cell);
    new_cells[offset[n] + child] = cell;
  }
  clear_slot(alive, slot);
  set_slot(changed, slot);
}
