// Inner product sign field D - paper 3.2, supplement B - and the events that the sweeps will meet - Algorithm 1.
//
// For a voxel at offset u (locally metric voxel coordinates) from a surfel with normal n, reach rho and thickness t:
//   e^2 = (u.n)^2 / t^2 + |u - (u.n) n|^2 / rho^2,  weight w = 1 - e where e < 1;  g_tau = <n, t_tau>
//   |g_tau| > th_d: D_tau += sign(g_tau) w;   else, where e < 1 and |u - (u.n) n| < rho / 2: the voxel is invalid for family tau.
// Ours: a ragged surfel (17_creation) makes voxels invalid for every family.
// One work-group handles one tile in local memory. Its sums are integers: the order of surfels and the number of work items do not matter.

// Surfels as the view's grid sees them.
//   s, normal: camera frame;   out placed[LANES]
INLINE void place_in_view(const Grid* g, const Surfels* s, Points normal, uintv slots, ViewSurfel* placed) {
  const Points p = s->position, c = to_grid(g, p);
  const intv pyramid = MARK(p.z >= g->z_min);
  float i[LANES], j[LANES], k[LANES], reach[LANES], n_x[LANES], n_y[LANES], n_z[LANES], n_k[LANES], ray_x[LANES], ray_y[LANES];
  uint slot[LANES], ragged[LANES];
  vstorev(c.x, 0, i);
  vstorev(c.y, 0, j);
  vstorev(c.z, 0, k);
  vstorev(divided(2.0f * s->radius, voxel_size(g, p.z)), 0, reach);
  vstorev(normal.x, 0, n_x);
  vstorev(normal.y, 0, n_y);
  vstorev(normal.z, 0, n_z);
  vstorev(pyramid ? divided(dot_products(normal, p), lengths(p)) : normal.z, 0, n_k);
  vstorev(pyramid ? divided(p.x, p.z) : 0.0f, 0, ray_x);
  vstorev(pyramid ? divided(p.y, p.z) : 0.0f, 0, ray_y);
  vstorev(slots, 0, slot);
  vstorev((s->attributes & SURFEL_RAGGED) != 0 ? (uintv)(1) : (uintv)(0), 0, ragged);
  for (int n = 0; n < LANES; ++n)
    placed[n] = (ViewSurfel){i[n], j[n], k[n], reach[n], n_x[n], n_y[n], n_z[n], n_k[n], ray_x[n], ray_y[n], slot[n], ragged[n]};
}

// One work item handles a chunk of LANES surfels in view.
//   in  in_view_slots[count];  page_block, surfels: the map;   out view_surfels[count]
__kernel void place_surfels(const Frame f, __global const int4* page_block, __global const uint4* surfels,
                            __global const int* in_view_slots, const int count, __global ViewSurfel* view_surfels) {
  const int chunk = get_global_id(0);
  if (chunk * LANES >= count) return;
  intv exist;
  const uintv slots = as_uintv(load_chunk(in_view_slots, count, chunk, &exist));
  Surfels s = surfels_at(&f.window, surfels, page_block, slots);
  s.position = transformed(&f.T_camera_local, s.position);
  ViewSurfel placed[LANES];
  place_in_view(&f.grid, &s, rotated(&f.T_camera_local, unpack_normals(s.normal)), slots, placed);
  for (int n = 0; n < LANES && chunk * LANES + n < count; ++n) view_surfels[chunk * LANES + n] = placed[n];
}

// Half the length, along the functional (a_x, a_y, a_z), of the surfel's ellipsoid e < 1 - supplement B.
INLINE float ellipsoid_extent(const ViewSurfel* s, float thickness, float3 a) {
  const float along = a.x * s->n_x + a.y * s->n_y + a.z * s->n_z, all = a.x * a.x + a.y * a.y + a.z * a.z;
  return square_root(thickness * thickness * along * along + s->reach * s->reach * fmax(all - along * along, 0.0f));
}

// The ellipsoid's half lengths along the grid's i, j and k.
INLINE float3 ellipsoid_extents(const ViewSurfel* s, float thickness) {
  return (float3)(ellipsoid_extent(s, thickness, (float3)(1.0f, 0.0f, -s->ray_x)),
                  ellipsoid_extent(s, thickness, (float3)(0.0f, 1.0f, -s->ray_y)),
                  ellipsoid_extent(s, thickness, (float3)(0.0f, 0.0f, 1.0f)));
}

#define PADDED_K (TILE_K + 2)
#define BEYOND 8  // a vector that begins in the last row may end behind it

// The sign field of a tile. Each family has one voxel more before and behind the tile along its own paths.
typedef struct {
  int i[(TILE_I + 2) * TILE_J * PADDED_K + BEYOND];
  int j[TILE_I * (TILE_J + 2) * PADDED_K + BEYOND];
  int k[TILE_I * TILE_J * PADDED_K + BEYOND];
  uint touched[TILE_I * TILE_J];  // bits along k that a surfel reached
  uint invalid[3][TILE_I * TILE_J];
} SignFieldTile;

// Paths through a tile that are to be walked.
typedef struct {
  uint i[TILE_J], j[TILE_I], k[TILE_I];  // bits along k, along k, along j
  uint any;
} NeededPaths;

// One work item needs no atomics.
#if HEAVY_GROUP == 1
#define OR(target, value) ((target) |= (value))
INLINE void accumulate(__local int* target, int8 values) { vstore8(vload8(0, target) + values, 0, target); }
#else
#define OR(target, value) atomic_or(&(target), (value))
INLINE void accumulate(__local int* target, int8 values) {
  const int value[8] = {values.s0, values.s1, values.s2, values.s3, values.s4, values.s5, values.s6, values.s7};
  for (int n = 0; n < 8; ++n)
    if (value[n] != 0) atomic_add(target + n, value[n]);
}
#endif

// Sets numbers to zero, all work items of the group together.
INLINE void clear(__local int* numbers, size_t bytes) {
  for (int n = get_local_id(0); n < (int)(bytes / sizeof(int)); n += HEAVY_GROUP) numbers[n] = 0;
}
INLINE void clear_tile(__local SignFieldTile* tile) {
  clear(tile->i, sizeof(tile->i));
  clear(tile->j, sizeof(tile->j));
  clear(tile->k, sizeof(tile->k));
  clear((__local int*)tile->touched, sizeof(tile->touched));
  for (int family = 0; family < 3; ++family) clear((__local int*)tile->invalid[family], sizeof(tile->invalid[family]));
}

// Bits first ... last of a tile's column, both -1 ... TILE_K.
INLINE uint run_in_tile(int first, int last) {
  first = max(first, 0);
  last = min(last, TILE_K - 1);
  return first > last ? 0u : (~0u >> (31 - last)) & (~0u << first);
}

// First and last tile, along each axis, that a surfel's ellipsoid (and one voxel around it) touches. False: none.
bool tile_range(const Grid* g, const Limits* limits, const ViewSurfel* s, int3* first, int3* last) {
  const float3 c = (float3)(s->i, s->j, s->k), extent = ellipsoid_extents(s, limits->thickness);
  const int3 low = (int3)(ceil_int(c.x - extent.x), ceil_int(c.y - extent.y), ceil_int(c.z - extent.z)) - 1;
  const int3 high = (int3)(floor_int(c.x + extent.x), floor_int(c.y + extent.y), floor_int(c.z + extent.z)) + 1;
  const int3 size = (int3)(g->size_i, g->size_j, g->size_k), tile = (int3)(TILE_I, TILE_J, TILE_K);
  if (any(high < 0) || any(low >= size)) return false;
  *first = max(low, (int3)(0)) / tile;  // not a plain 0, which Oclgrind 21 takes for a vector
  *last = min(high, size - 1) / tile;
  return true;
}

// Tiles along each axis; along k they fill whole words.
int3 tiles_of(const Grid* g) { return (int3)((g->size_i - 1) / TILE_I + 1, (g->size_j - 1) / TILE_J + 1, g->words_k * (64 / TILE_K)); }

// One work item handles a surfel in view: it counts the surfels that touch each tile.
//   i/o tile_counts[tiles]: zero before; tile (i, j, k) has number (k tiles_j + j) tiles_i + i
__kernel void count_tiles(const Frame f, __global const ViewSurfel* view_surfels, const uint count, __global uint* tile_counts) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const ViewSurfel s = view_surfels[n];
  const int3 tiles = tiles_of(&f.grid);
  int3 first, last;
  if (!tile_range(&f.grid, &f.limits, &s, &first, &last)) return;
  for (int k = first.z; k <= last.z; ++k)
    for (int j = first.y; j <= last.y; ++j)
      for (int i = first.x; i <= last.x; ++i) atomic_inc(&tile_counts[(k * tiles.y + j) * tiles.x + i]);
}

// One work item handles a surfel in view: it enters it into the lists of tiles, in any order.
//   i/o tile_cursor[tiles]: before: where the tile's list begins; after: where it ends
//   out tile_surfels: indices into view_surfels
__kernel void fill_tiles(const Frame f, __global const ViewSurfel* view_surfels, const uint count, __global uint* tile_cursor,
                         __global uint* tile_surfels) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const ViewSurfel s = view_surfels[n];
  const int3 tiles = tiles_of(&f.grid);
  int3 first, last;
  if (!tile_range(&f.grid, &f.limits, &s, &first, &last)) return;
  for (int k = first.z; k <= last.z; ++k)
    for (int j = first.y; j <= last.y; ++j)
      for (int i = first.x; i <= last.x; ++i) tile_surfels[atomic_inc(&tile_cursor[(k * tiles.y + j) * tiles.x + i])] = n;
}

// A surfel as the columns of a tile need it: for a voxel at offset u = v + dk step, with v in the plane of its layer,
//   e^2 = (u.n)^2 along + u.u in_plane.
typedef struct {
  float3 normal, center;  // center: from the tile's first voxel [voxel]
  float2 ray;             // step = (ray, 1)
  float along, in_plane, step_n, step_step;
  float a;     // of dk^2 in e^2
  float core;  // (rho / 2)^2
  int sign_i, sign_j, sign_k;
  float3 extent;  // of the ellipsoid [voxel]
  uint layers;    // of the tile that it reaches
} Footprint;

// Sign of g_tau, 0 where the family is invalid near the surfel.
INLINE int path_sign(const ViewSurfel* s, float g, float th_d) {
  if (s->ragged != 0 || !(fabs(g) > th_d)) return 0;
  return g > 0.0f ? 1 : -1;
}

INLINE Footprint make_footprint(const Limits* limits, const ViewSurfel* s, int3 origin) {
  Footprint f;
  f.normal = (float3)(s->n_x, s->n_y, s->n_z);
  f.center = (float3)(s->i, s->j, s->k) - convert_float3(origin);
  f.ray = (float2)(s->ray_x, s->ray_y);
  f.in_plane = divided(1.0f, s->reach * s->reach);
  f.along = divided(1.0f, limits->thickness * limits->thickness) - f.in_plane;
  f.step_n = f.ray.x * f.normal.x + f.ray.y * f.normal.y + f.normal.z;
  f.step_step = f.ray.x * f.ray.x + f.ray.y * f.ray.y + 1.0f;
  f.a = f.step_n * f.step_n * f.along + f.step_step * f.in_plane;
  f.core = 0.25f * s->reach * s->reach;
  f.sign_i = path_sign(s, s->n_x, limits->th_d);
  f.sign_j = path_sign(s, s->n_y, limits->th_d);
  f.sign_k = path_sign(s, s->n_k, limits->th_d);
  f.extent = ellipsoid_extents(s, limits->thickness);
  f.layers = run_in_tile(ceil_int(f.center.z - f.extent.z), floor_int(f.center.z + f.extent.z));
  return f;
}

// The layers, clipped to first ... last, where a dk^2 + 2 b dk + c < 0; a >= 0. Empty: first > last.
INLINE int2 negative_layers(float a, float b, float c, float center, int first, int last) {
  if (a < 1e-6f) return c < 0.0f ? (int2)(first, last) : (int2)(1, 0);
  const float discriminant = b * b - a * c;
  if (discriminant <= 0.0f) return (int2)(1, 0);
  const float root = square_root(discriminant), middle = center - divided(b, a), half_length = divided(root, a);
  return (int2)(max(ceil_int(middle - half_length), first), min(floor_int(middle + half_length), last));
}

// Adds a surfel's weights to the column (i, j) of the tile, both counted from the tile's first voxel, -1 ... TILE.
INLINE void add_to_column(__local SignFieldTile* tile, __local const NeededPaths* needed, const Footprint* f, int i, int j) {
  const bool in_i = i >= 0 && i < TILE_I, in_j = j >= 0 && j < TILE_J;
  const uint paths_i = in_j ? needed->i[j] & f->layers : 0, paths_j = in_i ? needed->j[i] & f->layers : 0;
  const uint path_k = in_i && in_j ? (needed->k[i] >> j) & 1 : 0;
  if ((paths_i | paths_j | path_k) == 0) return;

  const float2 v = (float2)((float)i - f->center.x, (float)j - f->center.y);
  const float v_n = v.x * f->normal.x + v.y * f->normal.y, v_step = v.x * f->ray.x + v.y * f->ray.y, v_v = v.x * v.x + v.y * v.y;
  const float b = v_n * f->step_n * f->along + v_step * f->in_plane;
  const float c = v_n * v_n * f->along + v_v * f->in_plane;
  const int2 layers = negative_layers(f->a, b, c - 1.0f, f->center.z, -1, TILE_K);
  if (layers.x > layers.y) return;

  const bool to_i = paths_i != 0 && f->sign_i != 0, to_j = paths_j != 0 && f->sign_j != 0, to_k = path_k != 0 && f->sign_k != 0;
  __local int* row_i = tile->i + ((i + 1) * TILE_J + j) * PADDED_K + 1;
  __local int* row_j = tile->j + (i * (TILE_J + 2) + j + 1) * PADDED_K + 1;
  __local int* row_k = tile->k + (i * TILE_J + j) * PADDED_K + 1;
  for (int k = layers.x; k <= layers.y && (to_i || to_j || to_k); k += 8) {
    const int8 layer = k + (int8)(0, 1, 2, 3, 4, 5, 6, 7);
    const float8 dk = convert_float8(layer) - f->center.z;
    const float8 e = square_root(fmax(c + dk * (2.0f * b + dk * f->a), 0.0f));
    const int8 w = select((int8)(0), convert_int8(fmax(SIGN_FIELD_ONE * (1.0f - e) + 0.5f, 0.0f)), layer <= layers.y);
    if (to_i) accumulate(row_i + k, w * f->sign_i);
    if (to_j) accumulate(row_j + k, w * f->sign_j);
    if (to_k) accumulate(row_k + k, w * f->sign_k);
  }

  if (!in_i || !in_j) return;
  const int column = i * TILE_J + j;
  OR(tile->touched[column], run_in_tile(layers.x, layers.y));
  if (f->sign_i != 0 && f->sign_j != 0 && f->sign_k != 0) return;
  // |u - (u.n) n| < rho / 2
  const int2 core = negative_layers(f->step_step - f->step_n * f->step_n, v_step - v_n * f->step_n, v_v - v_n * v_n - f->core, f->center.z,
                                    layers.x, layers.y);
  const uint invalid = run_in_tile(core.x, core.y);
  if (f->sign_i == 0) OR(tile->invalid[0][column], invalid);
  if (f->sign_j == 0) OR(tile->invalid[1][column], invalid);
  if (f->sign_k == 0) OR(tile->invalid[2][column], invalid);
}

// The part of a surfel's ellipsoid that lies in the tile whose first voxel is `origin`.
INLINE void add_surfel(__local SignFieldTile* tile, __local const NeededPaths* needed, const Limits* limits, const ViewSurfel* s,
                       int3 origin) {
  const Footprint f = make_footprint(limits, s, origin);
  const int first_i = max(ceil_int(f.center.x - f.extent.x), -1), last_i = min(floor_int(f.center.x + f.extent.x), TILE_I);
  const int first_j = max(ceil_int(f.center.y - f.extent.y), -1), last_j = min(floor_int(f.center.y + f.extent.y), TILE_J);
  for (int i = first_i; i <= last_i; ++i)
    for (int j = first_j; j <= last_j; ++j) add_to_column(tile, needed, &f, i, j);
}

// Events of one family in the voxels `touched` of a column whose values start at `here`; neighbours along the paths are `stride` away.
// A maximum counts for a walk if the next value on the walk is smaller, and a minimum if it is larger. Invalid voxels have no event.
INLINE void write_events(__local const int* here, int stride, uint touched, uint invalid, int peak, __global uint* events, size_t plane) {
  uint enter_forward = 0, exit_forward = 0, enter_backward = 0, exit_backward = 0;
  for (ulong left = touched & ~invalid; left != 0; left &= left - 1) {
    const int k = lowest_bit(left);
    const int value = here[k], next = here[k + stride], previous = here[k - stride];
    const uint bit = 1u << k;
    if (value > peak) {
      if (next < value) enter_forward |= bit;
      if (previous < value) exit_backward |= bit;
    } else if (value < -peak) {
      if (next > value) exit_forward |= bit;
      if (previous > value) enter_backward |= bit;
    }
  }
  events[EVENT_ENTER_FORWARD * plane] = enter_forward;
  events[EVENT_EXIT_FORWARD * plane] = exit_forward;
  events[EVENT_ENTER_BACKWARD * plane] = enter_backward;
  events[EVENT_EXIT_BACKWARD * plane] = exit_backward;
  events[EVENT_INVALID * plane] = invalid;
}

INLINE void load_needed(__local NeededPaths* needed, const Grid* g, __global const uint* lines, int3 origin) {
  const int w = origin.z >> 6, half_word = (origin.z >> 5) & 1;
  uint any = 0;
  for (int j = 0; j < TILE_J; ++j) any |= needed->i[j] = origin.y + j < g->size_j ? lines[lines_i(g, origin.y + j, w) + half_word] : 0;
  for (int i = 0; i < TILE_I; ++i) {
    any |= needed->j[i] = origin.x + i < g->size_i ? lines[lines_j(g, origin.x + i, w) + half_word] : 0;
    uint paths = 0;
    for (int j = 0; j < TILE_J; ++j)
      if (origin.x + i < g->size_i && origin.y + j < g->size_j) paths |= lines[lines_k(g, origin.x + i, origin.y + j)] << j;
    any |= needed->k[i] = paths;
  }
  needed->any = any;
}

// One work-group handles a tile. Tiles without a path to be walked are left as they are.
//   in  lines: of 10_needed_paths;  view_surfels: of place_surfels;  tile_begin[tiles + 1]: where each tile's list starts in tile_surfels
//   out events[3][EVENT_PLANES]: bit fields, each word as two 32-bit halves, the lower one first; they are right on the paths to be walked
__kernel __attribute__((reqd_work_group_size(HEAVY_GROUP, 1, 1))) void sign_field(const Frame f, __global const uint* lines,
                                                                                  __global const ViewSurfel* view_surfels,
                                                                                  __global const uint* tile_begin,
                                                                                  __global const uint* tile_surfels,
                                                                                  __global uint* events) {
  __local SignFieldTile tile;
  __local NeededPaths needed;
  const int number = get_group_id(0), lane = get_local_id(0);
  const int3 tiles = tiles_of(&f.grid);
  const int3 origin = (int3)(number % tiles.x * TILE_I, number / tiles.x % tiles.y * TILE_J, number / tiles.x / tiles.y * TILE_K);
  if (lane == 0) load_needed(&needed, &f.grid, lines, origin);
  barrier(CLK_LOCAL_MEM_FENCE);

  const bool walked = needed.any != 0;
  if (walked) clear_tile(&tile);
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint n = tile_begin[number] + lane; walked && n < tile_begin[number + 1]; n += HEAVY_GROUP) {
    const ViewSurfel s = view_surfels[tile_surfels[n]];
    add_surfel(&tile, &needed, &f.limits, &s, origin);
  }
  barrier(CLK_LOCAL_MEM_FENCE);

  const size_t plane = 2 * (size_t)f.grid.size_i * f.grid.size_j * f.grid.words_k;
  const int peak = (int)f.limits.peak;
  for (int column = lane; walked && column < TILE_I * TILE_J; column += HEAVY_GROUP) {
    const int i = column / TILE_J, j = column % TILE_J;
    if (origin.x + i >= f.grid.size_i || origin.y + j >= f.grid.size_j) continue;
    __global uint* out = events + 2 * word_index(&f.grid, origin.x + i, origin.y + j, origin.z >> 6) + ((origin.z >> 5) & 1);
    const uint layers = (uint)bit_run(0, f.grid.size_k - origin.z);  // those that exist
    const uint touched = tile.touched[column] & layers;
    write_events(tile.i + ((i + 1) * TILE_J + j) * PADDED_K + 1, TILE_J * PADDED_K, touched, tile.invalid[0][column] & layers, peak, out,
                 plane);
    write_events(tile.j + (i * (TILE_J + 2) + j + 1) * PADDED_K + 1, PADDED_K, touched, tile.invalid[1][column] & layers, peak,
                 out + EVENT_PLANES * plane, plane);
    write_events(tile.k + column * PADDED_K + 1, 1, touched, tile.invalid[2][column] & layers, peak, out + 2 * EVENT_PLANES * plane, plane);
  }
}
