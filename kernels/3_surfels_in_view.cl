// The surfels that touch the view's grid, and their split - paper 3.4.

// p, n: camera frame
INLINE ViewSurfel place_in_view(const Grid* g, float3 p, float3 n, float radius, uint attributes, uint slot) {
  const float3 c = to_grid(g, p);
  const bool pyramid = p.z >= g->z_min;
  ViewSurfel s;
  s.i = c.x;
  s.j = c.y;
  s.k = c.z;
  s.reach = 2.0f * radius / voxel_size(g, p.z);
  s.n_x = n.x;
  s.n_y = n.y;
  s.n_z = n.z;
  s.n_k = pyramid ? dot(n, p) / length(p) : n.z;
  s.ray_x = pyramid ? p.x / p.z : 0.0f;
  s.ray_y = pyramid ? p.y / p.z : 0.0f;
  s.slot = slot;
  s.ragged = (attributes & SURFEL_RAGGED) != 0 ? 1 : 0;
  return s;
}

// A surfel of the map, placed.
INLINE ViewSurfel place_slot(const Grid* g, const Window* window, const Transform* T_camera_local, __global const uint4* surfels,
                             __global const int4* page_block, uint slot) {
  const uint4 surfel = surfels[slot];
  const float3 p = transform_point(T_camera_local, surfel_position(window, surfel, page_block[slot / PAGE_SLOTS]));
  return place_in_view(g, p, rotate(T_camera_local, unpack_normal(surfel.z)), surfel_radius(surfel), surfel.w, slot);
}

// Half the length, along the functional (a_x, a_y, a_z), of the surfel's ellipsoid e < 1 - supplement B.
INLINE float ellipsoid_extent(const ViewSurfel* s, float thickness, float3 a) {
  const float along = dot(a, (float3)(s->n_x, s->n_y, s->n_z));
  return sqrt(thickness * thickness * along * along + s->reach * s->reach * fmax(dot(a, a) - along * along, 0.0f));
}

// The ellipsoid's half lengths along the grid's i, j and k.
INLINE float3 ellipsoid_extents(const ViewSurfel* s, float thickness) {
  return (float3)(ellipsoid_extent(s, thickness, (float3)(1.0f, 0.0f, -s->ray_x)),
                  ellipsoid_extent(s, thickness, (float3)(0.0f, 1.0f, -s->ray_y)),
                  ellipsoid_extent(s, thickness, (float3)(0.0f, 0.0f, 1.0f)));
}

// Which of LANES surfels have an ellipsoid that may reach into the grid, generously.
INLINE int16 reach_grid(const Grid* g, const Limits* limits, const Surfels* s, float16 voxel) {
  const Points p = s->position;
  const float16 slope = 1.0f / fmax(p.z, g->z_min);
  const float16 reach = fmax(2.0f * s->radius / voxel, limits->thickness) + 1.5f;
  const float16 i = p.x * slope * g->fx + g->center_i, j = p.y * slope * g->fy + g->center_j;
  const float16 reach_i = reach * (1.0f + fabs(p.x * slope)), reach_j = reach * (1.0f + fabs(p.y * slope));
  return (p.z >= -((float)g->padding_k + reach) * voxel) & (p.z <= g->z_max + 2.0f * reach * voxel) & (i > -reach_i) &
         (i < (float)g->size_i + reach_i) & (j > -reach_j) & (j < (float)g->size_j + reach_j);
}

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

// One work item a surfel in view, for the sign field.
__kernel void place_surfels(const Grid g, const Window window, const Transform T_camera_local, __global const int4* page_block,
                            __global const uint4* surfels, __global const uint* in_view_slots, const uint count,
                            __global ViewSurfel* view_surfels) {
  const uint n = get_global_id(0);
  if (n < count) view_surfels[n] = place_slot(&g, &window, &T_camera_local, surfels, page_block, in_view_slots[n]);
}
