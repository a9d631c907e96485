// Where new surfels may be created - paper 3.5, eq. (13): unobserved voxels beside observed ones that no surfel has taken.
// Whether they are known is asked of the recent views first, and of the surfels only where those leave it open.

// Candidates are handled LANES at once, as vectors. Comparisons of vectors give -1 where they hold, 0 elsewhere.

INLINE int16 lane_numbers(void) { return (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15); }

// Bit n is lane n's, -1 or 0.
INLINE uint lane_bits(int16 marks) {
  const int16 bits = marks & ((int16)(1) << lane_numbers());
  const int8 of_8 = bits.lo | bits.hi;
  const int4 of_4 = of_8.lo | of_8.hi;
  const int2 of_2 = of_4.lo | of_4.hi;
  return (uint)(of_2.x | of_2.y);
}

#define GATHER(values, at)                                                                                                               \
  values[at.s0], values[at.s1], values[at.s2], values[at.s3], values[at.s4], values[at.s5], values[at.s6], values[at.s7], values[at.s8], \
      values[at.s9], values[at.sa], values[at.sb], values[at.sc], values[at.sd], values[at.se], values[at.sf]

INLINE float16 gather(__global const float* values, int16 at) { return (float16)(GATHER(values, at)); }

// view_knows_eight of 2_observed_space, of sixteen points, for those lanes that are asked.
INLINE int16 knows(const View* view, __global const float* depths, float16 x, float16 y, float16 z, int16 asked) {
  const float16 s = x * view->fx / z + view->cx + 0.5f, t = y * view->fy / z + view->cy + 0.5f;
  const int16 seen = asked & (z > 0.0f) & (s >= 0.0f) & (t >= 0.0f) & (s < (float)view->width) & (t < (float)view->height);
  if (lane_bits(seen) == 0) return 0;
  const int16 pixel = seen ? convert_int16(t) * view->width + convert_int16(s) : 0;
  return seen & (z < fabs(gather(depths + view->first_pixel, pixel)));
}

INLINE int16 gather_int(__global const int* values, int16 at) { return (int16)(GATHER(values, at)); }

typedef struct {
  float16 x, y, z;
} Points;

typedef struct {
  int16 i, j, k;
} Voxels;

INLINE Points add_scaled(Points p, float16 scale, Points direction) {
  return (Points){p.x + scale * direction.x, p.y + scale * direction.y, p.z + scale * direction.z};
}

INLINE float16 lengths(Points p) { return sqrt(p.x * p.x + p.y * p.y + p.z * p.z); }

INLINE Points normalized(Points p) {
  const float16 scale = 1.0f / lengths(p);
  return (Points){scale * p.x, scale * p.y, scale * p.z};
}

// a / b for a >= 0, b > 0; there is no instruction for vectors of whole numbers.
INLINE int16 quotients(int16 a, int b) {
  const float inverse = 1.0f / (float)b;
  int16 q = convert_int16(convert_float16(a) * inverse);
  q += convert_int16(convert_float16(a - q * b) * inverse);  // what float has lost
  const int16 rest = a - q * b;
  return q + (rest < 0) - (rest >= b);
}

// Voxels by their numbers, 64 word + bit.
INLINE Voxels voxels_of(const Grid* g, int16 numbers) {
  const int16 words = numbers >> 6, rows = quotients(words, g->size_i);
  Voxels v;
  v.i = words - rows * g->size_i;
  v.j = quotients(rows, g->words_k);
  v.k = 64 * (rows - v.j * g->words_k) + (numbers & 63);
  return v;
}

// F^-1 of voxels' centres.
INLINE Points voxel_centers(const Grid* g, __global const float* layer_depth, Voxels v) {
  Points p;
  p.z = gather(layer_depth, clamp(v.k, 0, g->size_k - 1));
  const float16 width = convert_float16(v.k) < g->k_min ? g->z_min : p.z;
  p.x = (convert_float16(v.i) - g->center_i) * width / g->fx;
  p.y = (convert_float16(v.j) - g->center_j) * width / g->fy;
  return p;
}

// The observed ones of the 27 voxels around v: bit 9 (dk + 1) + 3 (dj + 1) + di + 1.
INLINE int observed_around(const Grid* g, __global const ulong* observed, int i, int j, int k) {
  const int w = k >> 6, bit = k & 63;
  int around = 0;
  for (int n = 0; n < 9; ++n) {
    const int u = i + n % 3 - 1, v = j + n / 3 - 1;
    if (u < 0 || v < 0 || u >= g->size_i || v >= g->size_j) continue;
    const int at = word_index(g, u, v, w);
    ulong three = bit == 0 ? observed[at] << 1 : observed[at] >> (bit - 1);
    if (bit == 0 && w > 0) three |= observed[at - g->size_i] >> 63;
    if (bit == 63 && w + 1 < g->words_k) three |= observed[at + g->size_i] << 2;
    around |= ((int)(three & 1) | (int)(three & 2) << 8 | (int)(three & 4) << 16) << n;
  }
  return around;
}

// The listed candidates of a chunk: their numbers, of the last ones over and over behind the end; -1 in `exist` for those before it.
INLINE int16 load_chunk(__global const int* list, int count, int chunk, int16* exist) {
  const int16 n = chunk * LANES + lane_numbers();
  *exist = n < count;
  return gather_int(list, min(n, count - 1));
}

// One work item a chunk of LANES listed candidates.
//   in  voxels[count]: 64 word + bit of each candidate;  observed: C~
//   out around[LANES chunks]: its observed_around;  directions[chunks][3][LANES]: normal of a surfel there, camera frame, not normalised:
//       the sum of the directions to the observed ones of the 26 voxels around it
__kernel void find_directions(const Grid g, __global const float* layer_depth, __global const ulong* observed, __global const int* voxels,
                              const int count, __global int* around, __global float* directions) {
  const int chunk = get_global_id(0);
  if (chunk * LANES >= count) return;
  int16 exist;
  const Voxels v = voxels_of(&g, load_chunk(voxels, count, chunk, &exist));
  int i[LANES], j[LANES], k[LANES], found[LANES];
  vstore16(v.i, 0, i);
  vstore16(v.j, 0, j);
  vstore16(v.k, 0, k);
  for (int n = 0; n < LANES; ++n) found[n] = observed_around(&g, observed, i[n], j[n], k[n]);
  const int16 bits = vload16(0, found);
  vstore16(bits, chunk, around);

  const Points center = voxel_centers(&g, layer_depth, v);
  Points sum = {0.0f, 0.0f, 0.0f};
  for (int n = 0; n < 27; ++n) {
    const int16 is_set = (bits & 1 << n) != 0;
    if (lane_bits(is_set) == 0) continue;
    const Points u = voxel_centers(&g, layer_depth, (Voxels){v.i + n % 3 - 1, v.j + n / 3 % 3 - 1, v.k + n / 9 - 1});
    const Points direction = {u.x - center.x, u.y - center.y, u.z - center.z};
    const float16 distance = lengths(direction);
    sum.x += is_set ? direction.x / distance : 0.0f;
    sum.y += is_set ? direction.y / distance : 0.0f;
    sum.z += is_set ? direction.z / distance : 0.0f;
  }
  vstore16(sum.x, 3 * chunk, directions);
  vstore16(sum.y, 3 * chunk + 1, directions);
  vstore16(sum.z, 3 * chunk + 2, directions);
}

// One work item a word, dimensions i, w and j.
//   in  observed: C~;  occupied_voxels: those of surviving surfels;   out candidates
__kernel void find_candidates(const Grid g, __global const ulong* observed, __global const ulong* occupied_voxels,
                              __global ulong* candidates) {
  const int i = get_global_id(0), w = get_global_id(1), j = get_global_id(2);
  if (i >= g.size_i) return;
  const int word = word_index(&g, i, j, w);
  const ulong here = observed[word];
  ulong beside = (here << 1) | (here >> 1);
  if (w > 0) beside |= observed[word_index(&g, i, j, w - 1)] >> 63;
  if (w + 1 < g.words_k) beside |= observed[word_index(&g, i, j, w + 1)] << 63;
  if (i > 0) beside |= observed[word - 1];
  if (i + 1 < g.size_i) beside |= observed[word + 1];
  if (j > 0) beside |= observed[word_index(&g, i, j - 1, w)];
  if (j + 1 < g.size_j) beside |= observed[word_index(&g, i, j + 1, w)];
  candidates[word] = beside & ~here & ~occupied_voxels[word] & valid_layers(&g, w);
}
