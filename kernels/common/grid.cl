// Non-uniform voxel grid (NUVG) - paper 3.1, eq. (2)-(3), supplement A - and the layout of its bit fields.
//
// A bit field has one bit a voxel. Bits run along k in 64-bit words; neighbouring words are neighbours along i:
//   word(i, j, w) = (j * words_k + w) * size_i + i,   bit k % 64 of word k / 64.

#pragma OPENCL FP_CONTRACT OFF

// Asks for the 64 bytes at an address ahead of their use. OpenCL's own prefetch() does nothing in PoCL.
#if defined(ON_CPU) && defined(POCL_DEVICE_ADDRESS_BITS) && defined(__has_builtin)
#if __has_builtin(__builtin_prefetch)
#define PREFETCH(address) __builtin_prefetch((const void*)(uintptr_t)(address))
#endif
#endif
#ifndef PREFETCH
#define PREFETCH(address) prefetch((__global const uint16*)(address), 1)
#endif

#define INLINE static inline __attribute__((always_inline))

INLINE float voxel_size(const Grid* g, float z) { return fmax(z, g->z_min) / g->f; }

// Rounding to whole numbers of either sign; a device without an instruction for ceil and floor does these much faster.
INLINE int ceil_int(float x) {
  const int below = (int)x;
  return below + ((float)below < x ? 1 : 0);
}
INLINE int floor_int(float x) {
  const int above = (int)x;
  return above - ((float)above > x ? 1 : 0);
}

INLINE int16 floor_int16(float16 x) {
  const int16 above = convert_int16(x);
  return above + (convert_float16(above) > x);
}

// ln x for normal x > 0, within 2e-7; unlike log() the same on every device. x = 2^e m, m around 1: ln m = 2 artanh((m - 1) / (m + 1)).
#define DEFINE_NATURAL_LOG(NAME, FLOAT, AS_INT, AS_FLOAT, TO_FLOAT)                                                    \
  INLINE FLOAT NAME(FLOAT x) {                                                                                         \
    const FLOAT m = AS_FLOAT(((AS_INT(x) - 0x3f3504f3) & 0x007fffff) + 0x3f3504f3);                                    \
    const FLOAT exponent = TO_FLOAT((AS_INT(x) - 0x3f3504f3) >> 23), s = (m - 1.0f) / (m + 1.0f), q = s * s;           \
    return exponent * 0.69314718f + s * (2.0f + q * (0.66666667f + q * (0.4f + q * (0.28571429f + q * 0.22222222f)))); \
  }
DEFINE_NATURAL_LOG(natural_log, float, as_int, as_float, (float))
DEFINE_NATURAL_LOG(natural_log16, float16, as_int16, as_float16, convert_float16)

// F: camera frame [m] -> grid coordinates. Defined, and continuous, beyond the grid as well.
INLINE float3 to_grid(const Grid* g, float3 p) {
  if (p.z < g->z_min) {
    return (float3)(p.x * g->fx / g->z_min + g->center_i, p.y * g->fy / g->z_min + g->center_j, p.z / g->delta_min + (float)g->padding_k);
  }
  return (float3)(p.x * g->fx / p.z + g->center_i, p.y * g->fy / p.z + g->center_j, g->f * natural_log(p.z / g->z_min) + g->k_min);
}

// F^-1: grid coordinates -> camera frame [m].
INLINE float3 from_grid(const Grid* g, float3 c) {
  if (c.z < g->k_min) {
    return (float3)((c.x - g->center_i) * g->z_min / g->fx, (c.y - g->center_j) * g->z_min / g->fy,
                    (c.z - (float)g->padding_k) * g->delta_min);
  }
  const float z = g->z_min * exp((c.z - g->k_min) / g->f);
  return (float3)((c.x - g->center_i) * z / g->fx, (c.y - g->center_j) * z / g->fy, z);
}

INLINE int3 voxel_of(float3 c) { return (int3)(floor_int(c.x + 0.5f), floor_int(c.y + 0.5f), floor_int(c.z + 0.5f)); }

INLINE bool inside_grid(const Grid* g, int3 v) {
  return v.x >= 0 && v.y >= 0 && v.z >= 0 && v.x < g->size_i && v.y < g->size_j && v.z < g->size_k;
}

INLINE int word_index(const Grid* g, int i, int j, int w) { return (j * g->words_k + w) * g->size_i + i; }

// Words of candidates lie tile by tile of VIEW_TILE x VIEW_TILE columns, which are asked for, and listed, together; columns beyond the grid
// have words, too, without a candidate.
#define TILE_COLUMNS (VIEW_TILE * VIEW_TILE)

INLINE int grid_tiles(int size) { return (size + VIEW_TILE - 1) / VIEW_TILE; }
INLINE int tile_word_index(const Grid* g, int i, int j, int w) {
  return ((j / VIEW_TILE * g->words_k + w) * grid_tiles(g->size_i) + i / VIEW_TILE) * TILE_COLUMNS + j % VIEW_TILE * VIEW_TILE +
         i % VIEW_TILE;
}

INLINE bool test_bit(const Grid* g, __global const ulong* field, int3 v) {
  return (field[word_index(g, v.x, v.y, v.z >> 6)] >> (v.z & 63)) & 1;
}

// Bits [from, to) of a word; both are clamped to 0..64.
INLINE ulong bit_run(int from, int to) {
  from = clamp(from, 0, 64);
  to = clamp(to, 0, 64);
  if (from >= to) return 0;
  const ulong below_to = to == 64 ? ~0ul : (1ul << to) - 1;
  return below_to & ~((1ul << from) - 1);  // from < to <= 64, so the shift is defined
}

INLINE int lowest_bit(ulong bits) { return 63 - (int)clz(bits & -bits); }

// The same of fewer bits, a lane each of a vector.
INLINE int lowest_lane(uint bits) { return 31 - (int)clz(bits & -bits); }

INLINE int highest_bit(ulong bits) { return 63 - (int)clz(bits); }

// Bits of the word's layers that exist; the last word may have fewer than 64.
INLINE ulong valid_layers(const Grid* g, int w) { return bit_run(0, g->size_k - 64 * w); }

INLINE float3 rotate(const Transform* T, float3 v) {
  return (float3)(fma(v.x, T->r00, fma(v.y, T->r01, v.z * T->r02)), fma(v.x, T->r10, fma(v.y, T->r11, v.z * T->r12)),
                  fma(v.x, T->r20, fma(v.y, T->r21, v.z * T->r22)));
}

INLINE float3 transform_point(const Transform* T, float3 p) {
  return (float3)(fma(p.x, T->r00, fma(p.y, T->r01, fma(p.z, T->r02, T->t0))), fma(p.x, T->r10, fma(p.y, T->r11, fma(p.z, T->r12, T->t1))),
                  fma(p.x, T->r20, fma(p.y, T->r21, fma(p.z, T->r22, T->t2))));
}
