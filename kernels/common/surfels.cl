// The map's surfels and pages, and LANES surfels at once.
//
// The map is made of pages of PAGE_SLOTS surfels, each page of one block of the world. Surfel n of a page is in slot PAGE_SLOTS page + n.
//   surfels[slots]: 16 bytes each. x: position x, and y in the upper half; y: position z, and in the upper half the radius [m] as a 16-bit
//     float; z: normal, octahedral, two coordinates of 16 bits in steps of 1 / 32767; w: attributes (common/shared.h). Positions are
//     counted in 65536ths of the block's edge.
//   alive[pages]: a bit for each slot that holds a surfel
//   page_block[pages]: x, y, z of the block; w: number of the frame that changed the page last
//   changed[pages]: a bit for each slot that this frame has changed, for pages of this frame's window
//   reserved[pages]: a bit for each slot whose surfel, alive or not, somebody knows who follows the map: no other surfel may take it
//
// Where a stage goes through all surfels of the window's pages, PAGE_ITEMS work items share a page and handle LANES surfels each.

#define PAGE_ITEMS (PAGE_SLOTS / LANES)

// Positive floats as 16 bits (IEEE half precision), rounded to nearest; floats that are too small or too large become the nearest ones.
INLINE uintv floats_to_halves(floatv x) { return (as_uintv(clamp(x, 6.2e-5f, 65000.0f)) + 0x1000u - (112u << 23)) >> 13; }
INLINE floatv halves_to_floats(uintv bits) { return as_floatv((bits << 13) + (112u << 23)); }

INLINE uintv pack_normals(Points n) {
  const floatv sum = fabs(n.x) + fabs(n.y) + fabs(n.z), x = divided(n.x, sum), y = divided(n.y, sum);
  const floatv folded_x = x < 0.0f ? fabs(y) - 1.0f : 1.0f - fabs(y), folded_y = y < 0.0f ? fabs(x) - 1.0f : 1.0f - fabs(x);
  const uintv low = as_uintv(floor_int(32767.0f * (n.z < 0.0f ? folded_x : x) + 0.5f)),
              high = as_uintv(floor_int(32767.0f * (n.z < 0.0f ? folded_y : y) + 0.5f));
  return (low & 0xffff) | (high << 16);
}

INLINE Points unpack_normals(uintv bits) {
  Points n = {convert_floatv(as_intv(bits << 16) >> 16), convert_floatv(as_intv(bits) >> 16), 0.0f};  // whole: exact until normalised
  n.z = 32767.0f - fabs(n.x) - fabs(n.y);
  const floatv fold = fmax(-n.z, 0.0f);
  n.x += n.x < 0.0f ? fold : -fold;
  n.y += n.y < 0.0f ? fold : -fold;
  return normalized(n);
}

typedef struct {
  Points position;  // local frame, where nothing else is said [m]
  floatv radius;    // [m]
  uintv normal;     // as the map keeps it: unpack_normals() gives it in the local frame
  uintv attributes;
} Surfels;

// Unpacks surfels; positions are exact.
//   corners: of their blocks, counted in blocks from the window's
INLINE Surfels unpack_surfels(const Window* window, Quads packed, Points corners) {
  Surfels s;
  s.position.x = (corners.x + (convert_floatv(packed.x & 0xffff) + 0.5f) * (1.0f / 65536.0f)) * window->block_size;
  s.position.y = (corners.y + (convert_floatv(packed.x >> 16) + 0.5f) * (1.0f / 65536.0f)) * window->block_size;
  s.position.z = (corners.z + (convert_floatv(packed.y & 0xffff) + 0.5f) * (1.0f / 65536.0f)) * window->block_size;
  s.radius = halves_to_floats(packed.y >> 16);
  s.normal = packed.z;
  s.attributes = packed.w;
  return s;
}

// LANES surfels of a page of `block`.
//   first: slot of the first of them, a multiple of LANES
INLINE Surfels load_surfels(const Window* window, __global const uint4* surfels, int4 block, uint first) {
  const Points corners = {(float)(block.x - window->origin_x), (float)(block.y - window->origin_y), (float)(block.z - window->origin_z)};
  return unpack_surfels(window, load_quads(surfels + first), corners);
}

// The surfels of any slots.
INLINE Surfels surfels_at(const Window* window, __global const uint4* surfels, __global const int4* page_block, uintv slots) {
  const Quads block = gather_quads((__global const uint4*)page_block, slots / PAGE_SLOTS);
  const Points corners = {convert_floatv(as_intv(block.x) - window->origin_x), convert_floatv(as_intv(block.y) - window->origin_y),
                          convert_floatv(as_intv(block.z) - window->origin_z)};
  return unpack_surfels(window, gather_quads(surfels, slots), corners);
}

// Surfels as the map keeps them.
//   p, normal: local frame;   out cell: of the window
INLINE Quads pack_surfels(const Window* window, Points p, floatv radius, Points normal, uintv attributes, intv* cell) {
  const floatv x = divided(p.x, window->block_size), y = divided(p.y, window->block_size), z = divided(p.z, window->block_size);
  const intv block_x = clamp(floor_int(x), 0, window->size_x - 1), block_y = clamp(floor_int(y), 0, window->size_y - 1),
             block_z = clamp(floor_int(z), 0, window->size_z - 1);
  *cell = (block_z * window->size_y + block_y) * window->size_x + block_x;
  const uintv q_x = as_uintv(clamp(convert_intv((x - convert_floatv(block_x)) * 65536.0f), 0, 65535)),
              q_y = as_uintv(clamp(convert_intv((y - convert_floatv(block_y)) * 65536.0f), 0, 65535)),
              q_z = as_uintv(clamp(convert_intv((z - convert_floatv(block_z)) * 65536.0f), 0, 65535));
  return (Quads){q_x | (q_y << 16), q_z | (floats_to_halves(radius) << 16), pack_normals(normal), attributes};
}

INLINE bool is_alive(__global const ulong* alive, uint slot) { return ((alive[slot / PAGE_SLOTS] >> (slot % PAGE_SLOTS)) & 1) != 0; }

// The bit of a slot in the word of its page, whose words are given as 32-bit halves.
INLINE void set_slot(__global uint* halves, uint slot) { atomic_or(&halves[slot / 32], 1u << (slot % 32)); }
INLINE void clear_slot(__global uint* halves, uint slot) { atomic_and(&halves[slot / 32], ~(1u << (slot % 32))); }

// Bits of LANES slots in the word of their page.
//   first: the first of the slots
INLINE uint lanes_of_page(ulong word, uint first) { return (uint)(word >> (first % PAGE_SLOTS)) & ((1u << LANES) - 1); }

// Surfels to which a measured surface would still tell something: that they are occupied, or their colour.
INLINE intv lack_label(uintv attributes, int has_color) {
  const uint done = SURFEL_OCCUPIED | (has_color ? SURFEL_COLORED : 0);
  return MARK((attributes & done) != done);
}
