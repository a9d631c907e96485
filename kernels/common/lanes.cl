// LANES points at once: one source for two widths.
//
// A work item handles LANES points, surfels, voxels or views. LANES is set when the program is built: 16 on a CPU with PoCL, which uses its
// vectors that way, and 1 on other devices, which have a work item for each point. So are HEAVY_GROUP and TILE_GROUP, the numbers of work
// items in groups of the kernels with much work per item, and VIEW_TEAM (src/opencl/work_shape.hpp). floatv, intv, uintv and ulongv hold
// one number for each of the LANES: they are vectors of 16, or plain numbers. convert_..., as_..., vloadv and vstorev do for them what
// OpenCL's functions do for its types. Only this file depends on the width.
//
// A mark says yes or no for each lane: an intv whose lanes are -1 or 0. Marks are joined by & | ~, and `mark ? a : b` chooses lane by lane.
// Comparisons of vectors give -1 or 0, but comparisons of plain numbers give 1 or 0. A comparison that becomes a mark is therefore written
// MARK(a < b), one by one: MARK(a < b) & MARK(c < d). A comparison that is only the condition of ?: needs no MARK.
//
// A list of n entries is handled in chunks of LANES. The last chunk may be filled partly.

// What is computed is the same on every device, bit for bit: a * b + c is rounded twice, here and in all files that follow. See
// common/arithmetic.cl.
#pragma OPENCL FP_CONTRACT OFF

// On a CPU without AVX-512, Clang warns that vectors of 16 are passed to functions in another way than with it. Nothing here is linked with
// code that was compiled with it, and the warning would be an error.
#if defined(ON_CPU) && defined(__clang__)
#pragma clang diagnostic ignored "-Wpsabi"
#endif

// scripts/test --oclgrind sets UNDER_OCLGRIND. Oclgrind stops at what LLVM notes where a function was inlined, and reads beyond the number
// in min, max and clamp of a vector and a number; so neither is left to it. A third fault of it is avoided in separate_marks.
#ifdef UNDER_OCLGRIND
#define INLINE static __attribute__((noinline))
#define min(x, limit) min(x, (__typeof__(x))(limit))
#define max(x, limit) max(x, (__typeof__(x))(limit))
#define clamp(x, low, high) clamp(x, (__typeof__(x))(low), (__typeof__(x))(high))
#else
#define INLINE static inline __attribute__((always_inline))
#endif
#define OVERLOADED __attribute__((overloadable))

// Asks for the 64 bytes at an address ahead of their use. OpenCL's own prefetch() does nothing in PoCL.
#if defined(ON_CPU) && defined(POCL_DEVICE_ADDRESS_BITS) && defined(__has_builtin)
#if __has_builtin(__builtin_prefetch)
#define PREFETCH(address) __builtin_prefetch((const void*)(uintptr_t)(address))
#endif
#endif
#ifndef PREFETCH
#define PREFETCH(address) prefetch((__global const uint16*)(address), 1)
#endif

// The mark of a comparison of single numbers, at any width.
#define MARK_OF_ONE(condition) (-(1 & (condition)))
#if LANES == 16
#define OF_LANES(name) name##16
#define vloadv(offset, from) vload16(offset, from)
#define vstorev(values, offset, to) vstore16(values, offset, to)
#define MARK(condition) separate_marks(condition)
#define GATHER(values, at)                                                                                                               \
  values[at.s0], values[at.s1], values[at.s2], values[at.s3], values[at.s4], values[at.s5], values[at.s6], values[at.s7], values[at.s8], \
      values[at.s9], values[at.sa], values[at.sb], values[at.sc], values[at.sd], values[at.se], values[at.sf]
#elif LANES == 1
#define OF_LANES(name) name
#define vloadv(offset, from) ((from)[offset])
#define vstorev(values, offset, to) ((to)[offset] = (values))
#define MARK(condition) MARK_OF_ONE(condition)
#define GATHER(values, at) values[at]
#else
#error "LANES must be 16 or 1"
#endif

typedef OF_LANES(float) floatv;
typedef OF_LANES(int) intv;
typedef OF_LANES(uint) uintv;
typedef OF_LANES(ulong) ulongv;
#define convert_floatv OF_LANES(convert_float)
#define convert_intv OF_LANES(convert_int)
#define convert_uintv OF_LANES(convert_uint)
#define convert_longv OF_LANES(convert_long)
#define convert_ulongv OF_LANES(convert_ulong)
#define as_floatv OF_LANES(as_float)
#define as_intv OF_LANES(as_int)
#define as_uintv OF_LANES(as_uint)
#define as_ulongv OF_LANES(as_ulong)

#if LANES == 16
INLINE intv lane_numbers(void) { return (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15); }

// separate_marks gives the marks of one comparison. lane_bits makes a number whose bit n says whether lane n is marked.
#if defined(ON_CPU) && defined(__clang__) && defined(__AVX2__) && !defined(__AVX512F__)
// LLVM would join comparisons before it makes marks of them. For processors with AVX2 and without AVX-512 it would pack 16 comparisons into
// bytes to do so, and then unpack them. This hides from it that marks come from comparisons.
INLINE intv separate_marks(intv marks) {
  int8 low = marks.lo, high = marks.hi;
  __asm__("" : "+x"(low), "+x"(high));
  return (intv)(low, high);
}

INLINE uint lane_bits(intv marks) {
  const float8 low = as_float8(marks.lo), high = as_float8(marks.hi);
  return (uint)__builtin_ia32_movmskps256(low) | (uint)__builtin_ia32_movmskps256(high) << 8;
}
#else
#ifdef UNDER_OCLGRIND
// A comparison that is true counts as 255 there, not as 1, where LLVM adds comparisons of vectors to numbers. It does not where a function
// that is not optimised hides that these are comparisons.
static __attribute__((noinline, optnone)) intv separate_marks(intv marks) { return marks; }
#else
INLINE intv separate_marks(intv marks) { return marks; }
#endif

INLINE uint lane_bits(intv marks) {
  const int16 bits = marks & ((int16)(1) << lane_numbers());
  const int8 of_8 = bits.lo | bits.hi;
  const int4 of_4 = of_8.lo | of_8.hi;
  const int2 of_2 = of_4.lo | of_4.hi;
  return (uint)(of_2.x | of_2.y);
}
#endif

// Each lane gets the number of the lane before it, and the first one 0.
INLINE ulongv from_lane_before(ulongv v) { return (ulong16)(0, v.s0123, v.s4567, v.s89ab, v.scd, v.se); }

// Stores LANES words in runs of 8: the first run at `to`, and the next one, if `more`, `stride` words behind it.
INLINE void store_runs_of_8(ulongv words, __global ulong* to, int stride, bool more) {
  vstore8(words.lo, 0, to);
  if (more) vstore8(words.hi, 0, to + stride);
}

// Item n of those that fill a bit field puts the bits of its lanes into bits LANES n ... LANES (n + 1) - 1 of the field. Every item must do
// so. At width 1 several items share a word: there the field must be zero before.
INLINE void store_lane_bits(uint bits, uint item, __global uint* field) { ((__global ushort*)field)[item] = (ushort)bits; }

// A word of 64 bits that the 64 / LANES items of a work-group that have its lanes put together in local memory.
typedef struct {
  ushort parts[4];
} SharedWord;

// Every item of the work-group does this, for its own word; a barrier must come between this and read_shared_word.
INLINE void share_lane_bits(uint bits, int item, __local SharedWord* word) { word->parts[item] = (ushort)bits; }
INLINE ulong read_shared_word(__local const SharedWord* word) {
  ulong bits = 0;
  for (int n = 0; n < 4; ++n) bits |= (ulong)word->parts[n] << (16 * n);
  return bits;
}
#else
INLINE intv lane_numbers(void) { return 0; }
INLINE uint lane_bits(intv marks) { return (uint)(marks & 1); }
INLINE ulongv from_lane_before(ulongv v) { return 0; }
INLINE void store_runs_of_8(ulongv words, __global ulong* to, int stride, bool more) { *to = words; }
INLINE void store_lane_bits(uint bits, uint item, __global uint* field) {
  if (bits != 0) atomic_or(&field[item / 32], bits << (item % 32));
}

typedef struct {
  uint halves[2];
} SharedWord;

INLINE void share_lane_bits(uint bits, int item, __local SharedWord* word) {
  if (item < 2) word->halves[item] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (bits != 0) atomic_or(&word->halves[item / 32], bits << (item % 32));
}
INLINE ulong read_shared_word(__local const SharedWord* word) { return (ulong)word->halves[1] << 32 | word->halves[0]; }
#endif

// The other way round: marks of the lanes whose bits are set.
INLINE intv lane_marks(uint bits) { return -(((intv)((int)bits) >> lane_numbers()) & 1); }

INLINE bool any_lane(intv marks) { return lane_bits(marks) != 0; }

// Number of the lowest set bit: loops over marked lanes are written for (uint left = lane_bits(marks); left != 0; left &= left - 1).
INLINE int lowest_lane(uint bits) { return 31 - (int)clz(bits & -bits); }

INLINE floatv gather_float(__global const float* values, intv at) { return (floatv)(GATHER(values, at)); }
INLINE intv gather_int(__global const int* values, intv at) { return (intv)(GATHER(values, at)); }

// Chunks that `count` entries make.
INLINE int chunks_of(int count) { return (count + LANES - 1) / LANES; }

// The entries of a chunk of a list. `exist` marks those before the end of the list; the other lanes repeat its last entry.
INLINE intv load_chunk(__global const int* list, int count, int chunk, intv* exist) {
  const intv n = chunk * LANES + lane_numbers();
  *exist = MARK(n < count);
  return gather_int(list, min(n, count - 1));
}

// Stores the numbers of the first `count` lanes, or of all LANES if there are not as many.
INLINE void OVERLOADED store_first(intv values, int count, __global int* to) {
  if (count >= LANES) {
    vstorev(values, 0, to);
    return;
  }
  int some[LANES];
  vstorev(values, 0, some);
  for (int n = 0; n < count; ++n) to[n] = some[n];
}
INLINE void OVERLOADED store_first(ulongv values, int count, __global ulong* to) {
  if (count >= LANES) {
    vstorev(values, 0, to);
    return;
  }
  ulong some[LANES];
  vstorev(values, 0, some);
  for (int n = 0; n < count; ++n) to[n] = some[n];
}

// LANES elements of a buffer of uint4.
typedef struct {
  uintv x, y, z, w;
} Quads;

// A square of LANES pixels of an image, row by row: SQUARE along its edge.
//   row: pixels from one row of the image to the next
#if LANES == 16
#define SQUARE 4
INLINE intv square_columns(void) { return lane_numbers() & 3; }
INLINE intv square_rows(void) { return lane_numbers() >> 2; }
INLINE uintv load_square(__global const uint* from, int row) {
  return (uint16)(vload4(0, from), vload4(0, from + row), vload4(0, from + 2 * row), vload4(0, from + 3 * row));
}
// Largest pixels of the next TILES_AT_ONCE tiles of 4 x 4 pixels in a row of tiles.
#define TILES_AT_ONCE 4
INLINE void store_tile_maxima(__global const uint* from, int row, __global uint* to) {
  const uint16 of_columns = max(max(vload16(0, from), vload16(0, from + row)), max(vload16(0, from + 2 * row), vload16(0, from + 3 * row)));
  const uint8 of_pairs = max(of_columns.even, of_columns.odd);
  vstore4(max(of_pairs.even, of_pairs.odd), 0, to);
}
INLINE void store_square(uintv values, __global uint* to, int row) {
  vstore4(values.lo.lo, 0, to);
  vstore4(values.lo.hi, 0, to + row);
  vstore4(values.hi.lo, 0, to + 2 * row);
  vstore4(values.hi.hi, 0, to + 3 * row);
}
#else
#define SQUARE 1
INLINE intv square_columns(void) { return 0; }
INLINE intv square_rows(void) { return 0; }
INLINE uintv load_square(__global const uint* from, int row) { return *from; }
INLINE void store_square(uintv values, __global uint* to, int row) { *to = values; }
#define TILES_AT_ONCE 1
INLINE void store_tile_maxima(__global const uint* from, int row, __global uint* to) {
  uint largest = 0;
  for (int n = 0; n < 16; ++n) largest = max(largest, from[n / 4 * row + n % 4]);
  *to = largest;
}
#endif

#if LANES == 16
INLINE Quads transposed(uint16 a, uint16 b, uint16 c, uint16 d) {
  return (Quads){(uint16)(a.s048c, b.s048c, c.s048c, d.s048c), (uint16)(a.s159d, b.s159d, c.s159d, d.s159d),
                 (uint16)(a.s26ae, b.s26ae, c.s26ae, d.s26ae), (uint16)(a.s37bf, b.s37bf, c.s37bf, d.s37bf)};
}
INLINE Quads load_quads(__global const uint4* from) {
  __global const uint* words = (__global const uint*)from;
  return transposed(vload16(0, words), vload16(1, words), vload16(2, words), vload16(3, words));
}
INLINE Quads gather_quads(__global const uint4* from, uintv at) {
  return transposed(
      (uint16)(from[at.s0], from[at.s1], from[at.s2], from[at.s3]), (uint16)(from[at.s4], from[at.s5], from[at.s6], from[at.s7]),
      (uint16)(from[at.s8], from[at.s9], from[at.sa], from[at.sb]), (uint16)(from[at.sc], from[at.sd], from[at.se], from[at.sf]));
}
#else
INLINE Quads load_quads(__global const uint4* from) { return (Quads){from->x, from->y, from->z, from->w}; }
INLINE Quads gather_quads(__global const uint4* from, uintv at) { return load_quads(from + at); }
#endif

// Element at[n] becomes lane n's, for the lanes that are marked.
INLINE void scatter_quads(Quads values, intv at, intv marks, __global uint4* to) {
  uint x[LANES], y[LANES], z[LANES], w[LANES];
  int place[LANES];
  vstorev(values.x, 0, x);
  vstorev(values.y, 0, y);
  vstorev(values.z, 0, z);
  vstorev(values.w, 0, w);
  vstorev(at, 0, place);
  for (uint left = lane_bits(marks); left != 0; left &= left - 1) {
    const int n = lowest_lane(left);
    to[place[n]] = (uint4)(x[n], y[n], z[n], w[n]);
  }
}

INLINE void scatter_int(intv values, intv at, intv marks, __global int* to) {
  int value[LANES], place[LANES];
  vstorev(values, 0, value);
  vstorev(at, 0, place);
  for (uint left = lane_bits(marks); left != 0; left &= left - 1) to[place[lowest_lane(left)]] = value[lowest_lane(left)];
}

// Rounding to whole numbers of either sign, of lanes and, where that is another type, of a single number. OpenCL's own floor and ceil take
// several times as long in PoCL.
#define DEFINE_ROUNDING(FLOATS, INTS, TO_INTS, TO_FLOATS, MARK_OF) \
  INLINE INTS OVERLOADED floor_int(FLOATS x) {                     \
    const INTS whole = TO_INTS(x);                                 \
    return whole + MARK_OF(TO_FLOATS(whole) > x);                  \
  }                                                                \
  INLINE INTS OVERLOADED ceil_int(FLOATS x) {                      \
    const INTS whole = TO_INTS(x);                                 \
    return whole - MARK_OF(TO_FLOATS(whole) < x);                  \
  }
DEFINE_ROUNDING(floatv, intv, convert_intv, convert_floatv, MARK)
#if LANES > 1
DEFINE_ROUNDING(float, int, convert_int, convert_float, MARK_OF_ONE)
#endif

// a / b for a >= 0 and b > 0: there is no instruction that divides vectors of whole numbers.
INLINE intv quotients(intv a, int b) {
  const float inverse = 1.0f / (float)b;
  intv q = convert_intv(convert_floatv(a) * inverse);
  q += convert_intv(convert_floatv(a - q * b) * inverse);  // what float has lost
  const intv rest = a - q * b;
  return q + MARK(rest < 0) - MARK(rest >= b);
}
