// Kept views: exact membership of points in the space that a view has seen; boxes as views see them: which may know something of a piece
// of the grid, so that no others are asked.

// Where pixels of a view's image are (common/shared.h).
INLINE uint16 view_pixels(uint16 width, uint16 column, uint16 row) {
  const uint16 columns = (width + PATCH_COLUMNS - 1) / PATCH_COLUMNS;
  const uint16 patch = row / PATCH_ROWS * columns + column / PATCH_COLUMNS;
  return (patch * PATCH_ROWS + row % PATCH_ROWS) * PATCH_COLUMNS + column % PATCH_COLUMNS;
}

// Depths of pixels [m]. Read as numbers of 32 bits, two pixels each, the even one in the lower half: none of 16 bits can be gathered.
INLINE float16 view_depths(__global const ushort* depths, int16 pixel, float step) {
  const int16 two = gather_int((__global const int*)depths, pixel >> 1);
  return convert_float16(two >> ((pixel & 1) << 4) & 0xffff) * step;
}

// Which of LANES points does a view see: its pixel there is valid and lies deeper?
//   q: column and row times depth, and depth (View)
INLINE int16 sees(const View* view, __global const ushort* depths, Points q, int16 asked) {
  const float16 scale = 1.0f / q.z, s = q.x * scale, t = q.y * scale;
  const int16 seen = asked & (q.z > 0.0f) & (s >= 0.0f) & (t >= 0.0f) & (s < (float)view->width) & (t < (float)view->height);
  if (lane_bits(seen) == 0) return 0;
  const uint16 pixel = view_pixels((uint)view->width, convert_uint16(s), convert_uint16(t));
  return seen & (q.z < view_depths(depths + view->first_pixel, seen ? as_int16(pixel) : 0, view->depth_step));
}

// Exact membership of points in the space that one view has seen, of those that are asked.
//   depths: all views' images, without signs, rounded down;  p: in this frame's camera [m]
INLINE int16 knows(const View* view, __global const ushort* depths, Points p, int16 asked) {
  return sees(view, depths, transform_points(&view->to_image, p), asked);
}

// The same of this frame's own view, whose camera has no other orientation.
INLINE int16 own_view_knows(const View* view, __global const ushort* depths, Points p, int16 asked) {
  const Transform* K = &view->to_image;
  return sees(view, depths, (Points){fma(p.x, K->r00, p.z * K->r02), fma(p.y, K->r11, p.z * K->r12), p.z}, asked);
}

// A box of the camera's frame.
typedef struct {
  float3 center, half_size;
} Box;

// All points at most `margin` from the centres of a tile's voxels between two corners.
INLINE Box tile_box(const Grid* g, __global const float* layer_depth, int3 first, int3 last, float min_gap) {
  const float z_first = layer_depth[first.z], z_last = layer_depth[last.z];
  const float wide_first = fmax(z_first, g->z_min), wide_last = fmax(z_last, g->z_min);  // the cuboid's columns are parallel
  const float left = (float)first.x - g->center_i, right = (float)last.x - g->center_i;
  const float top = (float)first.y - g->center_j, bottom = (float)last.y - g->center_j;
  const float3 low = (float3)(fmin(left * wide_first, left * wide_last) / g->fx, fmin(top * wide_first, top * wide_last) / g->fy, z_first);
  const float3 high =
      (float3)(fmax(right * wide_first, right * wide_last) / g->fx, fmax(bottom * wide_first, bottom * wide_last) / g->fy, z_last);
  // Points behind a candidate are asked for, and those half a voxel around it that it may slide to.
  const float margin = fmax(min_gap, 0.55f * voxel_size(g, z_last));
  return (Box){0.5f * (low + high), 0.5f * (high - low) + margin};
}

// A box as LANES views see it: in their frames, with what float may be wrong by added.
typedef struct {
  float16 x, y, z, half_x, half_y, half_z;
} BoxInViews;

INLINE BoxInViews box_in_views(__global const float* lanes, const Box* box) {
  const float16 r00 = vload16(0, lanes), r01 = vload16(1, lanes), r02 = vload16(2, lanes);
  const float16 r10 = vload16(3, lanes), r11 = vload16(4, lanes), r12 = vload16(5, lanes);
  const float16 r20 = vload16(6, lanes), r21 = vload16(7, lanes), r22 = vload16(8, lanes);
  const float16 t0 = vload16(9, lanes), t1 = vload16(10, lanes), t2 = vload16(11, lanes);
  const float3 c = box->center, h = box->half_size;
  const float16 slack = 1e-5f * (fabs(t0) + fabs(t1) + fabs(t2) + fabs(c.x) + fabs(c.y) + fabs(c.z) + h.x + h.y + h.z);
  BoxInViews b;
  b.x = r00 * c.x + r01 * c.y + r02 * c.z + t0;
  b.y = r10 * c.x + r11 * c.y + r12 * c.z + t1;
  b.z = r20 * c.x + r21 * c.y + r22 * c.z + t2;
  b.half_x = fabs(r00) * h.x + fabs(r01) * h.y + fabs(r02) * h.z + slack;
  b.half_y = fabs(r10) * h.x + fabs(r11) * h.y + fabs(r12) * h.z + slack;
  b.half_z = fabs(r20) * h.x + fabs(r21) * h.y + fabs(r22) * h.z + slack;
  return b;
}

// Is any point with |x - c| <= h and so on on the side x + slope z >= 0 of a plane through the view's centre?
INLINE int16 reaches_side(float16 x, float16 half_x, float16 z, float16 half_z, float16 slope) {
  return x + half_x + slope * z + fabs(slope) * half_z >= 0.0f;
}

// Does a view know nothing in a rectangle of its image at the depth `near` or beyond?
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

// Which of a group of LANES views may know a point of a box, a bit each. The others certainly know none: the box is outside of their
// image, or behind all that they have seen there.
uint views_of_box(__global const float* lanes, __global const View* views, __global const ushort* depths, const Box* box) {
  const BoxInViews b = box_in_views(lanes, box);
  const float16 fx = vload16(12, lanes), fy = vload16(13, lanes), cx = vload16(14, lanes) + 0.5f, cy = vload16(15, lanes) + 0.5f;
  const float16 width = vload16(16, lanes), height = vload16(17, lanes);
  const float16 slack_x = 0.01f + 1e-5f * (fabs(cx) + width), slack_y = 0.01f + 1e-5f * (fabs(cy) + height);  // [pixel]
  const float16 near = b.z - b.half_z, far = b.z + b.half_z;
  const int16 visible = (width > 0.0f) & (far > 0.0f) & reaches_side(fx * b.x, fx * b.half_x, b.z, b.half_z, cx + slack_x) &
                        reaches_side(-fx * b.x, fx * b.half_x, b.z, b.half_z, width - cx + slack_x) &
                        reaches_side(fy * b.y, fy * b.half_y, b.z, b.half_z, cy + slack_y) &
                        reaches_side(-fy * b.y, fy * b.half_y, b.z, b.half_z, height - cy + slack_y);
  uint bits = lane_bits(visible);
  if (bits == 0) return 0;

  const int16 in_front = near > 0.01f;
  const float16 by_near = fx / near, by_far = fx / far, scale = fy / fx;
  const float16 left = b.x - b.half_x, right = b.x + b.half_x, top = b.y - b.half_y, bottom = b.y + b.half_y;
  int first_s[LANES], last_s[LANES], first_t[LANES], last_t[LANES];
  float nearest[LANES];
  vstore16(convert_int16(clamp(fmin(left * by_near, left * by_far) + cx - slack_x, 0.0f, width - 1.0f)), 0, first_s);
  vstore16(convert_int16(clamp(fmax(right * by_near, right * by_far) + cx + slack_x, 0.0f, width - 1.0f)), 0, last_s);
  vstore16(convert_int16(clamp(fmin(top * by_near, top * by_far) * scale + cy - slack_y, 0.0f, height - 1.0f)), 0, first_t);
  vstore16(convert_int16(clamp(fmax(bottom * by_near, bottom * by_far) * scale + cy + slack_y, 0.0f, height - 1.0f)), 0, last_t);
  vstore16(near, 0, nearest);
  for (uint left_over = bits & lane_bits(in_front); left_over != 0; left_over &= left_over - 1) {
    const int n = lowest_lane(left_over);
    const View view = views[n];
    if (is_hidden(&view, depths, (int4)(first_s[n], first_t[n], last_s[n], last_t[n]), nearest[n])) bits &= ~(1u << n);
  }
  return bits;
}
