// What is hidden in the image of a view while it is being drawn - ours: of a map of several rooms that is most.
//
// A tile of HIDING_TILE x HIDING_TILE pixels hides what is not nearer than its farthest pixel. Pixels only ever come nearer, so that a tile
// that was looked at some time ago hides too little at worst, and the image does not depend on when that was.
//   tiles[rows of tiles][tiles_of_row]: the largest pixel of each

INLINE int tiles_of_row(const AskedCamera* camera) { return camera->width / HIDING_TILE + HIDING_SPARE; }

// Looks at all tiles of an image.
INLINE void find_tiles(const AskedCamera* camera, __global const uint* image, __global uint* tiles) {
  for (int v = 0; v * HIDING_TILE < camera->height; ++v)
    for (int u = 0; u * HIDING_TILE < camera->width; u += TILES_AT_ONCE)
      store_tile_maxima(image + v * HIDING_TILE * camera->row + u * HIDING_TILE, camera->row, tiles + v * tiles_of_row(camera) + u);
}

// Smallest and largest f x / z + c of x and z in two ranges, z > 0.
INLINE float2 image_range(float low, float high, float low_z, float high_z, float f, float c) {
  return (float2)(low / (low < 0.0f ? low_z : high_z), high / (high < 0.0f ? high_z : low_z)) * f + c;
}

// Is all that is drawn of a block hidden, or beside the image?
//   corner: its lowest one, local frame;  margin: how far its discs may reach out of it [m]
INLINE bool is_block_hidden(const AskedCamera* camera, const Transform* T_camera_local, float3 corner, float block_size, float margin,
                            __global const uint* tiles) {
  const Transform T = *T_camera_local;
  const float3 x = (float3)(T.r00, T.r10, T.r20), y = (float3)(T.r01, T.r11, T.r21), z = (float3)(T.r02, T.r12, T.r22);
  const float3 middle = corner + 0.5f * block_size;
  const float3 center = middle.x * x + middle.y * y + middle.z * z + (float3)(T.t0, T.t1, T.t2);
  const float3 reach = 0.5f * block_size * (fabs(x) + fabs(y) + fabs(z)) + margin + VIEW_ROUNDING;
  const float3 low = center - reach, high = center + reach;
  if (low.z < VIEW_NEAR) return false;
  const float last_u = (float)(camera->width - 1), last_v = (float)(camera->height - 1);
  const float2 u = image_range(low.x, high.x, low.z, high.z, camera->fx, camera->cx) + (float2)(-1.0f, 1.0f),
               v = image_range(low.y, high.y, low.z, high.z, camera->fy, camera->cy) + (float2)(-1.0f, 1.0f);
  if (u.x > last_u || u.y < 0.0f || v.x > last_v || v.y < 0.0f) return true;
  const int2 in_u = convert_int2(clamp(u, 0.0f, last_u)) / HIDING_TILE, in_v = convert_int2(clamp(v, 0.0f, last_v)) / HIDING_TILE;
  const uint nearest = depth_key(low.z);
  for (int j = in_v.x; j <= in_v.y; ++j)
    for (int i = in_u.x; i <= in_u.y; ++i)
      if (tiles[j * tiles_of_row(camera) + i] > nearest) return false;
  return true;
}
