// Discs that are drawn into the image of a view, for planners - ours.
//
// Surfels are drawn into an image of each view, nearest first as far as blocks go, and the nearest one stays. Each is the exact disc: the
// ray through a pixel's centre hits it or not. A disc that no ray hits gets the pixel nearest to its centre. A pixel is a number that is
// smaller where the surface is nearer, and that says all that counts, so that the smallest one is the answer in any order:
//   bits 14 ... 31  depth where the ray hits the disc's plane: 18 bits of the float's, from VIEW_NEAR on, which are steps of 2^-14 of it
//   bit 13          back: the normal points away from the camera
//   bit 12          frontier
//   bits 0 ... 11   slope: |n d| for the disc's normal n and the pixel's ray d, whose z is 1, in steps of slope_step
//   images[views][image]: row by row; pixels behind a row's end are drawn as well, and never counted

#define NEAR_BITS 0x3c000000u  // of VIEW_NEAR
#define DEPTH_SHIFT 9          // bits of a float's that are left out
#define VIEW_ROUNDING 1e-4f    // [m] more than rounding moves a point
#define SMALL_DISC 2           // pixels along an edge
#define SLOPE_BITS 12
#define FRONTIER_PIXEL (1u << SLOPE_BITS)
#define BACK_PIXEL (2u << SLOPE_BITS)
#define DEPTH_STEP (4u << SLOPE_BITS)

INLINE uintv depth_keys(floatv z) { return ((as_uintv(z) - NEAR_BITS) >> DEPTH_SHIFT) * DEPTH_STEP; }
INLINE uint depth_key(float z) { return ((as_uint(z) - NEAR_BITS) >> DEPTH_SHIFT) * DEPTH_STEP; }
INLINE floatv depths_of_keys(uintv keys) { return as_floatv((keys / DEPTH_STEP << DEPTH_SHIFT) + (NEAR_BITS | 1u << (DEPTH_SHIFT - 1))); }

INLINE uintv slope_keys(const AskedCamera* camera, floatv slope) {
  return convert_uintv(fmin(fabs(slope) * camera->inverse_step + 0.5f, (float)(FRONTIER_PIXEL - 1)));
}
// A ray in a disc's plane hits it nowhere, or anywhere: depths that are no numbers become those of the disc's near end.
INLINE floatv depths_within(floatv hit, floatv low, floatv high) { return hit >= low ? fmin(hit, high) : low; }

// A disc that is drawn: in the camera's frame, and the pixels around it.
typedef struct {
  float x, y, z, n_x, n_y, n_z;
  float from_plane;        // n c for its centre c
  float radius2;           // [m2]
  float z_low, z_high;     // it has no other depths
  int middle_u, middle_v;  // pixel nearest to its centre
  int low_u, low_v, high_u, high_v;
  uint kind;  // FRONTIER_PIXEL, BACK_PIXEL
} ViewDisc;

// Pixels of an image that several work items draw need atomic operations.
INLINE void put_square(uintv keys, uintv old, __global uint* to, int row, bool shared) {
  if (!shared) {
    store_square(min(keys, old), to, row);
    return;
  }
  uint key[LANES];
  vstorev(keys, 0, key);
  for (uint left = lane_bits(MARK(keys < old)); left != 0; left &= left - 1) {
    const int m = lowest_lane(left);
    atomic_min(&to[m / SQUARE * row + m % SQUARE], key[m]);
  }
}

INLINE void draw_disc(const AskedCamera* camera, const ViewDisc* disc, __global uint* image, bool shared) {
  const uintv nearest = depth_keys((floatv)(fmax(disc->z_low, VIEW_NEAR)));
  for (int low_v = disc->low_v; low_v <= disc->high_v; low_v += SQUARE)
    for (int low_u = disc->low_u; low_u <= disc->high_u; low_u += SQUARE) {
      __global uint* square = image + low_v * camera->row + low_u;
      const uintv old = load_square(square, camera->row);
      if (!any_lane(MARK(old > nearest))) continue;
      const intv u = low_u + square_columns(), v = low_v + square_rows();
      const floatv d_x = (convert_floatv(u) - camera->cx) * camera->inverse_fx, d_y = (convert_floatv(v) - camera->cy) * camera->inverse_fy;
      const floatv slope = disc->n_x * d_x + disc->n_y * d_y + disc->n_z, hit = divided(disc->from_plane, slope);
      const floatv x = hit * d_x - disc->x, y = hit * d_y - disc->y, z = hit - disc->z;
      const intv middle = MARK(u == disc->middle_u) & MARK(v == disc->middle_v);
      const floatv depth = depths_within(hit, (floatv)(disc->z_low), (floatv)(disc->z_high));
      const intv drawn = (middle | MARK(x * x + y * y + z * z <= disc->radius2)) & MARK(u <= disc->high_u) & MARK(v <= disc->high_v) &
                         MARK(depth >= VIEW_NEAR) & MARK(depth <= camera->range);
      if (!any_lane(drawn)) continue;
      const uintv keys = drawn ? depth_keys(depth) + disc->kind + slope_keys(camera, slope) : (uintv)(VIEW_NOTHING);
      put_square(keys, old, square, camera->row, shared);
    }
}

// A range of pixels along an image's edge that holds all that is within `reach` of `middle`, and `nearest`.
INLINE void pixel_range(floatv middle, floatv reach, intv nearest, int size, intv* low, intv* high) {
  *low = max(min(ceil_int(clamp(middle - reach, -1e5f, 1e5f)), nearest), 0);
  *high = min(max(floor_int(clamp(middle + reach, -1e5f, 1e5f)), nearest), size - 1);
}

// LANES discs.
typedef struct {
  Points p, n;  // centre and normal, the camera's frame
  floatv from_plane, radius2, z_low, z_high;
  intv middle_u, middle_v, low_u, low_v, high_u, high_v;
  uintv kind;
} ViewDiscs;

// One pixel of each disc, column i and row j of those around it.
INLINE void draw_pixel_of_each(const AskedCamera* camera, const ViewDiscs* d, int i, int j, intv marks, __global uint* image, bool shared) {
  const intv u = d->low_u + i, v = d->low_v + j;
  const floatv d_x = (convert_floatv(u) - camera->cx) * camera->inverse_fx, d_y = (convert_floatv(v) - camera->cy) * camera->inverse_fy;
  const floatv slope = d->n.x * d_x + d->n.y * d_y + d->n.z, hit = divided(d->from_plane, slope);
  const floatv x = hit * d_x - d->p.x, y = hit * d_y - d->p.y, z = hit - d->p.z;
  const intv middle = MARK(u == d->middle_u) & MARK(v == d->middle_v);
  const floatv depth = depths_within(hit, d->z_low, d->z_high);
  uint key[LANES];
  int at[LANES];
  vstorev(depth_keys(depth) + d->kind + slope_keys(camera, slope), 0, key);
  vstorev(v * camera->row + u, 0, at);
  marks &= (middle | MARK(x * x + y * y + z * z <= d->radius2)) & MARK(depth >= VIEW_NEAR) & MARK(depth <= camera->range);
  for (uint left = lane_bits(marks); left != 0; left &= left - 1) {
    const int m = lowest_lane(left);
    __global uint* pixel = image + at[m];
    if (key[m] >= *pixel) continue;
    if (shared)
      atomic_min(pixel, key[m]);
    else
      *pixel = key[m];
  }
}

// Draws discs of at most SMALL_DISC pixels along an edge: all at once, one pixel after the other.
INLINE void draw_small_discs(const AskedCamera* camera, const ViewDiscs* d, uint lanes, __global uint* image, bool shared) {
  const intv small = lane_marks(lanes);
  for (int j = 0; j < SMALL_DISC; ++j) {
    const intv row = small & MARK(d->low_v + j <= d->high_v);
    if (!any_lane(row)) return;
    for (int i = 0; i < SMALL_DISC; ++i) {
      const intv marks = row & MARK(d->low_u + i <= d->high_u);
      if (!any_lane(marks)) break;
      draw_pixel_of_each(camera, d, i, j, marks, image, shared);
    }
  }
}

// Bits of the lanes whose balls may be in the image and within the range. Discs near the camera's plane cannot be told by their pixels.
INLINE uint balls_in_image(const AskedCamera* camera, Points p, floatv radius) {
  const floatv x_reach = (radius + VIEW_ROUNDING) * camera->side_x, y_reach = (radius + VIEW_ROUNDING) * camera->side_y;
  return lane_bits(MARK(p.z + radius >= VIEW_NEAR) & MARK(p.z - radius <= camera->range) & MARK(p.x - camera->right * p.z <= x_reach) &
                   MARK(camera->left * p.z - p.x <= x_reach) & MARK(p.y - camera->bottom * p.z <= y_reach) &
                   MARK(camera->top * p.z - p.y <= y_reach));
}

// Draws LANES surfels, those whose bits are set.
INLINE void draw_surfels(const AskedCamera* camera, const Transform* T_camera_local, Surfels s, uint lanes, __global uint* image,
                         bool shared) {
  const Points p = transformed(T_camera_local, s.position);
  lanes &= balls_in_image(camera, p, s.radius);
  if (lanes == 0) return;
  const Points n = rotated(T_camera_local, unpack_normals(s.normal));
  const floatv reach_z = s.radius * square_root(fmax(1.0f - n.z * n.z, 0.0f)), near_z = p.z - reach_z;
  const intv whole = MARK(near_z >= VIEW_NEAR), has_middle = MARK(p.z >= VIEW_NEAR);
  lanes &= lane_bits(MARK(p.z + reach_z >= VIEW_NEAR) & MARK(near_z <= camera->range));
  if (lanes == 0) return;

  // A point q of the disc is off the centre's column by f (q - p) (1, 0, -x / z) / z of q, and off its row alike.
  const floatv depth = fmax(p.z, VIEW_NEAR), x = divided(p.x, depth), y = divided(p.y, depth), along_x = n.x - x * n.z,
               along_y = n.y - y * n.z;
  const floatv scale = divided(s.radius, fmax(near_z, VIEW_NEAR));
  const floatv reach_u = camera->fx * scale * square_root(fmax(1.0f + x * x - along_x * along_x, 0.0f)) + 0.01f;
  const floatv reach_v = camera->fy * scale * square_root(fmax(1.0f + y * y - along_y * along_y, 0.0f)) + 0.01f;
  const floatv u = x * camera->fx + camera->cx, v = y * camera->fy + camera->cy;
  const intv middle_u = floor_int(clamp(u, -1e5f, 1e5f) + 0.5f), middle_v = floor_int(clamp(v, -1e5f, 1e5f) + 0.5f);
  intv low_u, low_v, high_u, high_v;
  pixel_range(u, whole ? reach_u : (floatv)(1e5f), middle_u, camera->width, &low_u, &high_u);
  pixel_range(v, whole ? reach_v : (floatv)(1e5f), middle_v, camera->height, &low_v, &high_v);
  lanes &= lane_bits(MARK(low_u <= high_u) & MARK(low_v <= high_v));
  if (lanes == 0) return;

  const floatv from_plane = dot_products(n, p);
  const uintv frontier = (s.attributes & SURFEL_OCCUPIED) != 0 ? (uintv)(0) : (uintv)(FRONTIER_PIXEL);
  const uintv kinds = from_plane < 0.0f ? frontier : frontier + BACK_PIXEL;
  const ViewDiscs discs = {
      p,      n,      from_plane, s.radius * s.radius, near_z, p.z + reach_z, has_middle ? middle_u : (intv)(-1), middle_v, low_u, low_v,
      high_u, high_v, kinds};
  const uint small = lanes & lane_bits(MARK(high_u - low_u < SMALL_DISC) & MARK(high_v - low_v < SMALL_DISC));
  if (small != 0) draw_small_discs(camera, &discs, small, image, shared);
  lanes &= ~small;
  if (lanes == 0) return;
  float to_x[LANES], to_y[LANES], to_z[LANES], n_x[LANES], n_y[LANES], n_z[LANES], plane[LANES], radius[LANES], reach[LANES];
  int m_u[LANES], m_v[LANES], l_u[LANES], l_v[LANES], h_u[LANES], h_v[LANES];
  uint kind[LANES];
  vstorev(p.x, 0, to_x);
  vstorev(p.y, 0, to_y);
  vstorev(p.z, 0, to_z);
  vstorev(n.x, 0, n_x);
  vstorev(n.y, 0, n_y);
  vstorev(n.z, 0, n_z);
  vstorev(from_plane, 0, plane);
  vstorev(s.radius, 0, radius);
  vstorev(reach_z, 0, reach);
  vstorev(has_middle ? middle_u : (intv)(-1), 0, m_u);
  vstorev(middle_v, 0, m_v);
  vstorev(low_u, 0, l_u);
  vstorev(low_v, 0, l_v);
  vstorev(high_u, 0, h_u);
  vstorev(high_v, 0, h_v);
  vstorev(kinds, 0, kind);
  for (uint left = lanes; left != 0; left &= left - 1) {
    const int m = lowest_lane(left);
    const ViewDisc disc = {
        to_x[m], to_y[m], to_z[m], n_x[m], n_y[m], n_z[m], plane[m], radius[m] * radius[m], to_z[m] - reach[m], to_z[m] + reach[m],
        m_u[m],  m_v[m],  l_u[m],  l_v[m], h_u[m], h_v[m], kind[m]};
    draw_disc(camera, &disc, image, shared);
  }
}
