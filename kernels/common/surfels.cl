// The map's surfels and pages.
//
// The map is made of pages of PAGE_SLOTS surfels, each page of one block of the world; slot = PAGE_SLOTS page + n.
//   surfels[slots]: 16 bytes each. x: position x, y and y's lower half: z, in 65536ths of the block; y's upper half: radius [m] as a 16-bit
//     float; z: normal, octahedral, in 32767ths; w: attributes (common/shared.h)
//   alive[pages]: which slots hold a surfel;   page_block[pages]: x, y, z of the block, w: the frame that changed the page last
//   changed[pages]: which slots this frame has changed, for pages of this frame's window
//
// Where a stage goes through all surfels of a page, one work item does LANES of them.

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

// LANES surfels of a page, camera frame.
typedef struct {
  Points position;
  float16 radius;
  uint16 normal, attributes;  // as the map keeps them
} Surfels;

//   first: slot of the first of them, a multiple of LANES
INLINE Surfels load_surfels(const Window* window, const Transform* T_camera_local, __global const uint4* surfels, int4 block, uint first) {
  __global const uint* words = (__global const uint*)(surfels + first);
  const uint16 a = vload16(0, words), b = vload16(1, words), c = vload16(2, words), d = vload16(3, words);
  const uint16 x = (uint16)(a.s048c, b.s048c, c.s048c, d.s048c), y = (uint16)(a.s159d, b.s159d, c.s159d, d.s159d);
  Surfels s;
  s.position.x = ((float)(block.x - window->origin_x) + (convert_float16(x & 0xffff) + 0.5f) / 65536.0f) * window->block_size;
  s.position.y = ((float)(block.y - window->origin_y) + (convert_float16(x >> 16) + 0.5f) / 65536.0f) * window->block_size;
  s.position.z = ((float)(block.z - window->origin_z) + (convert_float16(y & 0xffff) + 0.5f) / 65536.0f) * window->block_size;
  s.position = transform_points(T_camera_local, s.position);
  s.radius = as_float16(((y >> 16) << 13) + (112u << 23));
  s.normal = (uint16)(a.s26ae, b.s26ae, c.s26ae, d.s26ae);
  s.attributes = (uint16)(a.s37bf, b.s37bf, c.s37bf, d.s37bf);
  return s;
}

// Their normals, camera frame.
INLINE Points stored_normals(const Surfels* s, const Transform* T_camera_local) {
  Points n = {convert_float16(as_int16(s->normal << 16) >> 16), convert_float16(as_int16(s->normal) >> 16), 0.0f};
  n.z = 32767.0f - fabs(n.x) - fabs(n.y);
  const float16 fold = fmax(-n.z, 0.0f);
  n.x += n.x < 0.0f ? fold : -fold;
  n.y += n.y < 0.0f ? fold : -fold;
  return rotate_points(T_camera_local, normalized(n));
}

// Those that a measured surface would still tell something: that they are occupied, or their colour.
INLINE int16 lacks_label(uint16 attributes, int has_color) {
  const uint done = SURFEL_OCCUPIED | (has_color ? SURFEL_COLORED : 0);
  return (attributes & done) != done;
}

// Bits of LANES slots in a word of their page.
INLINE uint lanes_of_page(ulong word, uint first) { return (uint)(word >> (first % PAGE_SLOTS)) & ((1u << LANES) - 1); }

// The word whose parts are lanes[0 ... 3].
INLINE ulong pack_lanes(__local const ushort* lanes) {
  ulong bits = 0;
  for (int n = 0; n < PAGE_ITEMS; ++n) bits |= (ulong)lanes[n] << (LANES * n);
  return bits;
}
