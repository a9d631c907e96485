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

// Valid pixels of a rectangle. columns, rows: first and one past the last
//   valid_above[height + 1][width + 1]: valid pixels above and to the left (a summed area table)
INLINE int valid_pixels(const Grid* g, __global const int* valid_above, ushort2 columns, ushort2 rows) {
  __global const int* top = valid_above + rows.x * (g->width + 1);
  __global const int* bottom = valid_above + rows.y * (g->width + 1);
  return bottom[columns.y] - bottom[columns.x] - top[columns.y] + top[columns.x];
}

// One work item a word, dimensions i, w and j: pyramid bits are a run up to the column's end; a cuboid voxel is observed iff a valid
// pixel's ray has its sample of that layer in it, that is, iff there is one in a fixed rectangle of the image. Of most runs of layers all
// pixels are valid, or none.
//   in  column_end[height][width];  valid_above: of valid_pixels
//       pixels_i[layers][size_i], pixels_j[layers][size_j]: first and one past the last pixel whose sample lies there, of the cuboid's
//       layers, filled up to whole words;  run_pixels_i[layers / LAYER_RUN][size_i], run_pixels_j: the same, of runs of layers;
//       layers_i[layers / 64][size_i], layers_j: bits of the layers that have such pixels at all
//   out observed: bit field
__kernel void observed_space(const Grid g, __global const int* column_end, __global const int* valid_above,
                             __global const ushort2* pixels_i, __global const ushort2* pixels_j, __global const ushort2* run_pixels_i,
                             __global const ushort2* run_pixels_j, __global const ulong* layers_i, __global const ulong* layers_j,
                             __global ulong* observed) {
  const int i = get_global_id(0), w = get_global_id(1), j = get_global_id(2);
  if (i >= g.size_i) return;

  ulong bits = 0;
  const int s = i - g.padding_i, t = j - g.padding_j;
  if (s >= 0 && s < g.width && t >= 0 && t < g.height) {
    bits = bit_run(g.first_pyramid_layer - 64 * w, column_end[t * g.width + s] - 64 * w);
  }

  ulong cuboid = 64 * w < g.first_pyramid_layer ? layers_i[w * g.size_i + i] & layers_j[w * g.size_j + j] : 0;
  for (ulong left = cuboid; left != 0;) {
    const int k = 64 * w + lowest_bit(left), run = k / LAYER_RUN;
    const ulong run_layers = bit_run(LAYER_RUN * run - 64 * w, LAYER_RUN * (run + 1) - 64 * w);
    const ushort2 columns = run_pixels_i[run * g.size_i + i], rows = run_pixels_j[run * g.size_j + j];
    const int valid = valid_pixels(&g, valid_above, columns, rows);
    if (valid == 0) cuboid &= ~run_layers;
    const bool mixed = valid > 0 && valid < (columns.y - columns.x) * (rows.y - rows.x);
    for (ulong layers = mixed ? left & run_layers : 0; layers != 0; layers &= layers - 1) {
      const int bit = lowest_bit(layers), layer = 64 * w + bit;
      if (valid_pixels(&g, valid_above, pixels_i[layer * g.size_i + i], pixels_j[layer * g.size_j + j]) == 0) cuboid &= ~(1ul << bit);
    }
    left &= ~run_layers;
  }
  bits |= cuboid;
  observed[word_index(&g, i, j, w)] = bits & valid_layers(&g, w);
}

// Where pixels of a view's image are (0_shared.h).
INLINE uint16 view_pixels(const View* view, uint16 column, uint16 row) {
  const uint columns = ((uint)view->width + VIEW_SQUARE - 1) / VIEW_SQUARE;
  const uint16 square = row / VIEW_SQUARE * columns + column / VIEW_SQUARE;
  return (square * VIEW_SQUARE + row % VIEW_SQUARE) * VIEW_SQUARE + column % VIEW_SQUARE;
}

// Exact membership of points in the space that one view has seen (its pixel there is valid and lies deeper), of those that are asked.
//   depths: all views' images, without signs;  p: in this frame's camera [m]
INLINE int16 knows(const View* view, __global const float* depths, Points p, int16 asked) {
  const Points q = transform_points(&view->to_image, p);
  const float16 scale = 1.0f / q.z, s = q.x * scale, t = q.y * scale;
  const int16 seen = asked & (q.z > 0.0f) & (s >= 0.0f) & (t >= 0.0f) & (s < (float)view->width) & (t < (float)view->height);
  if (lane_bits(seen) == 0) return 0;
  const uint16 pixel = view_pixels(view, convert_uint16(s), convert_uint16(t));
  return seen & (q.z < gather(depths + view->first_pixel, seen ? as_int16(pixel) : 0));
}

// Are points in these voxels, at depths z, at the measured surface that ended their pixel's column, or at most `surface_depth` behind it?
//   depth, column_end: of all pixels;   out pixel: theirs, 0 beside the image
INLINE int16 at_surface(const Grid* g, __global const float* depth, __global const int* column_end, float surface_depth, Voxels v,
                        float16 z, int16 asked, int16* pixel) {
  const int16 s = v.i - g->padding_i, t = v.j - g->padding_j;
  const int16 in_image = asked & (s >= 0) & (t >= 0) & (s < g->width) & (t < g->height) & (convert_float16(v.k) > g->k_min);
  *pixel = in_image ? t * g->width + s : 0;
  if (lane_bits(in_image) == 0) return 0;
  const float16 d = gather(depth, *pixel);
  const int16 ends = (v.k == gather_int(column_end, *pixel)) & (v.k > g->first_pyramid_layer);
  return in_image & (d > 0.0f) & (ends | ((z >= d) & (z <= d + surface_depth)));
}
