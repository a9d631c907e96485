// Arithmetic that gives the same bits on every device.
//
// OpenCL fixes + - * fma() and conversions, but lets the quotient of two floats be wrong by 2.5 units of its last place, sqrt() by 3, and
// all other functions by what a driver likes. What decides about the map is therefore written with + - * fma(), divided() and square_root()
// alone, in a fixed order, without contraction (common/lanes.cl). Bounds that have a slack, like those of boxes in views, may divide
// plainly. No value that decides is denormal, so devices that flush these to zero do the same; what NaN or infinity become as whole numbers
// is never used.
//
// OWN_DIVISION is set for devices that do not round quotients and roots correctly themselves.

// From a quotient or a root that is wrong by some units of the last place, the correctly rounded one. A step with the exact rest makes it
// wrong by less than one unit, and then the neighbour on the other side of the true value is taken if it is nearer. These rests are exact,
// because fma() rounds once and they fit into a float.
#define DEFINE_NEAREST(FLOATS, INTS, AS_INTS, AS_FLOATS)                                     \
  INLINE FLOATS OVERLOADED nearest_quotient(FLOATS rough, FLOATS a, FLOATS b) {              \
    const FLOATS q = fma(fma(-rough, b, a), 1.0f / b, rough), rest = fma(-q, b, a);          \
    const INTS outwards = (rest < 0.0f) == (a < 0.0f) ? (INTS)(1) : (INTS)(-1);              \
    const FLOATS other = AS_FLOATS(AS_INTS(q) + outwards), other_rest = fma(-other, b, a);   \
    return fabs(rough) < INFINITY ? (fabs(other_rest) < fabs(rest) ? other : q) : rough;     \
  }                                                                                          \
  INLINE FLOATS OVERLOADED nearest_root(FLOATS rough, FLOATS x) {                            \
    const FLOATS root = fma(fma(-rough, rough, x), 0.5f / rough, rough);                     \
    const FLOATS below = AS_FLOATS(AS_INTS(root) - 1), above = AS_FLOATS(AS_INTS(root) + 1); \
    const FLOATS lower = fma(-root, below, x) > 0.0f ? root : below;                         \
    return x > 0.0f && x < INFINITY ? (fma(-root, above, x) > 0.0f ? above : lower) : rough; \
  }
DEFINE_NEAREST(float, int, as_int, as_float)
DEFINE_NEAREST(float3, int3, as_int3, as_float3)
DEFINE_NEAREST(float8, int8, as_int8, as_float8)
#if LANES == 16
DEFINE_NEAREST(float16, int16, as_int16, as_float16)
#endif

#ifdef OWN_DIVISION
#define divided(a, b) nearest_quotient((a) / (b), (__typeof__((a) / (b)))(a), (__typeof__((a) / (b)))(b))
#define square_root(x) nearest_root(sqrt(x), x)
#else
#define divided(a, b) ((a) / (b))
#define square_root(x) sqrt(x)
#endif

// ln x for normal x > 0, within 2e-7; unlike log() it is the same on every device. x = 2^e m with m around 1, and
// ln m = 2 artanh((m - 1) / (m + 1)).
INLINE floatv natural_log(floatv x) {
  const floatv m = as_floatv(((as_intv(x) - 0x3f3504f3) & 0x007fffff) + 0x3f3504f3);
  const floatv exponent = convert_floatv((as_intv(x) - 0x3f3504f3) >> 23), s = divided(m - 1.0f, m + 1.0f), q = s * s;
  return exponent * 0.69314718f + s * (2.0f + q * (0.66666667f + q * (0.4f + q * (0.28571429f + q * 0.22222222f))));
}

// LANES points or directions.
typedef struct {
  floatv x, y, z;
} Points;

INLINE Points rotated(const Transform* T, Points p) {
  return (Points){fma(p.x, T->r00, fma(p.y, T->r01, p.z * T->r02)), fma(p.x, T->r10, fma(p.y, T->r11, p.z * T->r12)),
                  fma(p.x, T->r20, fma(p.y, T->r21, p.z * T->r22))};
}

INLINE Points transformed(const Transform* T, Points p) {
  return (Points){fma(p.x, T->r00, fma(p.y, T->r01, fma(p.z, T->r02, T->t0))), fma(p.x, T->r10, fma(p.y, T->r11, fma(p.z, T->r12, T->t1))),
                  fma(p.x, T->r20, fma(p.y, T->r21, fma(p.z, T->r22, T->t2)))};
}

INLINE Points scaled(floatv scale, Points p) { return (Points){scale * p.x, scale * p.y, scale * p.z}; }

INLINE Points add_scaled(Points p, floatv scale, Points direction) {
  return (Points){p.x + scale * direction.x, p.y + scale * direction.y, p.z + scale * direction.z};
}

INLINE floatv dot_products(Points a, Points b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

INLINE Points cross_products(Points a, Points b) { return (Points){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

INLINE floatv lengths(Points p) { return square_root(dot_products(p, p)); }

INLINE Points normalized(Points p) { return scaled(divided(1.0f, lengths(p)), p); }

// Tells whether the device computes as it must. One work item handles LANES triples of numbers.
//   in  a, b, c[LANES chunks];   out results[CHECKED_OPERATIONS][LANES chunks], in the order of src/stages/arithmetic_check.cpp
__kernel void check_arithmetic(__global const float* a, __global const float* b, __global const float* c, const int chunks,
                               __global float* results) {
  const int chunk = get_global_id(0);
  if (chunk >= chunks) return;
  const floatv x = vloadv(chunk, a), y = vloadv(chunk, b), z = vloadv(chunk, c);
  vstorev(x * y + z, chunk, results);
  vstorev(dot_products((Points){x, y, z}, (Points){y, z, x}), chunks + chunk, results);
  vstorev(fma(x, y, z), 2 * chunks + chunk, results);
  vstorev(divided(x, y), 3 * chunks + chunk, results);
  vstorev(divided(1.0f, y), 4 * chunks + chunk, results);
  vstorev(square_root(fabs(x)), 5 * chunks + chunk, results);
  vstorev(convert_floatv(floor_int(x)), 6 * chunks + chunk, results);
  vstorev(convert_floatv(ceil_int(x)), 7 * chunks + chunk, results);
}
