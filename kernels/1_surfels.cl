// The map's surfels and pages.
//
// The map is made of pages of PAGE_SLOTS surfels, each page of one block of the world; slot = PAGE_SLOTS page + n.
//   surfels[slots]: 16 bytes each. x: position x, y and y's lower half: z, in 65536ths of the block; y's upper half: radius [m] as a 16-bit
//     float; z: normal, octahedral, in 32767ths; w: attributes (0_shared.h)
//   alive[pages]: which slots hold a surfel;   page_block[pages]: x, y, z of the block, w: the frame that changed the page last
//   changed[pages]: which slots this frame has changed, for pages of this frame's window
//
// Where a stage goes through all surfels of a page, one work item does eight, as vectors.

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

// Eight surfels of a page, camera frame.
typedef struct {
  float8 x, y, z, radius;
  uint8 normal, attributes;  // as the map keeps them
} Surfels8;

// p_b of eight points.
INLINE void transform_eight(const Transform* T, float8* x, float8* y, float8* z) {
  const float8 a = *x, b = *y, c = *z;
  *x = T->r00 * a + T->r01 * b + T->r02 * c + T->t0;
  *y = T->r10 * a + T->r11 * b + T->r12 * c + T->t1;
  *z = T->r20 * a + T->r21 * b + T->r22 * c + T->t2;
}

//   first: slot of the first of them, a multiple of 8
INLINE Surfels8 load_eight(const Window* window, const Transform* T_camera_local, __global const uint4* surfels, int4 block, uint first) {
  __global const uint* words = (__global const uint*)(surfels + first);
  const uint16 low = vload16(0, words), high = vload16(1, words);
  const uint8 x = (uint8)(low.s048c, high.s048c), y = (uint8)(low.s159d, high.s159d);
  Surfels8 s;
  s.x = ((float)(block.x - window->origin_x) + (convert_float8(x & 0xffff) + 0.5f) / 65536.0f) * window->block_size;
  s.y = ((float)(block.y - window->origin_y) + (convert_float8(x >> 16) + 0.5f) / 65536.0f) * window->block_size;
  s.z = ((float)(block.z - window->origin_z) + (convert_float8(y & 0xffff) + 0.5f) / 65536.0f) * window->block_size;
  transform_eight(T_camera_local, &s.x, &s.y, &s.z);
  s.radius = as_float8(((y >> 16) << 13) + (112u << 23));
  s.normal = (uint8)(low.s26ae, high.s26ae);
  s.attributes = (uint8)(low.s37bf, high.s37bf);
  return s;
}

// Their normals, camera frame.
INLINE void normals_of_eight(const Surfels8* s, const Transform* T_camera_local, float8* x, float8* y, float8* z) {
  float8 n_x = convert_float8(as_int8(s->normal << 16) >> 16), n_y = convert_float8(as_int8(s->normal) >> 16);
  const float8 n_z = 32767.0f - fabs(n_x) - fabs(n_y), fold = fmax(-n_z, 0.0f);
  n_x += select(-fold, fold, n_x < 0.0f);
  n_y += select(-fold, fold, n_y < 0.0f);
  const float8 length = sqrt(n_x * n_x + n_y * n_y + n_z * n_z);
  *x = (T_camera_local->r00 * n_x + T_camera_local->r01 * n_y + T_camera_local->r02 * n_z) / length;
  *y = (T_camera_local->r10 * n_x + T_camera_local->r11 * n_y + T_camera_local->r12 * n_z) / length;
  *z = (T_camera_local->r20 * n_x + T_camera_local->r21 * n_y + T_camera_local->r22 * n_z) / length;
}

// The voxels that eight points (camera frame) lie in. @return -1 (all bits) where that is inside the grid
INLINE int8 voxels_of_eight(const Grid* g, float8 x, float8 y, float8 z, int8* i, int8* j, int8* k) {
  const float8 depth = fmax(z, g->z_min);
  const float8 layer = select(z / g->delta_min + (float)g->padding_k, g->f * natural_log8(depth / g->z_min) + g->k_min, z >= g->z_min);
  *i = floor_int8(x * g->fx / depth + g->center_i + 0.5f);
  *j = floor_int8(y * g->fy / depth + g->center_j + 0.5f);
  *k = floor_int8(layer + 0.5f);
  return *i >= 0 && *j >= 0 && *k >= 0 && *i < g->size_i && *j < g->size_j && *k < g->size_k;
}

// Bits of the lanes that are -1.
INLINE uint lanes_of(int8 mask) {
  const int8 bits = mask & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
  const int4 four = bits.lo | bits.hi;
  return (uint)(four.x | four.y | four.z | four.w);
}

// The word whose bytes are lanes[0 ... 7].
INLINE ulong pack_lanes(__local const uchar* lanes) {
  ulong bits = 0;
  for (int n = 0; n < 8; ++n) bits |= (ulong)lanes[n] << (8 * n);
  return bits;
}
