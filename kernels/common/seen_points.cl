// Seen points: memory of what forgotten views have seen. The world has a lattice of points, with a bit each: has such a view
// seen this very point?
//
// A block of the map has 2^seen_shift bricks along each edge. A brick has SEEN_BRICK^3 points in SEEN_WORDS words of 4 x 4 x 4 points.
//   slots[cells of the window]: number of the table of the cell's block; table 0 is that of blocks without one, and has only zeros
//   tables[...][bricks of a block]: number of each brick; in brick 0 no point is seen, and in brick 1 all are
//   bricks[...][SEEN_WORDS]: word (z 4 + y) 4 + x of a brick, and bit (z 4 + y) 4 + x of a word
// Point n along an edge of a block is (n + 1/2) spacings from the block's corner.

typedef struct {
  __global const int* slots;
  __global const int* tables;
  __global const int* bricks;  // as 32-bit halves of words
} SeenPoints;

// Where a number of points along one axis is: shares of the indices that the three axes add up to.
typedef struct {
  intv inside, cell, brick, word, bit;
} SeenPlace;

//   points: along the axis, from the window's corner;  shift: seen_shift;  blocks: of the window
//   stride: of the axis among the window's cells;  axis: 0, 1, 2 for x, y, z
INLINE SeenPlace seen_place(intv points, int shift, int blocks, int stride, int axis) {
  const int block = shift + SEEN_BRICK_SHIFT;
  SeenPlace place;
  place.inside = MARK(points >= 0) & MARK(points < blocks << block);
  const intv n = place.inside ? points : 0;
  place.cell = (n >> block) * stride;
  place.brick = (n >> SEEN_BRICK_SHIFT & ((1 << shift) - 1)) << (axis * shift);
  place.word = (n >> 2 & 3) << (2 * axis);
  place.bit = (n & 3) << (2 * axis);
  return place;
}

// The bricks that lattice points are in; brick 0 where a point is beyond the window.
INLINE intv bricks_at(const SeenPoints* seen, int shift, const SeenPlace* x, const SeenPlace* y, const SeenPlace* z) {
  const intv inside = x->inside & y->inside & z->inside;
  const intv slot = gather_int(seen->slots, inside ? x->cell + y->cell + z->cell : 0);
  const intv brick = gather_int(seen->tables, (slot << (3 * shift)) + x->brick + y->brick + z->brick);
  return inside ? brick : SEEN_BRICK_EMPTY;
}

// Which of LANES points on the lattice are seen: of the 8 lattice points around them, weighted trilinearly, more than SEEN_SHARE are. It
// takes numbers, because many compilers do not inline it: where a pointer to a structure is passed to such a function, each work item of a
// kernel makes a copy of the structure before it does anything else.
//   q: in points, from the window's first one;  blocks_x, blocks_y, blocks_z: of the window;  asked: marks of the points in question
intv seen_around(const SeenPoints seen, Points q, int shift, int blocks_x, int blocks_y, int blocks_z, intv asked) {
  const floatv x = q.x, y = q.y, z = q.z;
  const intv i = floor_int(x), j = floor_int(y), k = floor_int(z);
  const int row = blocks_x, layer = row * blocks_y;
  SeenPlace along_x[2], along_y[2], along_z[2];
  along_x[0] = seen_place(i, shift, blocks_x, 1, 0);
  along_y[0] = seen_place(j, shift, blocks_y, row, 1);
  along_z[0] = seen_place(k, shift, blocks_z, layer, 2);
  const intv first = bricks_at(&seen, shift, &along_x[0], &along_y[0], &along_z[0]);

  // Most points have all 8 in one brick, and most of these bricks are uniform.
  const int last = SEEN_BRICK - 1;
  const intv together = MARK((i & last) != last) & MARK((j & last) != last) & MARK((k & last) != last);
  const intv alike = asked & together & MARK(first <= SEEN_BRICK_FULL);
  const intv known = alike & MARK(first == SEEN_BRICK_FULL), open = asked & ~alike;
  if (!any_lane(open)) return known;

  along_x[1] = seen_place(i + 1, shift, blocks_x, 1, 0);
  along_y[1] = seen_place(j + 1, shift, blocks_y, row, 1);
  along_z[1] = seen_place(k + 1, shift, blocks_z, layer, 2);
  const bool one_brick = !any_lane(open & ~together);
  const floatv a = x - convert_floatv(i), b = y - convert_floatv(j), c = z - convert_floatv(k);
  floatv share = 0.0f;
#if LANES == 1
#pragma unroll  // arrays whose places are known stay in registers
#endif
  for (int n = 0; n < 8; ++n) {
    const SeenPlace *u = &along_x[n & 1], *v = &along_y[n >> 1 & 1], *t = &along_z[n >> 2];
    const floatv weight = (n & 1 ? a : 1.0f - a) * (n & 2 ? b : 1.0f - b) * (n & 4 ? c : 1.0f - c);
    const intv brick = one_brick ? first : bricks_at(&seen, shift, u, v, t);
    const intv bit = u->bit + v->bit + t->bit;
    const intv half_word = gather_int(seen.bricks, 2 * (SEEN_WORDS * brick + u->word + v->word + t->word) + (bit >> 5));
    share += MARK((half_word >> (bit & 31) & 1) != 0) ? weight : 0.0f;
  }
  return known | (open & MARK(share > SEEN_SHARE));
}

// Which of LANES points lie in space that was seen before.
//   p: camera frame [m];  asked: marks of the points in question
INLINE intv seen_before(const Frame* f, const SeenPoints* seen, Points p, intv asked) {
  const Window* w = &f->window;
  const float scale = divided((float)(SEEN_BRICK << f->seen_shift), w->block_size);
  const Points q = transformed(&f->T_local_camera, p);
  return seen_around(*seen, (Points){q.x * scale - 0.5f, q.y * scale - 0.5f, q.z * scale - 0.5f}, f->seen_shift, w->size_x, w->size_y,
                     w->size_z, asked);
}

// Which of the lattice points around a box are seen: none, some, or all? SEEN_MIXED also where that would take long to find out.
INLINE int seen_in_box(const Frame* f, const SeenPoints* seen, const Box* box) {
  const Transform* T = &f->T_local_camera;
  const float3 c = box->center, h = box->half_size;
  const float scale = divided((float)(SEEN_BRICK << f->seen_shift), f->window.block_size);
  const float3 center = (float3)(T->r00 * c.x + T->r01 * c.y + T->r02 * c.z + T->t0, T->r10 * c.x + T->r11 * c.y + T->r12 * c.z + T->t1,
                                 T->r20 * c.x + T->r21 * c.y + T->r22 * c.z + T->t2);
  const float3 half_size =
      (float3)(fabs(T->r00) * h.x + fabs(T->r01) * h.y + fabs(T->r02) * h.z, fabs(T->r10) * h.x + fabs(T->r11) * h.y + fabs(T->r12) * h.z,
               fabs(T->r20) * h.x + fabs(T->r21) * h.y + fabs(T->r22) * h.z);
  const float3 low = (center - half_size) * scale - 1.0f, high = (center + half_size) * scale + 1.0f;  // half a point more than needed
  const int points_shift = SEEN_BRICK_SHIFT + f->seen_shift, sides = (1 << f->seen_shift) - 1;
  const int3 size = (int3)(f->window.size_x, f->window.size_y, f->window.size_z) << points_shift;
  if (low.x < 0.0f || low.y < 0.0f || low.z < 0.0f || high.x >= (float)size.x || high.y >= (float)size.y || high.z >= (float)size.z)
    return SEEN_MIXED;
  const int3 first = convert_int3(low) >> SEEN_BRICK_SHIFT, last = convert_int3(high) >> SEEN_BRICK_SHIFT, extent = last - first + 1;
  if (extent.x * extent.y * extent.z > SEEN_MOST_BRICKS) return SEEN_MIXED;
  bool none = true, all = true;
  for (int z = first.z; z <= last.z; ++z)
    for (int y = first.y; y <= last.y; ++y)
      for (int x = first.x; x <= last.x; ++x) {
        const int cell = ((z >> f->seen_shift) * f->window.size_y + (y >> f->seen_shift)) * f->window.size_x + (x >> f->seen_shift);
        const int brick = (((z & sides) << f->seen_shift | (y & sides)) << f->seen_shift) | (x & sides);
        const int entry = seen->tables[(seen->slots[cell] << (3 * f->seen_shift)) + brick];
        none = none && entry == SEEN_BRICK_EMPTY;
        all = all && entry == SEEN_BRICK_FULL;
        if (!none && !all) return SEEN_MIXED;
      }
  return none ? SEEN_NONE : SEEN_ALL;
}

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
INLINE float seen_spacing(const Window* window, int shift) { return divided(window->block_size, (float)(SEEN_BRICK << shift)); }

// LANES points of a word, from bit `bit` on: in the window's frame [m].
//   first: the word's first point, counted from the window's corner
INLINE Points points_of_word(int3 first, int bit, float spacing) {
  const intv point = bit + lane_numbers();
  return (Points){(convert_floatv(first.x + (point & 3)) + 0.5f) * spacing, (convert_floatv(first.y + (point >> 2 & 3)) + 0.5f) * spacing,
                  (convert_floatv(first.z + (point >> 4)) + 0.5f) * spacing};
}

// Words along an edge of the cubes that one work item of see_points or take_points handles, and such cubes in a brick: a cube that the view
// knows nothing of is done with at once.
#define SEE_EDGE (LANES == 1 ? 1 : 2)
#define SEE_WORD(w) ((((w) >> 2) * 4 + ((w) >> 1 & 1)) * 4 + ((w)&1))  // of word w of a cube, from its first one
#define SEE_CUBES (SEEN_WORDS / (SEE_EDGE * SEE_EDGE * SEE_EDGE))
