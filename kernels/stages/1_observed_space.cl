// Observed space C~ - paper 3.3, eq. (9)-(11).
//
// A depth image pixel is > 0: a measured surface there; < 0: nothing is met up to -depth; 0: no measurement.

// One work item LANES pixels of a row: the first layer that a pixel's ray does not observe, 0 where there is no measurement.
//   in  depth[height][width] [m];  layer_depth[size_k]: z of each layer's centre [m], ascending
//   out column_end[height][width]: layers first_pyramid_layer ... column_end - 1 are observed
//       valid[height][words of 32 pixels]: a bit for each pixel that is valid, as 16-bit halves
__kernel void column_ends(const Grid g, __global const float* depth, __global const float* layer_depth, __global int* column_end,
                          __global ushort* valid) {
  const int chunks_in_row = 2 * image_words(&g), row = get_global_id(0) / chunks_in_row, first = LANES * (get_global_id(0) % chunks_in_row);
  if (row >= g.height) return;
  const int16 column = first + lane_numbers(), pixel = row * g.width + min(column, g.width - 1);
  const float16 d = fabs(gather(depth, pixel));
  const int16 is_valid = (d > 0.0f) & (column < g.width);
  int16 end = clamp(-floor_int16(-layers_at(&g, d)), 0, g.size_k);  // z(end - 1) < d <= z(end), but for rounding
  end += (end > 0) & (gather(layer_depth, max(end - 1, 0)) >= d);
  end -= (end < g.size_k) & (gather(layer_depth, min(end, g.size_k - 1)) < d);
  end = is_valid ? end : 0;
  valid[get_global_id(0)] = (ushort)lane_bits(is_valid);
  if (first + LANES <= g.width) {
    vstore16(end, 0, column_end + row * g.width + first);
  } else {
    int ends[LANES];
    vstore16(end, 0, ends);
    for (int n = 0; first + n < g.width; ++n) column_end[row * g.width + first + n] = ends[n];
  }
}

// Bits below bit n of a word, n in 0 ... 32.
INLINE uint16 bits_below(int16 n) { return n < 32 ? ((uint16)(1) << as_uint16(n)) - 1u : (uint16)(~0u); }

// Bits of pixels in a word of an image's row that starts with the pixel `first`.
//   range: first and one past the last pixel, as 16-bit halves
INLINE uint16 pixel_bits(uint16 range, int first) {
  const int16 from = as_int16(range & 0xffffu) - first, to = as_int16(range >> 16) - first;
  return bits_below(clamp(to, 0, 32)) & ~bits_below(clamp(from, 0, 32));
}

// The cuboid's share of 32 layers: a voxel is observed iff a valid pixel's ray has its sample of that layer in it, that is, iff there is
// one in a fixed rectangle of the image. Valid pixels of a rectangle's rows are joined, a bit a column, for all voxels of a row at once.
//   chunk, j: the first of LANES x SPACE_ROWS voxels;   i/o observed[SPACE_ROWS]: bits of the layers
INLINE void observe_cuboid(const Grid* g, __global const uint* valid, __global const uint* pixels_i, __global const ushort2* pixels_j,
                           __global const ushort2* words_i, int chunk, int j, int first_layer, uint16* observed) {
  const int chunks = grid_chunks(g->size_i), rows_j = LANES * grid_chunks(g->size_j);
  for (int k = first_layer; k < first_layer + 32; ++k) {
    const ushort2 words = words_i[k * chunks + chunk];
    for (int word = words.x; word < words.y; ++word) {
      const uint16 columns = pixel_bits(vload16(k * chunks + chunk, pixels_i), 32 * word);
      for (int n = 0; n < SPACE_ROWS; ++n) {
        const ushort2 rows = pixels_j[k * rows_j + j + n];
        uint joined = 0;
        for (int row = rows.x; row < rows.y; ++row) joined |= valid[row * image_words(g) + word];
        observed[n] |= (columns & joined) != 0u ? (uint16)(1u << (k % 32)) : (uint16)(0);
      }
    }
  }
}

// The pyramid's share: a run up to the end of each column.
INLINE uint16 observe_pyramid(const Grid* g, int16 column_end, int first_layer) {
  return bits_below(clamp(column_end - first_layer, 0, 32)) & ~(uint)bit_run(0, g->first_pyramid_layer - first_layer);
}

// Ends of LANES columns of the grid from (i, j); 0 beside the image.
INLINE int16 ends_of_columns(const Grid* g, __global const int* column_end, int i, int j) {
  const int t = j - g->padding_j;
  if (t < 0 || t >= g->height) return 0;
  const int16 s = i - g->padding_i + lane_numbers();
  const int16 in_image = (s >= 0) & (s < g->width);
  return in_image ? gather_int(column_end, t * g->width + clamp(s, 0, g->width - 1)) : 0;
}

// One work item LANES x SPACE_ROWS columns and a word.
//   in  column_end[height][width], valid[height][words of 32 pixels]: of column_ends
//       pixels_i[layers][chunks of LANES][LANES], pixels_j[layers][chunks][LANES]: first and one past the last pixel whose sample lies
//       there, as 16-bit halves, of the cuboid's layers, filled up to whole words;  words_i[layers][chunks]: the same, of whole chunks
//       and words of 32 pixels
//   out observed: bit field
__kernel void observed_space(const Grid g, __global const int* column_end, __global const uint* valid, __global const uint* pixels_i,
                             __global const ushort2* pixels_j, __global const ushort2* words_i, __global ulong* observed) {
  const int chunks = grid_chunks(g.size_i), chunk = get_global_id(0) % chunks, w = get_global_id(0) / chunks % g.words_k,
            j = SPACE_ROWS * (get_global_id(0) / chunks / g.words_k);
  if (j >= g.size_j) return;
  uint16 low[SPACE_ROWS], high[SPACE_ROWS];
  for (int n = 0; n < SPACE_ROWS; ++n) low[n] = high[n] = 0;
  if (64 * w < g.first_pyramid_layer) {
    observe_cuboid(&g, valid, pixels_i, pixels_j, words_i, chunk, j, 64 * w, low);
    observe_cuboid(&g, valid, pixels_i, pixels_j, words_i, chunk, j, 64 * w + 32, high);
  }
  for (int n = 0; n < SPACE_ROWS && j + n < g.size_j; ++n) {
    const int16 ends = ends_of_columns(&g, column_end, LANES * chunk, j + n);
    low[n] |= observe_pyramid(&g, ends, 64 * w);
    high[n] |= observe_pyramid(&g, ends, 64 * w + 32);
    const ulong16 words = (convert_ulong16(high[n]) << 32 | convert_ulong16(low[n])) & valid_layers(&g, w);
    store_words(words, &g, LANES * chunk, observed + word_index(&g, LANES * chunk, j + n, w));
  }
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
