// The surfels that touch the view's grid, and their split - paper 3.4.
//
// The map: position_radius[slot] = centre, world frame, and radius [m]; normal_attributes[slot] = normal, world frame, and attributes
// (0_shared.h) as bits of the fourth component. changed[slot]: number of the frame that changed the slot last.

INLINE bool is_alive(float4 normal_attributes) { return (as_uint(normal_attributes.w) & SURFEL_ALIVE) != 0; }

INLINE ViewSurfel place_in_view(const Grid* g, const Transform* T_camera_world, float4 position_radius, float4 normal_attributes,
                                uint slot) {
  const float3 p = transform_point(T_camera_world, position_radius.xyz);
  const float3 n = rotate(T_camera_world, normal_attributes.xyz);
  const float3 c = to_grid(g, p);
  const bool pyramid = p.z >= g->z_min;
  ViewSurfel s;
  s.i = c.x;
  s.j = c.y;
  s.k = c.z;
  s.reach = 2.0f * position_radius.w / voxel_size(g, p.z);
  s.n_x = n.x;
  s.n_y = n.y;
  s.n_z = n.z;
  s.n_k = pyramid ? dot(n, p) / length(p) : n.z;
  s.ray_x = pyramid ? p.x / p.z : 0.0f;
  s.ray_y = pyramid ? p.y / p.z : 0.0f;
  s.slot = slot;
  s.ragged = (as_uint(normal_attributes.w) & SURFEL_RAGGED) != 0 ? 1 : 0;
  return s;
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

// Could the ellipsoid of a surfel of radius r at p (camera frame) reach into the grid? Generous, and cheaper than F.
INLINE bool may_reach_grid(const Grid* g, const Limits* limits, float3 p, float r) {
  const float voxel = voxel_size(g, p.z), reach = fmax(2.0f * r / voxel, limits->thickness) + 1.5f;
  if (p.z < -((float)g->padding_k + reach) * voxel || p.z > g->z_max + 2.0f * reach * voxel) return false;
  const bool pyramid = p.z >= g->z_min;
  const float ray_x = pyramid ? p.x / p.z : 0.0f, ray_y = pyramid ? p.y / p.z : 0.0f;
  const float i = (pyramid ? ray_x : p.x / g->z_min) * g->fx + g->center_i, j = (pyramid ? ray_y : p.y / g->z_min) * g->fy + g->center_j;
  const float reach_i = reach * (1.0f + fabs(ray_x)), reach_j = reach * (1.0f + fabs(ray_y));
  return i > -reach_i && i < (float)g->size_i + reach_i && j > -reach_j && j < (float)g->size_j + reach_j;
}

// One work item a slot, one group a word: which surfels have an ellipsoid that may reach into the grid.
//   out in_view[ceil(slots / 64)]: bit slot % 64 of word slot / 64
__kernel __attribute__((reqd_work_group_size(64, 1, 1))) void mark_in_view(const Grid g, const Limits limits,
                                                                           const Transform T_camera_world,
                                                                           __global const float4* position_radius,
                                                                           __global const float4* normal_attributes, const uint slots,
                                                                           __global ulong* in_view) {
  __local uchar mark[64];
  const uint slot = get_global_id(0), lane = get_local_id(0);
  mark[lane] = 0;
  if (slot < slots && is_alive(normal_attributes[slot])) {
    mark[lane] = may_reach_grid(&g, &limits, transform_point(&T_camera_world, position_radius[slot].xyz), position_radius[slot].w);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  if (lane == 0) in_view[get_group_id(0)] = pack_marks(mark);
}

// One work item a surfel in view.
__kernel void place_surfels(const Grid g, const Transform T_camera_world, __global const float4* position_radius,
                            __global const float4* normal_attributes, __global const uint* in_view_slots, const uint count,
                            __global ViewSurfel* view_surfels) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const uint slot = in_view_slots[n];
  view_surfels[n] = place_in_view(&g, &T_camera_world, position_radius[slot], normal_attributes[slot], slot);
}

// How many times a surfel must be halved until it is small enough; 0 outside the grid.
INLINE int split_levels(const Grid* g, const Limits* limits, const ViewSurfel* s) {
  if (!inside_grid(g, voxel_of((float3)(s->i, s->j, s->k)))) return 0;
  int levels = 0;
  for (float r = 0.5f * s->reach; r >= limits->split_radius && levels < 6; r *= 0.5f) ++levels;
  return levels;
}

// One work item a surfel in view.
//   out additional[count]: surfels that its split adds to the map
__kernel void count_splits(const Grid g, const Limits limits, __global const ViewSurfel* view_surfels, const uint count,
                           __global uint* additional) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const ViewSurfel s = view_surfels[n];
  additional[n] = (1u << (2 * split_levels(&g, &limits, &s))) - 1u;
}

// The n-th slot that new surfels of this frame take: first the free ones, last freed first, then beyond the end.
INLINE uint new_slot(uint n, __global const uint* free_slots, uint free_count, uint slots) {
  return n < free_count ? free_slots[free_count - 1 - n] : slots + (n - free_count);
}

// One work item a surfel in view. A surfel of radius r becomes 2^L x 2^L of radius r / 2^L, which is L times: four of r/2 at
// p +- r/(2 sqrt 2) x_psi +- r/(2 sqrt 2) y_psi. The first keeps the slot; the others are added to the surfels in view.
//   in  offset[count]: prefix sum of count_splits' additional
//   i/o in_view_slots: count entries, additional ones behind them
__kernel void split(const Grid g, const Limits limits, __global const ViewSurfel* view_surfels, __global float4* position_radius,
                    __global float4* normal_attributes, __global uint* changed, const uint frame, __global uint* in_view_slots,
                    const uint count, __global const uint* offset, __global const uint* free_slots, const uint free_count,
                    const uint slots) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const ViewSurfel s = view_surfels[n];
  const int levels = split_levels(&g, &limits, &s);
  if (levels == 0) return;

  const uint slot = s.slot;
  const float4 p = position_radius[slot], normal = normal_attributes[slot];
  const float3 axis = fabs(normal.x) < 0.6f ? (float3)(1.0f, 0.0f, 0.0f) : (float3)(0.0f, 1.0f, 0.0f);
  const float3 x_psi = normalize(cross(normal.xyz, axis)), y_psi = cross(normal.xyz, x_psi);
  const int side = 1 << levels;
  const float radius = p.w / side, spacing = radius * M_SQRT2_F;
  for (int child = 0; child < side * side; ++child) {
    const float a = ((float)(child % side) - 0.5f * (side - 1)) * spacing, b = ((float)(child / side) - 0.5f * (side - 1)) * spacing;
    const uint addition = offset[n] + child - 1;
    const uint target = child == 0 ? slot : new_slot(addition, free_slots, free_count, slots);
    position_radius[target] = (float4)(p.xyz + a * x_psi + b * y_psi, radius);
    normal_attributes[target] = normal;
    changed[target] = frame;
    if (child > 0) in_view_slots[count + addition] = target;
  }
}
