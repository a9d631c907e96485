// Inner product sign field D - supplement B - and the events that the sweeps will meet - Algorithm 1.
//
// For a voxel at offset u (locally metric voxel coordinates) from a surfel with normal n, reach rho and thickness t:
//   e^2 = (u.n)^2 / t^2 + |u - (u.n) n|^2 / rho^2,  weight w = 1 - e where e < 1;  g_tau = <n, t_tau>
//   |g_tau| > th_d: D_tau += sign(g_tau) w;   else, where e < 1 and |u - (u.n) n| < rho / 2: the voxel is invalid for family tau.
// One work-group does one tile in local memory: integers, so the order of surfels and the number of work items do not matter.

#ifndef SIGN_FIELD_GROUP
#define SIGN_FIELD_GROUP 64  // 1 on a CPU: no atomics then
#endif

#define PADDED_K (TILE_K + 2)

// The sign field of a tile, each family with one voxel more before and behind along its own paths.
typedef struct {
  int i[(TILE_I + 2) * TILE_J * PADDED_K];
  int j[TILE_I * (TILE_J + 2) * PADDED_K];
  int k[TILE_I * TILE_J * PADDED_K];
  uint touched[TILE_I * TILE_J];      // bits along k that a surfel reached
  uint invalid[3][TILE_I * TILE_J];
} SignFieldTile;

#if SIGN_FIELD_GROUP == 1
#define ADD(target, value) ((target) += (value))
#define OR(target, value) ((target) |= (value))
#else
#define ADD(target, value) atomic_add(&(target), (value))
#define OR(target, value) atomic_or(&(target), (value))
#endif

// First and last tile, along each axis, that a surfel's ellipsoid (and one voxel around it) touches. False: none.
bool tile_range(const Grid* g, const Limits* limits, const ViewSurfel* s, int3* first, int3* last) {
  const float3 c = (float3)(s->i, s->j, s->k), extent = ellipsoid_extents(s, limits->thickness);
  const int3 low = convert_int3_rtp(c - extent) - 1, high = convert_int3_rtn(c + extent) + 1;
  const int3 size = (int3)(g->size_i, g->size_j, g->size_k), tile = (int3)(TILE_I, TILE_J, TILE_K);
  if (any(high < 0) || any(low >= size)) return false;
  *first = max(low, 0) / tile;
  *last = min(high, size - 1) / tile;
  return true;
}

// Tiles along each axis; along k they fill whole words.
int3 tiles_of(const Grid* g) { return (int3)((g->size_i - 1) / TILE_I + 1, (g->size_j - 1) / TILE_J + 1, g->words_k * (64 / TILE_K)); }

// One work item a surfel in view: how many surfels touch each tile; tile (i, j, k) is number (k * tiles_j + j) * tiles_i + i.
//   i/o tile_counts[tiles], zero before
__kernel void count_tiles(const Grid g, const Limits limits, __global const ViewSurfel* view_surfels, const uint count,
                          __global uint* tile_counts) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const ViewSurfel s = view_surfels[n];
  const int3 tiles = tiles_of(&g);
  int3 first, last;
  if (!tile_range(&g, &limits, &s, &first, &last)) return;
  for (int k = first.z; k <= last.z; ++k)
    for (int j = first.y; j <= last.y; ++j)
      for (int i = first.x; i <= last.x; ++i) atomic_inc(&tile_counts[(k * tiles.y + j) * tiles.x + i]);
}

// One work item a surfel in view: the surfels of each tile, in any order.
//   i/o tile_cursor[tiles]: where the tile's list begins before, where it ends after
//   out tile_surfels: indices into view_surfels
__kernel void fill_tiles(const Grid g, const Limits limits, __global const ViewSurfel* view_surfels, const uint count,
                         __global uint* tile_cursor, __global uint* tile_surfels) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const ViewSurfel s = view_surfels[n];
  const int3 tiles = tiles_of(&g);
  int3 first, last;
  if (!tile_range(&g, &limits, &s, &first, &last)) return;
  for (int k = first.z; k <= last.z; ++k)
    for (int j = first.y; j <= last.y; ++j)
      for (int i = first.x; i <= last.x; ++i) tile_surfels[atomic_inc(&tile_cursor[(k * tiles.y + j) * tiles.x + i])] = n;
}

// Adds a surfel's weights to the column (i, j) of the tile, both counted from the tile's first voxel, -1 ... TILE.
//   along_k: (u.n)^2 and |u|^2 are quadratic along the column, so e^2 = a dk^2 + 2 b dk + c
void add_to_column(__local SignFieldTile* tile, const Limits* limits, const ViewSurfel* s, int i, int j, float3 offset) {
  const float3 n = (float3)(s->n_x, s->n_y, s->n_z), step = (float3)(s->ray_x, s->ray_y, 1.0f);
  const float in_plane = 1.0f / (s->reach * s->reach), along = 1.0f / (limits->thickness * limits->thickness) - in_plane;
  const float3 u = (float3)(offset.x, offset.y, 0.0f);
  const float u_n = dot(u, n), step_n = dot(step, n), u_u = dot(u, u), u_step = dot(u, step), step_step = dot(step, step);
  const float a = step_n * step_n * along + step_step * in_plane;
  const float b = u_n * step_n * along + u_step * in_plane;
  const float c = u_n * u_n * along + u_u * in_plane;
  const float discriminant = b * b - a * (c - 1.0f);
  if (discriminant <= 0.0f) return;
  const float root = sqrt(discriminant);
  const int first = max(convert_int_rtp(offset.z + (-b - root) / a), -1), last = min(convert_int_rtn(offset.z + (-b + root) / a), TILE_K);
  if (first > last) return;

  const bool in_i = i >= 0 && i < TILE_I, in_j = j >= 0 && j < TILE_J;
  const int sign_i = fabs(s->n_x) > limits->th_d ? (s->n_x > 0.0f ? 1 : -1) : 0;
  const int sign_j = fabs(s->n_y) > limits->th_d ? (s->n_y > 0.0f ? 1 : -1) : 0;
  const int sign_k = fabs(s->n_k) > limits->th_d ? (s->n_k > 0.0f ? 1 : -1) : 0;
  const int row_i = in_j ? ((i + 1) * TILE_J + j) * PADDED_K + 1 : -1;
  const int row_j = in_i ? (i * (TILE_J + 2) + j + 1) * PADDED_K + 1 : -1;
  const int row_k = in_i && in_j ? (i * TILE_J + j) * PADDED_K + 1 : -1;
  for (int k = first; k <= last; ++k) {
    const float dk = (float)k - offset.z;
    const int w = convert_int_rte(SIGN_FIELD_ONE * (1.0f - sqrt(fmax(c + dk * (2.0f * b + dk * a), 0.0f))));
    if (row_i >= 0 && sign_i != 0) ADD(tile->i[row_i + k], sign_i * w);
    if (row_j >= 0 && sign_j != 0) ADD(tile->j[row_j + k], sign_j * w);
    if (row_k >= 0 && sign_k != 0) ADD(tile->k[row_k + k], sign_k * w);
  }

  if (row_k < 0) return;
  const int column = i * TILE_J + j;
  OR(tile->touched[column], (uint)(bit_run(first, last + 1) & 0xffffffff));
  if (sign_i != 0 && sign_j != 0 && sign_k != 0) return;
  uint core = 0;  // voxels within rho / 2 of the surfel's axis
  for (int k = max(first, 0); k <= min(last, TILE_K - 1); ++k) {
    const float dk = (float)k - offset.z, normal_part = u_n + dk * step_n;
    const float in_plane_2 = u_u + dk * (2.0f * u_step + dk * step_step) - normal_part * normal_part;
    if (in_plane_2 < 0.25f * s->reach * s->reach) core |= 1u << k;
  }
  if (sign_i == 0) OR(tile->invalid[0][column], core);
  if (sign_j == 0) OR(tile->invalid[1][column], core);
  if (sign_k == 0) OR(tile->invalid[2][column], core);
}

// The part of a surfel's ellipsoid that lies in the tile whose first voxel is `origin`.
void add_surfel(__local SignFieldTile* tile, const Limits* limits, const ViewSurfel* s, int3 origin) {
  const float3 c = (float3)(s->i, s->j, s->k) - convert_float3(origin), extent = ellipsoid_extents(s, limits->thickness);
  const int3 low = max(convert_int3_rtp(c - extent), -1), high = convert_int3_rtn(c + extent);
  const int high_i = min(high.x, TILE_I), high_j = min(high.y, TILE_J);
  for (int i = low.x; i <= high_i; ++i) {
    const bool edge_i = i < 0 || i == TILE_I;
    for (int j = low.y; j <= high_j; ++j) {
      if (edge_i && (j < 0 || j == TILE_J)) continue;  // no family needs the corners
      add_to_column(tile, limits, s, i, j, (float3)((float)i - c.x, (float)j - c.y, c.z));
    }
  }
}

// Events of one family in the voxels `touched` of a column whose values start at `here`; neighbours along the paths are `stride` away.
// An extreme counts from the side it is walked from: its next value falls (rises). No event where the voxel is invalid.
void write_events(__local const int* here, int stride, uint touched, uint invalid, int peak, __global uint* events, size_t plane) {
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

// One work-group a tile.
//   in  tile_begin[tiles + 1]: where each tile's list starts in tile_surfels
//   out events[3][EVENT_PLANES]: bit fields, each word as two 32-bit halves, the lower one first
__kernel __attribute__((reqd_work_group_size(SIGN_FIELD_GROUP, 1, 1))) void sign_field(const Grid g, const Limits limits,
                                                                                       __global const ViewSurfel* view_surfels,
                                                                                       __global const uint* tile_begin,
                                                                                       __global const uint* tile_surfels,
                                                                                       __global uint* events) {
  __local SignFieldTile tile;
  const int number = get_group_id(0), lane = get_local_id(0);
  const int3 tiles = tiles_of(&g);
  const int3 origin =
      (int3)(number % tiles.x * TILE_I, number / tiles.x % tiles.y * TILE_J, number / tiles.x / tiles.y * TILE_K);
  const uint begin = tile_begin[number], end = tile_begin[number + 1];

  if (begin < end) {
    __local int* all = (__local int*)&tile;
    for (int n = lane; n < (int)(sizeof(SignFieldTile) / sizeof(int)); n += SIGN_FIELD_GROUP) all[n] = 0;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint n = begin + lane; n < end; n += SIGN_FIELD_GROUP) {
    const ViewSurfel s = view_surfels[tile_surfels[n]];
    add_surfel(&tile, &limits, &s, origin);
  }
  barrier(CLK_LOCAL_MEM_FENCE);

  const size_t plane = 2 * (size_t)g.size_i * g.size_j * g.words_k;
  const int peak = (int)limits.peak;
  for (int column = lane; column < TILE_I * TILE_J; column += SIGN_FIELD_GROUP) {
    const int i = column / TILE_J, j = column % TILE_J;
    if (origin.x + i >= g.size_i || origin.y + j >= g.size_j) continue;
    __global uint* out = events + 2 * word_index(&g, origin.x + i, origin.y + j, origin.z >> 6) + ((origin.z >> 5) & 1);
    if (begin == end) {
      for (int p = 0; p < 3 * EVENT_PLANES; ++p) out[p * plane] = 0;
      continue;
    }
    const uint touched = tile.touched[column] & (uint)bit_run(0, g.size_k - origin.z);
    write_events(tile.i + ((i + 1) * TILE_J + j) * PADDED_K + 1, TILE_J * PADDED_K, touched, tile.invalid[0][column], peak, out, plane);
    write_events(tile.j + (i * (TILE_J + 2) + j + 1) * PADDED_K + 1, PADDED_K, touched, tile.invalid[1][column], peak,
                 out + EVENT_PLANES * plane, plane);
    write_events(tile.k + column * PADDED_K + 1, 1, touched, tile.invalid[2][column], peak, out + 2 * EVENT_PLANES * plane, plane);
  }
}
