// LANES points, surfels or candidates at once, as vectors. Comparisons of vectors give -1 where they hold, 0 elsewhere.

INLINE int16 lane_numbers(void) { return (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15); }

// Bit n is lane n's, -1 or 0.
INLINE uint lane_bits(int16 marks) {
  const int16 bits = marks & ((int16)(1) << lane_numbers());
  const int8 of_8 = bits.lo | bits.hi;
  const int4 of_4 = of_8.lo | of_8.hi;
  const int2 of_2 = of_4.lo | of_4.hi;
  return (uint)(of_2.x | of_2.y);
}

// The other way round.
INLINE int16 lane_marks(uint bits) { return -(((int16)((int)bits) >> lane_numbers()) & 1); }

#define GATHER(values, at)                                                                                                               \
  values[at.s0], values[at.s1], values[at.s2], values[at.s3], values[at.s4], values[at.s5], values[at.s6], values[at.s7], values[at.s8], \
      values[at.s9], values[at.sa], values[at.sb], values[at.sc], values[at.sd], values[at.se], values[at.sf]

INLINE float16 gather(__global const float* values, int16 at) { return (float16)(GATHER(values, at)); }
INLINE int16 gather_int(__global const int* values, int16 at) { return (int16)(GATHER(values, at)); }

typedef struct {
  float16 x, y, z;
} Points;

typedef struct {
  int16 i, j, k;
} Voxels;

INLINE Points rotate_points(const Transform* T, Points p) {
  return (Points){fma(p.x, T->r00, fma(p.y, T->r01, p.z * T->r02)), fma(p.x, T->r10, fma(p.y, T->r11, p.z * T->r12)),
                  fma(p.x, T->r20, fma(p.y, T->r21, p.z * T->r22))};
}

INLINE Points transform_points(const Transform* T, Points p) {
  return (Points){fma(p.x, T->r00, fma(p.y, T->r01, fma(p.z, T->r02, T->t0))), fma(p.x, T->r10, fma(p.y, T->r11, fma(p.z, T->r12, T->t1))),
                  fma(p.x, T->r20, fma(p.y, T->r21, fma(p.z, T->r22, T->t2)))};
}

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

INLINE float16 voxel_sizes(const Grid* g, float16 z) { return fmax(z, g->z_min) / g->f; }

// Grid coordinates along k of points at depths z.
INLINE float16 layers_at(const Grid* g, float16 z) {
  return z < g->z_min ? z / g->delta_min + (float)g->padding_k : g->f * natural_log16(fmax(z, g->z_min) / g->z_min) + g->k_min;
}

// The voxels that points of the camera's frame lie in: F, rounded.
INLINE Voxels voxels_at(const Grid* g, Points p) {
  const float16 depth = fmax(p.z, g->z_min);
  return (Voxels){floor_int16(p.x * g->fx / depth + g->center_i + 0.5f), floor_int16(p.y * g->fy / depth + g->center_j + 0.5f),
                  floor_int16(layers_at(g, p.z) + 0.5f)};
}

INLINE int16 inside_grid16(const Grid* g, Voxels v) {
  return (v.i >= 0) & (v.j >= 0) & (v.k >= 0) & (v.i < g->size_i) & (v.j < g->size_j) & (v.k < g->size_k);
}

// Where voxels are in bit fields, as numbers of 32-bit halves: in word_index's order, and in tile_word_index's; and their bits there.
INLINE int16 voxel_halves(const Grid* g, Voxels v) { return 2 * ((v.j * g->words_k + (v.k >> 6)) * g->size_i + v.i) + ((v.k >> 5) & 1); }
INLINE int16 candidate_halves(const Grid* g, Voxels v) {
  const int16 tile = (v.j / VIEW_TILE * g->words_k + (v.k >> 6)) * grid_tiles(g->size_i) + v.i / VIEW_TILE;
  return 2 * (tile * TILE_COLUMNS + v.j % VIEW_TILE * VIEW_TILE + v.i % VIEW_TILE) + ((v.k >> 5) & 1);
}
INLINE int16 half_bits(int16 k) { return (int16)(1) << (k & 31); }

INLINE int16 same_voxels(Voxels a, Voxels b) { return (a.i == b.i) & (a.j == b.j) & (a.k == b.k); }

// A row of the grid's voxels, and of the working image's pixels, has so many chunks of LANES, and words of 32.
INLINE int grid_chunks(int size) { return (size + LANES - 1) / LANES; }
INLINE int image_words(const Grid* g) { return (g->width + 31) / 32; }

// Stores words of LANES columns from i, those that exist.
INLINE void store_words(ulong16 words, const Grid* g, int i, __global ulong* field) {
  if (i + LANES <= g->size_i) {
    vstore16(words, 0, field);
    return;
  }
  ulong some[LANES];
  vstore16(words, 0, some);
  for (int n = 0; i + n < g->size_i; ++n) field[n] = some[n];
}
