// Observed space C~ - paper 3.3, eq. (9)-(11).
//
// A depth image pixel is > 0: a measured surface there; < 0: nothing is met up to -depth; 0: no measurement.

// One work item a pixel: the first layer that its ray does not observe, 0 where there is no measurement.
//   in  depth[height][width] [m];  layer_depth[size_k]: z of each layer's centre [m], ascending
//   out column_end[height][width]: layers first_pyramid_layer ... column_end - 1 are observed
__kernel void column_ends(const Grid g, __global const float* depth, __global const float* layer_depth, __global int* column_end) {
  const int pixel = get_global_id(0);
  if (pixel >= g.width * g.height) return;
  const float d = fabs(depth[pixel]);
  int low = 0, high = g.size_k;  // z(low - 1) < d <= z(high)
  while (low < high) {
    const int middle = (low + high) / 2;
    if (layer_depth[middle] < d) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  column_end[pixel] = d > 0.0f ? low : 0;
}

// One work item a word, dimensions i, w and j: pyramid bits are a run up to the column's end; a cuboid voxel is observed iff a valid
// pixel's ray has its sample of that layer in it, that is, iff there is one in a fixed rectangle of the image.
//   in  column_end[height][width];  valid_above[height + 1][width + 1]: valid pixels above and to the left (a summed area table)
//       pixels_i[first_pyramid_layer][size_i], pixels_j[first_pyramid_layer][size_j]: first and one past the last pixel whose sample lies
//       there
//   out observed: bit field
__kernel void observed_space(const Grid g, __global const int* column_end, __global const int* valid_above,
                             __global const ushort2* pixels_i, __global const ushort2* pixels_j, __global ulong* observed) {
  const int i = get_global_id(0), w = get_global_id(1), j = get_global_id(2);
  if (i >= g.size_i) return;

  ulong bits = 0;
  const int s = i - g.padding_i, t = j - g.padding_j;
  if (s >= 0 && s < g.width && t >= 0 && t < g.height) {
    bits = bit_run(g.first_pyramid_layer - 64 * w, column_end[t * g.width + s] - 64 * w);
  }

  const int stride = g.width + 1;
  const int cuboid_end = min(64 * (w + 1), g.first_pyramid_layer);
  for (int k = max(64 * w, g.padding_k); k < cuboid_end; ++k) {
    const ushort2 column = pixels_i[k * g.size_i + i], row = pixels_j[k * g.size_j + j];
    if (column.x >= column.y || row.x >= row.y) continue;
    __global const int* top = valid_above + row.x * stride;
    __global const int* bottom = valid_above + row.y * stride;
    if (bottom[column.y] - bottom[column.x] - top[column.y] + top[column.x] > 0) bits |= 1ul << (k - 64 * w);
  }
  observed[word_index(&g, i, j, w)] = bits & valid_layers(&g, w);
}

// Exact membership of eight points in the space that one view has seen (its pixel there is valid and lies deeper).
//   depths: all views' images;  x, y, z: in the view's camera frame [m]
// @return -1 (all bits) where the view knows the point
INLINE int8 view_knows_eight(const View* view, __global const float* depths, float8 x, float8 y, float8 z) {
  const float8 s = x * view->fx / z + view->cx + 0.5f, t = y * view->fy / z + view->cy + 0.5f;
  const int8 seen = z > 0.0f && s >= 0.0f && t >= 0.0f && s < (float)view->width && t < (float)view->height;
  const int8 pixel = select((int8)(0), convert_int8(t) * view->width + convert_int8(s), seen);
  __global const float* depth = depths + view->first_pixel;
  const float8 d = (float8)(depth[pixel.s0], depth[pixel.s1], depth[pixel.s2], depth[pixel.s3], depth[pixel.s4], depth[pixel.s5],
                            depth[pixel.s6], depth[pixel.s7]);
  return seen && z < fabs(d);
}

// Is layer k of a pixel's column, or a point there at depth z, at the measured surface that ended the column, or at most `surface_depth`
// behind it?
//   depth, column_end: of the pixel
INLINE bool at_surface(const Grid* g, float depth, int column_end, float surface_depth, int k, float z) {
  if ((float)k <= g->k_min || depth <= 0.0f) return false;
  return (k == column_end && k > g->first_pyramid_layer) || (z >= depth && z <= depth + surface_depth);
}
