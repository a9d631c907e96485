// Directions from the candidates that are left to the observed space around them: the normals of surfels there - paper 3.5, eq. (15).
// Candidates are listed by the numbers of their bits, 64 tile_word_index + bit, and handled in chunks of LANES.

// A number with a bit AROUND(di, dj, dk) for each of the 27 voxels around a voxel. The three of a column are beside each other, as in the
// words of bit fields.
#define AROUND(di, dj, dk) (3 * (3 * ((dj) + 1) + (di) + 1) + (dk) + 1)

// From the centres of LANES voxels to those of the voxels around them in one layer: x[di + 1], y[dj + 1], z [m].
typedef struct {
  floatv x[3], y[3], z;
} LayerOffsets;

// The offsets in layer dk: x depends on i and the layer alone, and y on j.
INLINE void layer_around(const Grid* g, __global const float* layer_depth, Voxels v, Points center, int dk, LayerOffsets* layer) {
  for (int n = 0; n < 3; ++n) {
    const Points u = voxel_centers(g, layer_depth, (Voxels){v.i + n - 1, v.j + n - 1, v.k + dk});
    layer->x[n] = u.x - center.x;
    layer->y[n] = u.y - center.y;
    layer->z = u.z - center.z;
  }
}

// Which of the layers bit - 1, bit and bit + 1 of the column of word `at` are observed: bits 0, 1, 2. The first of them may be in the word
// below, w - 1, and the last one in the word above.
INLINE int observed_layers(const Grid* g, __global const ulong* observed, int at, int w, int bit) {
  if (bit > 0 && bit < 63) return (int)(observed[at] >> (bit - 1)) & 7;
  if (bit == 0) return ((int)(observed[at] << 1) & 6) | (w > 0 ? (int)(observed[at - g->size_i] >> 63) : 0);
  return (int)(observed[at] >> 62) | (w + 1 < g->words_k ? (int)(observed[at + g->size_i] & 1) << 2 : 0);
}

// The observed ones of the 27 voxels around one.
INLINE int observed_around(const Grid* g, __global const ulong* observed, int i, int j, int k) {
  const int w = k >> 6, bit = k & 63;
  int around = 0;
  // Most voxels: all columns are in the grid, and the three layers of each are in one word.
  if (i > 0 && j > 0 && i + 1 < g->size_i && j + 1 < g->size_j && bit > 0 && bit < 63) {
    const int at = word_index(g, i, j, w), row = word_index(g, i, j + 1, w) - at;
    for (int dj = -1; dj <= 1; ++dj)
      for (int di = -1; di <= 1; ++di) around |= observed_layers(g, observed, at + dj * row + di, w, bit) << AROUND(di, dj, -1);
    return around;
  }
  for (int dj = -1; dj <= 1; ++dj)
    for (int di = -1; di <= 1; ++di)
      if (i + di >= 0 && j + dj >= 0 && i + di < g->size_i && j + dj < g->size_j)
        around |= observed_layers(g, observed, word_index(g, i + di, j + dj, w), w, bit) << AROUND(di, dj, -1);
  return around;
}

// One work item handles a chunk of LANES listed candidates.
//   in  voxels[length[0]]: their numbers;  observed: bit field C~;  layer_depth[size_k]
//   out around[LANES chunks]: observed_around each candidate
//       directions[chunks][3][LANES]: x, y and z of the normal of a surfel there, camera frame, not normalised: the sum of the unit vectors
//       to the observed ones of the 26 voxels around it
__kernel void find_directions(const Frame f, __global const float* layer_depth, __global const ulong* observed, __global const int* voxels,
                              __global const uint* length, __global int* around, __global float* directions) {
  const int chunk = get_global_id(0), count = (int)length[0];
  if (chunk * LANES >= count) return;
  intv exist;
  const Voxels v = voxels_of(&f.grid, load_chunk(voxels, count, chunk, &exist));
  int i[LANES], j[LANES], k[LANES], found[LANES];
  vstorev(v.i, 0, i);
  vstorev(v.j, 0, j);
  vstorev(v.k, 0, k);
  for (int n = 0; n < LANES; ++n) found[n] = observed_around(&f.grid, observed, i[n], j[n], k[n]);
  const intv bits = vloadv(0, found);
  vstorev(bits, chunk, around);

  const Points center = voxel_centers(&f.grid, layer_depth, v);
  Points sum = {0.0f, 0.0f, 0.0f};
  for (int dk = -1; dk <= 1; ++dk) {
    LayerOffsets layer;
    layer_around(&f.grid, layer_depth, v, center, dk, &layer);
    for (int n = 0; n < 9; ++n) {
      const intv is_set = MARK((bits & 1 << AROUND(n % 3 - 1, n / 3 - 1, dk)) != 0);
      if (!any_lane(is_set)) continue;
      const Points direction = {layer.x[n % 3], layer.y[n / 3], layer.z};
      const floatv distance = lengths(direction);
      sum.x += is_set ? divided(direction.x, distance) : 0.0f;
      sum.y += is_set ? divided(direction.y, distance) : 0.0f;
      sum.z += is_set ? divided(direction.z, distance) : 0.0f;
    }
  }
  vstorev(sum.x, 3 * chunk, directions);
  vstorev(sum.y, 3 * chunk + 1, directions);
  vstorev(sum.z, 3 * chunk + 2, directions);
}

// The directions of a chunk, and those of any listed candidates.
INLINE Points load_directions(__global const float* directions, int chunk) {
  return (Points){vloadv(3 * chunk, directions), vloadv(3 * chunk + 1, directions), vloadv(3 * chunk + 2, directions)};
}
INLINE Points gather_directions(__global const float* directions, intv numbers) {
  const intv at = numbers / LANES * 3 * LANES + numbers % LANES;
  return (Points){gather_float(directions, at), gather_float(directions, at + LANES), gather_float(directions, at + 2 * LANES)};
}
