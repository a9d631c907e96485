// Observed space C~ - paper 3.3, eq. (9)-(11): the voxels that this frame's camera has seen to be free.
//
// A pixel of depth[height][width] [m] is > 0 where there is a measured surface, < 0 where nothing is met up to -depth, and 0 where there is
// no measurement. In the pyramid the observed voxels of a column are a run that ends at its pixel's depth; in the cuboid a voxel is
// observed iff a valid pixel's ray has its sample of that layer in it, which depends on the pixels' validity alone.

// The first layer that each pixel's ray does not observe. One work item handles LANES pixels of a row; work item n starts at pixel
// LANES n of rows that are filled up to image_words words of 32 pixels.
//   in  depth[height][width] [m];  layer_depth[size_k]: z of each layer's centre [m], ascending
//   out column_end[height][width]: layers first_pyramid_layer ... column_end - 1 are observed; 0 where there is no measurement
//       valid[height][image_words]: a bit for each pixel that is valid; at width 1 zero before
__kernel void column_ends(const Grid g, __global const float* depth, __global const float* layer_depth, __global int* column_end,
                          __global uint* valid) {
  const int chunks_in_row = 32 / LANES * image_words(&g), row = get_global_id(0) / chunks_in_row,
            first = LANES * (get_global_id(0) % chunks_in_row);
  if (row >= g.height) return;
  const intv column = first + lane_numbers(), pixel = row * g.width + min(column, g.width - 1);
  const floatv d = fabs(gather_float(depth, pixel));
  const intv is_valid = MARK(d > 0.0f) & MARK(column < g.width);
  intv end = clamp(ceil_int(layers_at(&g, d)), 0, g.size_k);  // z(end - 1) < d <= z(end), but for rounding
  end += MARK(end > 0) & MARK(gather_float(layer_depth, max(end - 1, 0)) >= d);
  end -= MARK(end < g.size_k) & MARK(gather_float(layer_depth, min(end, g.size_k - 1)) < d);
  end = is_valid ? end : 0;
  store_lane_bits(lane_bits(is_valid), get_global_id(0), valid);
  store_first(end, g.width - first, column_end + row * g.width + first);
}

// Bits below bit n of a word of 32, n in 0 ... 32.
INLINE uintv bits_below(intv n) { return n < 32 ? ((uintv)(1) << as_uintv(n)) - 1u : (uintv)(~0u); }

// Bits of pixels in a word of an image's row that starts with the pixel `first`.
//   range: first and one past the last pixel, as 16-bit halves
INLINE uintv pixel_bits(uintv range, int first) {
  const intv from = as_intv(range & 0xffffu) - first, to = as_intv(range >> 16) - first;
  return bits_below(clamp(to, 0, 32)) & ~bits_below(clamp(from, 0, 32));
}

// The cuboid's share of 32 layers of LANES x `row_count` columns: a voxel is observed iff there is a valid pixel in a fixed rectangle of
// the image. Valid pixels of a rectangle's rows are joined, a bit for each column of pixels, for all voxels of a row of the grid at once.
//   i, j: the first of the columns;   i/o observed[row_count]: bits of the layers
#if LANES > 1
INLINE void observe_cuboid(const Grid* g, __global const uint* valid, __global const uint* pixels_i, __global const ushort2* pixels_j,
                           __global const ushort2* words_i, int i, int j, int row_count, int first_layer, uintv* observed) {
  const int chunks_i = (g->size_i + TABLE_CHUNK - 1) / TABLE_CHUNK, chunks_j = (g->size_j + TABLE_CHUNK - 1) / TABLE_CHUNK;
  for (int k = first_layer; k < first_layer + 32; ++k) {
    const ushort2 words = words_i[k * chunks_i + i / TABLE_CHUNK];
    for (int word = words.x; word < words.y; ++word) {
      const uintv columns = pixel_bits(vloadv(0, pixels_i + k * chunks_i * TABLE_CHUNK + i), 32 * word);
      if (!any_lane(MARK(columns != 0u))) continue;
      for (int n = 0; n < row_count; ++n) {
        const ushort2 rows = pixels_j[k * chunks_j * TABLE_CHUNK + j + n];
        uint joined = 0;
        for (int row = rows.x; row < rows.y; ++row) joined |= valid[row * image_words(g) + word];
        observed[n] |= (columns & joined) != 0u ? (uintv)(1u << (k % 32)) : (uintv)(0);
      }
    }
  }
}
#else
// At width 1 a work-group has a row of the grid. Its work items join the rows of pixels, each for some layers and words, and then look at
// some columns of the grid each.
//   first_word, count: of an image row's words
//   out joined[32][JOINED_WORDS + 1]: for each layer; observe_cuboid reads one word more, but does not use its bits
#define JOINED_WORDS 32  // of an image's row, at a time
INLINE void join_rows(const Grid* g, __global const uint* valid, __global const ushort2* pixels_j, int j, int first_layer, int first_word,
                      int count, __local uint (*joined)[JOINED_WORDS + 1]) {
  const int chunks_j = (g->size_j + TABLE_CHUNK - 1) / TABLE_CHUNK;
  // Neighbours have one word of different layers. Where most pixels are valid, a few of many rows fill it.
  for (int n = get_local_id(0); n < 32 * count; n += get_local_size(0)) {
    const int layer = n % 32, word = n / 32;
    const ushort2 rows = pixels_j[(first_layer + layer) * chunks_j * TABLE_CHUNK + j];
    const int columns = g->width - 32 * (first_word + word);
    uint found = columns < 32 ? UINT_MAX << columns : 0;  // nobody asks for columns behind the image
    for (int row = rows.x; row < rows.y && found != UINT_MAX; ++row) found |= valid[row * image_words(g) + first_word + word];
    joined[layer][word] = found;
  }
}

INLINE uint observe_cuboid(const Grid* g, __local uint (*joined)[JOINED_WORDS + 1], __global const uint* pixels_i, int i, int first_layer,
                           int first_word, int count) {
  const int chunks_i = (g->size_i + TABLE_CHUNK - 1) / TABLE_CHUNK;
  uint observed = 0;
  for (int layer = 0; layer < 32; ++layer) {
    const uint range = pixels_i[(first_layer + layer) * chunks_i * TABLE_CHUNK + i];
    const int from = (int)(range & 0xffffu) - 32 * first_word, to = (int)(range >> 16) - 32 * first_word;
    uint found = 0;
    if (from >= 0 && from < to && to - from < 32 && to <= 32 * count) {
      const ulong words = (ulong)joined[layer][from / 32 + 1] << 32 | joined[layer][from / 32];
      found = (uint)(words >> (from % 32)) & ((1u << (to - from)) - 1);
    } else {
      const int end = min((to + 31) / 32, count);
      for (int word = max(from / 32, 0); word < end && found == 0; ++word)
        found = pixel_bits(range, 32 * (first_word + word)) & joined[layer][word];
    }
    observed |= found != 0 ? 1u << layer : 0;
  }
  return observed;
}
#endif

// The pyramid's share of 32 layers: a run up to the end of each column.
INLINE uintv observe_pyramid(const Grid* g, intv column_end, int first_layer) {
  return bits_below(clamp(column_end - first_layer, 0, 32)) & ~(uint)bit_run(0, g->first_pyramid_layer - first_layer);
}

// Ends of LANES columns of the grid from (i, j); 0 beside the image.
INLINE intv ends_of_columns(const Grid* g, __global const int* column_end, int i, int j) {
  const int t = j - g->padding_j;
  if (t < 0 || t >= g->height) return 0;
  const intv s = i - g->padding_i + lane_numbers();
  const intv in_image = MARK(s >= 0) & MARK(s < g->width);
  return in_image ? gather_int(column_end, t * g->width + clamp(s, 0, g->width - 1)) : 0;
}

// One work item handles LANES x SPACE_ROWS columns and a word of their layers; work item (row * words_k + w) * chunks_of(size_i) + chunk
// has the columns from (LANES chunk, SPACE_ROWS row). At width 1 work-group 2 words_k j + half has half a word of all columns of row j.
//   in  column_end, valid: of column_ends
//       pixels_i[layers][chunks][TABLE_CHUNK], pixels_j[layers][chunks][TABLE_CHUNK]: for each voxel along i, along j,
//         first and one past the last column, row of pixels whose samples lie there, as 16-bit halves
//       words_i[layers][chunks]: for each chunk of pixels_i, first and one past the last word of 32 pixels that its columns lie in; for
//         width 1 there is no need of it
//       These tables have the cuboid's layers, filled up to whole words, and voxels filled up to whole chunks of TABLE_CHUNK.
//   out observed: bit field
#if LANES == 1
__kernel void observed_space(const Grid g, __global const int* column_end, __global const uint* valid, __global const uint* pixels_i,
                             __global const ushort2* pixels_j, __global const ushort2* words_i, __global ulong* observed) {
  __local uint joined[32][JOINED_WORDS + 1];
  const int parts = 2 * g.words_k, part = get_group_id(0) % parts, j = get_group_id(0) / parts, item = get_local_id(0),
            items = get_local_size(0), words = 32 * part < g.first_pyramid_layer ? image_words(&g) : 0;
  const uint layers = (uint)(valid_layers(&g, part / 2) >> (32 * (part % 2)));
  __global uint* row = (__global uint*)(observed + word_index(&g, 0, j, part / 2)) + part % 2;
  // Once at least, for the pyramid.
  for (int first_word = 0; first_word == 0 || first_word < words; first_word += JOINED_WORDS) {
    const int count = min(words - first_word, JOINED_WORDS);
    join_rows(&g, valid, pixels_j, j, 32 * part, first_word, count, joined);
    GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
    for (int i = item; i < g.size_i; i += items) {
      uint bits = first_word > 0 ? row[2 * i] : observe_pyramid(&g, ends_of_columns(&g, column_end, i, j), 32 * part);
      if (count > 0) bits |= observe_cuboid(&g, joined, pixels_i, i, 32 * part, first_word, count);
      row[2 * i] = bits & layers;
    }
    GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
  }
}
#else
__kernel void observed_space(const Grid g, __global const int* column_end, __global const uint* valid, __global const uint* pixels_i,
                             __global const ushort2* pixels_j, __global const ushort2* words_i, __global ulong* observed) {
  const int chunks = chunks_of(g.size_i), i = LANES * (get_global_id(0) % chunks), w = get_global_id(0) / chunks % g.words_k,
            j = SPACE_ROWS * (get_global_id(0) / chunks / g.words_k);
  if (j >= g.size_j) return;
  uintv low[SPACE_ROWS], high[SPACE_ROWS];
  for (int n = 0; n < SPACE_ROWS; ++n) low[n] = high[n] = 0;
  if (64 * w < g.first_pyramid_layer) {
    observe_cuboid(&g, valid, pixels_i, pixels_j, words_i, i, j, SPACE_ROWS, 64 * w, low);
    observe_cuboid(&g, valid, pixels_i, pixels_j, words_i, i, j, SPACE_ROWS, 64 * w + 32, high);
  }
  for (int n = 0; n < SPACE_ROWS && j + n < g.size_j; ++n) {
    const intv ends = ends_of_columns(&g, column_end, i, j + n);
    low[n] |= observe_pyramid(&g, ends, 64 * w);
    high[n] |= observe_pyramid(&g, ends, 64 * w + 32);
    const ulongv words = (convert_ulongv(high[n]) << 32 | convert_ulongv(low[n])) & valid_layers(&g, w);
    store_first(words, g.size_i - i, observed + word_index(&g, i, j + n, w));
  }
}
#endif

// Which points lie at the measured surface that ended their pixel's column, or at most `surface_depth` [m] behind it?
//   v, z: voxels and depths of the points;  depth, column_end: of all pixels;   out pixel: theirs, 0 beside the image
INLINE intv at_surface(const Grid* g, __global const float* depth, __global const int* column_end, float surface_depth, Voxels v, floatv z,
                       intv asked, intv* pixel) {
  const intv s = v.i - g->padding_i, t = v.j - g->padding_j;
  const intv in_image =
      asked & MARK(s >= 0) & MARK(t >= 0) & MARK(s < g->width) & MARK(t < g->height) & MARK(convert_floatv(v.k) > g->k_min);
  *pixel = in_image ? t * g->width + s : 0;
  if (!any_lane(in_image)) return 0;
  const floatv d = gather_float(depth, *pixel);
  const intv ends = MARK(v.k == gather_int(column_end, *pixel)) & MARK(v.k > g->first_pyramid_layer);
  return in_image & MARK(d > 0.0f) & (ends | (MARK(z >= d) & MARK(z <= d + surface_depth)));
}
