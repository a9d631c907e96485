// Kept views: exact membership of points in the space that a view has seen, and which views may know something of a box at all, so that no
// others are asked.
//
// A view's image is kept in patches (PATCH_COLUMNS x PATCH_ROWS pixels), depths as whole steps of 16 bits, rounded down and without signs;
// behind it lie the largest depths of its blocks of VIEW_BLOCK x VIEW_BLOCK pixels (common/shared.h).
// Views come in groups of VIEW_GROUP, with a bit each in a 16-bit word: bit n of group m is view VIEW_GROUP m + n. For questions to many
// views at once their numbers lie by fields: view_lanes[groups][VIEW_LANE_FIELDS][VIEW_GROUP], zero behind the last view.

#define VIEW_PARTS (VIEW_GROUP / LANES)  // of a group: LANES views each

// Numbers of pixels in a view's image.
INLINE uintv view_pixels(uintv width, uintv column, uintv row) {
  const uintv columns = (width + PATCH_COLUMNS - 1) / PATCH_COLUMNS;
  const uintv patch = row / PATCH_ROWS * columns + column / PATCH_COLUMNS;
  return (patch * PATCH_ROWS + row % PATCH_ROWS) * PATCH_COLUMNS + column % PATCH_COLUMNS;
}

// Depths of pixels [m]. They are read as numbers of 32 bits, two pixels each with the even one in the lower half: numbers of 16 bits cannot
// be gathered.
INLINE floatv view_depths(__global const ushort* depths, intv pixel, float step) {
  const intv two = gather_int((__global const int*)depths, pixel >> 1);
  return convert_floatv(two >> ((pixel & 1) << 4) & 0xffff) * step;
}

// Which of LANES points does a view see: its pixel there is valid and lies deeper?
//   q: column and row times depth, and depth (View);  asked: marks of the points in question
INLINE intv sees(const View* view, __global const ushort* depths, Points q, intv asked) {
  const floatv scale = divided(1.0f, q.z), s = q.x * scale, t = q.y * scale;
  const intv seen =
      asked & MARK(q.z > 0.0f) & MARK(s >= 0.0f) & MARK(t >= 0.0f) & MARK(s < (float)view->width) & MARK(t < (float)view->height);
  if (!any_lane(seen)) return 0;
  const uintv pixel = view_pixels((uint)view->width, convert_uintv(s), convert_uintv(t));
  return seen & MARK(q.z < view_depths(depths + view->first_pixel, seen & as_intv(pixel), view->depth_step));
}

// Exact membership of points in the space that one view has seen, of those that are asked.
//   depths: all views' images;  p: in the frame of this frame's camera [m]
INLINE intv knows(const View* view, __global const ushort* depths, Points p, intv asked) {
  return sees(view, depths, transformed(&view->to_image, p), asked);
}

// knows() for this frame's own view: its camera is the frame's, so that most of the transform falls away.
INLINE intv own_view_knows(const View* view, __global const ushort* depths, Points p, intv asked) {
  const Transform* K = &view->to_image;
  return sees(view, depths, (Points){fma(p.x, K->r00, p.z * K->r02), fma(p.y, K->r11, p.z * K->r12), p.z}, asked);
}

// LANES views of a group: pose of this frame's camera in each of them, and intrinsics. Half a pixel is added to cx and cy, so that what is
// rounded down is the nearest pixel.
typedef struct {
  floatv r00, r01, r02, r10, r11, r12, r20, r21, r22, t0, t1, t2;
  floatv fx, fy, cx, cy, width, height;
  uintv first_pixel;
} ViewLanes;

//   group[VIEW_LANE_FIELDS][VIEW_GROUP]: of view_lanes;  part: 0 ... VIEW_PARTS - 1
INLINE ViewLanes load_view_lanes(__global const float* group, int part) {
#define FIELD(field) vloadv((VIEW_LANE_##field) * VIEW_PARTS + part, group)
  ViewLanes v = {FIELD(R00),
                 FIELD(R01),
                 FIELD(R02),
                 FIELD(R10),
                 FIELD(R11),
                 FIELD(R12),
                 FIELD(R20),
                 FIELD(R21),
                 FIELD(R22),
                 FIELD(T0),
                 FIELD(T1),
                 FIELD(T2),
                 FIELD(FX),
                 FIELD(FY),
                 FIELD(CX),
                 FIELD(CY),
                 FIELD(WIDTH),
                 FIELD(HEIGHT),
                 as_uintv(FIELD(FIRST_PIXEL))};
#undef FIELD
  v.cx += 0.5f;
  v.cy += 0.5f;
  return v;
}

// Point p of this frame's camera as each of the views has it in its own camera's frame.
INLINE Points point_in_views(const ViewLanes* v, float3 p) {
  return (Points){v->r00 * p.x + v->r01 * p.y + v->r02 * p.z + v->t0, v->r10 * p.x + v->r11 * p.y + v->r12 * p.z + v->t1,
                  v->r20 * p.x + v->r21 * p.y + v->r22 * p.z + v->t2};
}

// A box in the frame of this frame's camera [m].
typedef struct {
  float3 center, half_size;
} Box;

// All points near the centres of a tile's voxels between two corners: within min_gap of them, as points so far behind a candidate are asked
// for, and within VIEW_BOX_MARGIN voxels, as candidates may slide.
INLINE Box tile_box(const Grid* g, __global const float* layer_depth, int3 first, int3 last, float min_gap) {
  const float z_first = layer_depth[first.z], z_last = layer_depth[last.z];
  const float wide_first = fmax(z_first, g->z_min), wide_last = fmax(z_last, g->z_min);  // the cuboid's columns are parallel
  const float left = (float)first.x - g->center_i, right = (float)last.x - g->center_i;
  const float top = (float)first.y - g->center_j, bottom = (float)last.y - g->center_j;
  const float3 low = (float3)(fmin(left * wide_first, left * wide_last) / g->fx, fmin(top * wide_first, top * wide_last) / g->fy, z_first);
  const float3 high =
      (float3)(fmax(right * wide_first, right * wide_last) / g->fx, fmax(bottom * wide_first, bottom * wide_last) / g->fy, z_last);
  const float margin = fmax(min_gap, VIEW_BOX_MARGIN * (wide_last / g->f));
  return (Box){0.5f * (low + high), 0.5f * (high - low) + margin};
}

// A box as LANES views see it: in their frames, enlarged by what float may be wrong by.
typedef struct {
  Points center, half_size;
} BoxInViews;

INLINE BoxInViews box_in_views(const ViewLanes* v, const Box* box) {
  const float3 c = box->center, h = box->half_size;
  const floatv slack = 1e-5f * (fabs(v->t0) + fabs(v->t1) + fabs(v->t2) + fabs(c.x) + fabs(c.y) + fabs(c.z) + h.x + h.y + h.z);
  BoxInViews b;
  b.center = point_in_views(v, c);
  b.half_size.x = fabs(v->r00) * h.x + fabs(v->r01) * h.y + fabs(v->r02) * h.z + slack;
  b.half_size.y = fabs(v->r10) * h.x + fabs(v->r11) * h.y + fabs(v->r12) * h.z + slack;
  b.half_size.z = fabs(v->r20) * h.x + fabs(v->r21) * h.y + fabs(v->r22) * h.z + slack;
  return b;
}

// Is any point with |x - c| <= half_x and |z - c'| <= half_z on the side x + slope z >= 0 of a plane through the view's centre?
INLINE intv reaches_side(floatv x, floatv half_x, floatv z, floatv half_z, floatv slope) {
  return MARK(x + half_x + slope * z + fabs(slope) * half_z >= 0.0f);
}

// Does a view know nothing in a rectangle of its image at the depth `near` or beyond?
//   pixels: first column and row, last column and row
INLINE bool is_hidden(const View* view, __global const ushort* depths, int4 pixels, float near) {
  const int columns = (view->width + VIEW_BLOCK - 1) / VIEW_BLOCK;
  const int4 blocks = pixels / VIEW_BLOCK;
  const int patches = (view->width + PATCH_COLUMNS - 1) / PATCH_COLUMNS * ((view->height + PATCH_ROWS - 1) / PATCH_ROWS);
  __global const ushort* largest = depths + view->first_pixel + patches * PATCH_COLUMNS * PATCH_ROWS;
  for (int t = blocks.y; t <= blocks.w; ++t)
    for (int s = blocks.x; s <= blocks.z; ++s)
      if ((float)largest[t * columns + s] * view->depth_step > near) return false;
  return true;
}

// Which of LANES views may know a point of a box, a bit each. The others certainly know none: the box is outside of their image, or behind
// all that they have seen there.
//   group[VIEW_LANE_FIELDS][VIEW_GROUP]: of view_lanes;  views: the part's first
uint part_of_box(__global const float* group, int part, __global const View* views, __global const ushort* depths, const Box* box) {
  const ViewLanes v = load_view_lanes(group, part);
  const BoxInViews b = box_in_views(&v, box);
  const floatv slack_x = 0.01f + 1e-5f * (fabs(v.cx) + v.width), slack_y = 0.01f + 1e-5f * (fabs(v.cy) + v.height);  // [pixel]
  const floatv near = b.center.z - b.half_size.z, far = b.center.z + b.half_size.z;
  const intv visible = MARK(v.width > 0.0f) & MARK(far > 0.0f) &
                       reaches_side(v.fx * b.center.x, v.fx * b.half_size.x, b.center.z, b.half_size.z, v.cx + slack_x) &
                       reaches_side(-v.fx * b.center.x, v.fx * b.half_size.x, b.center.z, b.half_size.z, v.width - v.cx + slack_x) &
                       reaches_side(v.fy * b.center.y, v.fy * b.half_size.y, b.center.z, b.half_size.z, v.cy + slack_y) &
                       reaches_side(-v.fy * b.center.y, v.fy * b.half_size.y, b.center.z, b.half_size.z, v.height - v.cy + slack_y);
  uint bits = lane_bits(visible);
  if (bits == 0) return 0;

  const intv in_front = MARK(near > 0.01f);
  const floatv by_near = v.fx / near, by_far = v.fx / far, scale = v.fy / v.fx;
  const floatv left = b.center.x - b.half_size.x, right = b.center.x + b.half_size.x, top = b.center.y - b.half_size.y,
               bottom = b.center.y + b.half_size.y;
  int first_s[LANES], last_s[LANES], first_t[LANES], last_t[LANES];
  float nearest[LANES];
  vstorev(convert_intv(clamp(fmin(left * by_near, left * by_far) + v.cx - slack_x, 0.0f, v.width - 1.0f)), 0, first_s);
  vstorev(convert_intv(clamp(fmax(right * by_near, right * by_far) + v.cx + slack_x, 0.0f, v.width - 1.0f)), 0, last_s);
  vstorev(convert_intv(clamp(fmin(top * by_near, top * by_far) * scale + v.cy - slack_y, 0.0f, v.height - 1.0f)), 0, first_t);
  vstorev(convert_intv(clamp(fmax(bottom * by_near, bottom * by_far) * scale + v.cy + slack_y, 0.0f, v.height - 1.0f)), 0, last_t);
  vstorev(near, 0, nearest);
  for (uint left_over = bits & lane_bits(in_front); left_over != 0; left_over &= left_over - 1) {
    const int n = lowest_lane(left_over);
    const View view = views[n];
    if (is_hidden(&view, depths, (int4)(first_s[n], first_t[n], last_s[n], last_t[n]), nearest[n])) bits &= ~(1u << n);
  }
  return bits;
}

// Which views of a group may know a point of a box, a bit each.
//   group, views: the group's
INLINE ushort views_of_box(__global const float* group, __global const View* views, __global const ushort* depths, const Box* box) {
  uint bits = 0;
  for (int part = 0; part < VIEW_PARTS; ++part) bits |= part_of_box(group, part, views + part * LANES, depths, box) << (part * LANES);
  return (ushort)bits;
}
