// The surfels that touch the view's grid, and their split - paper 3.4.
//
// The map is made of pages of PAGE_SLOTS surfels, each page of one block of the world; slot = PAGE_SLOTS page + n.
//   surfels[slots]: 16 bytes each. x: position x, y and y's lower half: z, in 65536ths of the block; y's upper half: radius [m] as a 16-bit
//     float; z: normal, octahedral, in 32767ths; w: attributes (0_shared.h)
//   alive[pages]: which slots hold a surfel;   page_block[pages]: x, y, z of the block, w: the frame that changed the page last
//   changed[pages]: which slots this frame has changed, for pages of this frame's window

// A positive float as 16 bits (IEEE half precision), rounded to nearest. Too small or large ones become the nearest that there is.
INLINE uint float_to_half(float x) { return (as_uint(clamp(x, 6.2e-5f, 65000.0f)) + 0x1000u - (112u << 23)) >> 13; }
INLINE float half_to_float(uint bits) { return as_float((bits << 13) + (112u << 23)); }

INLINE uint pack_normal(float3 n) {
  float2 p = n.xy / (fabs(n.x) + fabs(n.y) + fabs(n.z));
  if (n.z < 0.0f) p = (float2)(p.x < 0.0f ? fabs(p.y) - 1.0f : 1.0f - fabs(p.y), p.y < 0.0f ? fabs(p.x) - 1.0f : 1.0f - fabs(p.x));
  return ((uint)floor_int(32767.0f * p.x + 0.5f) & 0xffff) | ((uint)floor_int(32767.0f * p.y + 0.5f) << 16);
}

INLINE float3 unpack_normal(uint bits) {
  float3 n = (float3)((float)((int)(bits << 16) >> 16), (float)((int)bits >> 16), 0.0f);  // whole numbers: exact until it is normalised
  n.z = 32767.0f - fabs(n.x) - fabs(n.y);
  const float fold = fmax(-n.z, 0.0f);
  n.x += n.x < 0.0f ? fold : -fold;
  n.y += n.y < 0.0f ? fold : -fold;
  return n / sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
}

// Position in the local frame [m]; exact.
INLINE float3 surfel_position(const Window* window, uint4 surfel, int4 block) {
  const float3 corner =
      (float3)((float)(block.x - window->origin_x), (float)(block.y - window->origin_y), (float)(block.z - window->origin_z));
  const float3 within = (float3)((float)(surfel.x & 0xffff), (float)(surfel.x >> 16), (float)(surfel.y & 0xffff)) + 0.5f;
  return (corner + within / 65536.0f) * window->block_size;
}

INLINE float surfel_radius(uint4 surfel) { return half_to_float(surfel.y >> 16); }

// A surfel as the map keeps it. p: local frame;   out cell: of the window
INLINE uint4 pack_surfel(const Window* window, float3 p, float radius, float3 normal, uint attributes, uint* cell) {
  const float3 blocks = p / window->block_size;
  const int x = clamp(floor_int(blocks.x), 0, window->size_x - 1), y = clamp(floor_int(blocks.y), 0, window->size_y - 1),
            z = clamp(floor_int(blocks.z), 0, window->size_z - 1);
  *cell = (uint)((z * window->size_y + y) * window->size_x + x);
  const uint q_x = (uint)clamp((int)((blocks.x - (float)x) * 65536.0f), 0, 65535),
             q_y = (uint)clamp((int)((blocks.y - (float)y) * 65536.0f), 0, 65535),
             q_z = (uint)clamp((int)((blocks.z - (float)z) * 65536.0f), 0, 65535);
  return (uint4)(q_x | (q_y << 16), q_z | (float_to_half(radius) << 16), pack_normal(normal), attributes);
}

INLINE bool is_alive(__global const ulong* alive, uint slot) { return ((alive[slot / PAGE_SLOTS] >> (slot % PAGE_SLOTS)) & 1) != 0; }

// Bit of a slot in a word of its page, as 32-bit halves.
INLINE void set_slot(__global uint* halves, uint slot) { atomic_or(&halves[slot / 32], 1u << (slot % 32)); }
INLINE void clear_slot(__global uint* halves, uint slot) { atomic_and(&halves[slot / 32], ~(1u << (slot % 32))); }

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

// One group a page, one work item a slot: which surfels have an ellipsoid that may reach into the grid.
//   in  pages[count]: those of the window;   out in_view[count]
__kernel __attribute__((reqd_work_group_size(PAGE_SLOTS, 1, 1))) void mark_in_view(const Grid g, const Limits limits, const Window window,
                                                                                   const Transform T_camera_local,
                                                                                   __global const uint* pages, __global const ulong* alive,
                                                                                   __global const int4* page_block,
                                                                                   __global const uint4* surfels, __global ulong* in_view) {
  __local uchar mark[PAGE_SLOTS];
  const uint page = pages[get_group_id(0)], lane = get_local_id(0), slot = PAGE_SLOTS * page + lane;
  mark[lane] = 0;
  if (is_alive(alive, slot)) {
    const uint4 surfel = surfels[slot];
    const float3 p = transform_point(&T_camera_local, surfel_position(&window, surfel, page_block[page]));
    mark[lane] = may_reach_grid(&g, &limits, p, surfel_radius(surfel));
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  if (lane == 0) in_view[get_group_id(0)] = pack_marks(mark);
}

// How many times a surfel must be halved until it is small enough; 0 outside the grid.
INLINE int split_levels(const Grid* g, const Limits* limits, const ViewSurfel* s) {
  if (!inside_grid(g, voxel_of((float3)(s->i, s->j, s->k)))) return 0;
  int levels = 0;
  for (float r = 0.5f * s->reach; r >= limits->split_radius && levels < 6; r *= 0.5f) ++levels;
  return levels;
}

// One work item a surfel in view, beginning with number `first`, one group a word.
//   out view_surfels;  large[ceil((count - first) / 64)]: which must be split
__kernel __attribute__((reqd_work_group_size(64, 1, 1))) void place_surfels(const Grid g, const Limits limits, const Window window,
                                                                            const Transform T_camera_local, __global const int4* page_block,
                                                                            __global const uint4* surfels,
                                                                            __global const uint* in_view_slots, const uint first,
                                                                            const uint count, __global ViewSurfel* view_surfels,
                                                                            __global ulong* large) {
  __local uchar mark[64];
  const uint n = first + get_global_id(0), lane = get_local_id(0);
  mark[lane] = 0;
  if (n < count) {
    const ViewSurfel s = place_slot(&g, &window, &T_camera_local, surfels, page_block, in_view_slots[n]);
    view_surfels[n] = s;
    mark[lane] = split_levels(&g, &limits, &s) > 0;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  if (lane == 0) large[get_group_id(0)] = pack_marks(mark);
}

// One work item a surfel to be split.
//   out children[count]: surfels that it is split into
__kernel void count_children(const Grid g, const Limits limits, __global const ViewSurfel* view_surfels, __global const uint* split_list,
                             const uint count, __global uint* children) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const ViewSurfel s = view_surfels[split_list[n]];
  children[n] = 1u << (2 * split_levels(&g, &limits, &s));
}

// One work item a surfel to be split. A surfel of radius r becomes 2^L x 2^L of radius r / 2^L, which is L times: four of r/2 at
// p +- r/(2 sqrt 2) x_psi +- r/(2 sqrt 2) y_psi. It leaves the map, and
// the view.
//   in  split_list[count]: numbers of surfels in view;  offset[count]: prefix sum of count_children's
//   out new_surfels, new_cells: the children, for the map
__kernel void split(const Grid g, const Limits limits, const Window window, __global const int4* page_block, __global const uint4* surfels,
                    __global ViewSurfel* view_surfels, __global const uint* split_list, const uint count, __global const uint* offset,
                    __global uint4* new_surfels, __global uint* new_cells, __global uint* alive, __global uint* changed) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const uint parent = split_list[n];
  const ViewSurfel s = view_surfels[parent];
  const int levels = split_levels(&g, &limits, &s);
  const uint4 surfel = surfels[s.slot];
  const float3 p = surfel_position(&window, surfel, page_block[s.slot / PAGE_SLOTS]), normal = unpack_normal(surfel.z);
  const float3 axis = fabs(normal.x) < 0.6f ? (float3)(1.0f, 0.0f, 0.0f) : (float3)(0.0f, 1.0f, 0.0f);
  const float3 x_psi = normalize(cross(normal, axis)), y_psi = cross(normal, x_psi);
  const int side = 1 << levels;
  const float radius = surfel_radius(surfel) / side, spacing = radius * M_SQRT2_F;
  for (int child = 0; child < side * side; ++child) {
    const float a = ((float)(child % side) - 0.5f * (side - 1)) * spacing, b = ((float)(child / side) - 0.5f * (side - 1)) * spacing;
    uint cell;
    new_surfels[offset[n] + child] = pack_surfel(&window, p + a * x_psi + b * y_psi, radius, normal, surfel.w, &cell);
    new_cells[offset[n] + child] = cell;
  }
  view_surfels[parent].i = view_surfels[parent].j = view_surfels[parent].k = -1e6f;
  clear_slot(alive, s.slot);
  set_slot(changed, s.slot);
}
