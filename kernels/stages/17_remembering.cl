// Remembering: what a view has seen that is not kept, or is forgotten, becomes seen points (common/seen_points.cl) - ours. The points of
// the lattice that the view knows are set, exactly those: the shortcuts for whole bricks decide only how long it takes.

// Does a view know every point in a rectangle of its image up to the depth `far`?
//   pixels: first column and row, last column and row
INLINE bool is_open(const View* view, __global const ushort* depths, int4 pixels, float far) {
  const int columns = (view->width + VIEW_BLOCK - 1) / VIEW_BLOCK, rows = (view->height + VIEW_BLOCK - 1) / VIEW_BLOCK;
  const int4 blocks = pixels / VIEW_BLOCK;
  const int patches = (view->width + PATCH_COLUMNS - 1) / PATCH_COLUMNS * ((view->height + PATCH_ROWS - 1) / PATCH_ROWS);
  __global const ushort* smallest = depths + view->first_pixel + patches * PATCH_COLUMNS * PATCH_ROWS + columns * rows;
  for (int t = blocks.y; t <= blocks.w; ++t)
    for (int s = blocks.x; s <= blocks.z; ++s)
      if ((float)smallest[t * columns + s] * view->depth_step <= far) return false;
  return true;
}

INLINE float least(float8 v) {
  const float4 of_4 = fmin(v.lo, v.hi);
  const float2 of_2 = fmin(of_4.lo, of_4.hi);
  return fmin(of_2.x, of_2.y);
}

// Does a view know none, some or all of the points of a cube? SEEN_MIXED also where that is not clear.
//   center, half_size: of the cube, in the frame of view->to_image [m]
INLINE int cube_in_view(const View* view, __global const ushort* depths, float3 center, float half_size) {
  const Transform* T = &view->to_image;
  const float8 x = (float8)(-1, 1, -1, 1, -1, 1, -1, 1) * half_size + center.x,
               y = (float8)(-1, -1, 1, 1, -1, -1, 1, 1) * half_size + center.y,
               z = (float8)(-1, -1, -1, -1, 1, 1, 1, 1) * half_size + center.z;
  const float8 depth = T->r20 * x + T->r21 * y + T->r22 * z + T->t2;
  const float slack = 1e-5f * (fabs(T->t2) + fabs(center.x) + fabs(center.y) + fabs(center.z)) + 1e-5f;  // of float
  const float near = least(depth) - slack, far = -least(-depth) + slack;
  if (far <= 0.0f) return SEEN_NONE;
  if (near <= 0.01f) return SEEN_MIXED;
  const float8 s = (T->r00 * x + T->r01 * y + T->r02 * z + T->t0) / depth, t = (T->r10 * x + T->r11 * y + T->r12 * z + T->t1) / depth;
  const float pixel_slack = 0.02f, width = (float)view->width, height = (float)view->height;
  const float left = least(s) - pixel_slack, right = -least(-s) + pixel_slack, top = least(t) - pixel_slack,
              bottom = -least(-t) + pixel_slack;
  if (right < 0.0f || bottom < 0.0f || left >= width || top >= height) return SEEN_NONE;
  const int4 pixels = (int4)((int)clamp(left, 0.0f, width - 1.0f), (int)clamp(top, 0.0f, height - 1.0f),
                             (int)clamp(right, 0.0f, width - 1.0f), (int)clamp(bottom, 0.0f, height - 1.0f));
  if (is_hidden(view, depths, pixels, near)) return SEEN_NONE;
  const bool inside = left >= 0.0f && top >= 0.0f && right < width && bottom < height;
  return inside && is_open(view, depths, pixels, far) ? SEEN_ALL : SEEN_MIXED;
}

// Edge of the lattice's cells [m].
INLINE float seen_spacing(const Window* window, int shift) { return window->block_size / (float)(SEEN_BRICK << shift); }

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

// Words along an edge of the cubes that one work item of see_points handles, and such cubes in a brick: a cube that the view knows nothing
// of is done with at once.
#define SEE_EDGE (LANES == 1 ? 1 : 2)
#define SEE_WORD(w) ((((w) >> 2) * 4 + ((w) >> 1 & 1)) * 4 + ((w)&1))  // of word w of a cube, from its first one
#define SEE_CUBES (SEEN_WORDS / (SEE_EDGE * SEE_EDGE * SEE_EDGE))

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
      const intv point = bit + lane_numbers(), open = ~lane_marks((uint)(before >> bit));
      const Points p = {(convert_floatv(of_word.x + (point & 3)) + 0.5f) * spacing,
                        (convert_floatv(of_word.y + (point >> 2 & 3)) + 0.5f) * spacing,
                        (convert_floatv(of_word.z + (point >> 4)) + 0.5f) * spacing};
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
