// Remembering: what a view has seen that is not kept, or is forgotten, becomes seen points (common/seen_points.cl) - ours. The points of
// the lattice that the view knows are set, exactly those: the shortcuts for whole bricks decide only how long it takes.

// One work item handles a brick of a block.
//   in  window: of these blocks;  view: from the window's frame to its image;  depths: its image
//       blocks[count]: x, y, z from the window's corner, and the number of the block's table
//   out found[count][bricks of a block]: what the view adds to the brick: SEEN_NONE, SEEN_MIXED or SEEN_ALL
__kernel void find_seen_bricks(const Window window, const View view, const int shift, __global const ushort* depths,
                               __global const int4* blocks, const int count, __global const int* tables, __global uchar* found) {
  const int n = get_global_id(0) >> (3 * shift), brick = get_global_id(0) & ((1 << 3 * shift) - 1), sides = (1 << shift) - 1;
  if (n >= count) return;
  const int4 block = blocks[n];
  uchar adds = SEEN_NONE;
  if (tables[(block.w << (3 * shift)) + brick] != SEEN_BRICK_FULL) {
    const int3 place = (block.xyz << shift) + (int3)(brick & sides, brick >> shift & sides, brick >> (2 * shift));
    const float size = SEEN_BRICK * seen_spacing(&window, shift);
    adds = (uchar)cube_in_view(&view, depths, (convert_float3(place) + 0.5f) * size, 0.5f * size);
  }
  found[get_global_id(0)] = adds;
}

// One work item handles a cube of words of a brick.
//   in  seen_by[count]: x, y, z of a brick, counted in bricks from the window's corner, and its number
//   i/o bricks: the bits of points that the view knows are set
__kernel void see_points(const Window window, const View view, const int shift, __global const ushort* depths, __global const int4* seen_by,
                         const int count, __global ulong* bricks) {
  const int n = get_global_id(0) / SEE_CUBES, cube = get_global_id(0) % SEE_CUBES, edges = 4 / SEE_EDGE;
  if (n >= count) return;
  const int4 brick = seen_by[n];
  const int3 corner = SEE_EDGE * (int3)(cube % edges, cube / edges % edges, cube / edges / edges);  // [word]
  __global ulong* words = bricks + SEEN_WORDS * brick.w + (corner.z * 4 + corner.y) * 4 + corner.x;
  ulong all = ~0ul;
  for (int w = 0; w < SEE_EDGE * SEE_EDGE * SEE_EDGE; ++w) all &= words[SEE_WORD(w)];
  if (all == ~0ul) return;

  const float spacing = seen_spacing(&window, shift), half_size = 2.0f * SEE_EDGE * spacing;
  const int3 first = SEEN_BRICK * brick.xyz + 4 * corner;  // [point]
  if (cube_in_view(&view, depths, convert_float3(first) * spacing + half_size, half_size) == SEEN_NONE) return;
  for (int w = 0; w < SEE_EDGE * SEE_EDGE * SEE_EDGE; ++w) {
    const ulong before = words[SEE_WORD(w)];
    if (before == ~0ul) continue;
    const int3 of_word = first + 4 * (int3)(w & 1, w >> 1 & 1, w >> 2);
    ulong seen = before;
    for (int bit = 0; bit < 64; bit += LANES) {
      const intv open = ~lane_marks((uint)(before >> bit));
      const Points p = points_of_word(of_word, bit, spacing);
      seen |= (ulong)lane_bits(knows(&view, depths, p, open)) << bit;
    }
    if (seen != before) words[SEE_WORD(w)] = seen;
  }
}

// One work item handles a brick: are none, some or all of its points seen?
//   out states[count]: SEEN_NONE, SEEN_MIXED or SEEN_ALL
__kernel void find_brick_states(__global const int4* seen_by, const int count, __global const ulong* bricks, __global uchar* states) {
  const int n = get_global_id(0);
  if (n >= count) return;
  __global const ulong* words = bricks + SEEN_WORDS * seen_by[n].w;
  ulong all = ~0ul, any = 0;
  for (int word = 0; word < SEEN_WORDS; ++word) {
    all &= words[word];
    any |= words[word];
  }
  states[n] = all == ~0ul ? SEEN_ALL : any == 0 ? SEEN_NONE : SEEN_MIXED;
}
