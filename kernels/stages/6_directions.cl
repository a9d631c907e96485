// Directions from the candidates that are left to the observed space around them: the normals of surfels there - paper 3.5, eq. (15).

// The listed candidates of a chunk: their numbers, of the last ones over and over behind the end; -1 in `exist` for those before it.
INLINE int16 load_chunk(__global const int* list, int count, int chunk, int16* exist) {
  const int16 n = chunk * LANES + lane_numbers();
  *exist = n < count;
  return gather_int(list, min(n, count - 1));
}

// The 27 voxels around a voxel in one number: a bit AROUND(di, dj, dk) for each. The three of a column are beside each other, as in its
// words.
#define AROUND(di, dj, dk) (3 * (3 * ((dj) + 1) + (di) + 1) + (dk) + 1)

// From the centre of a voxel to those of the voxels around it in one layer: x[di + 1], y[dj + 1], z.
typedef struct {
  float16 x[3], y[3], z;
} LayerOffsets;

// x depends on i and the layer alone, and y on j.
INLINE void layer_around(const Grid* g, __global const float* layer_depth, Voxels v, Points center, int dk, LayerOffsets* layer) {
  for (int n = 0; n < 3; ++n) {
    const Points u = voxel_centers(g, layer_depth, (Voxels){v.i + n - 1, v.j + n - 1, v.k + dk});
    layer->x[n] = u.x - center.x;
    layer->y[n] = u.y - center.y;
    layer->z = u.z - center.z;
  }
}

// Which of the layers bit - 1, bit and bit + 1 of a column, whose word is `at`, are observed: bits 0, 1, 2. The word before may have the
// first of them, the next one the last.
INLINE int observed_layers(const Grid* g, __global const ulong* observed, int at, int w, int bit) {
  if (bit > 0 && bit < 63) return (int)(observed[at] >> (bit - 1)) & 7;
  if (bit == 0) return ((int)(observed[at] << 1) & 6) | (w > 0 ? (int)(observed[at - g->size_i] >> 63) : 0);
  return (int)(observed[at] >> 62) | (w + 1 < g->words_k ? (int)(observed[at + g->size_i] & 1) << 2 : 0);
}

// The observed ones of the 27 voxels around one.
INLINE int observed_around(const Grid* g, __global const ulong* observed, int i, int j, int k) {
  const int w = k >> 6, bit = k & 63;
  int around = 0;
  for (int dj = -1; dj <= 1; ++dj)
    for (int di = -1; di <= 1; ++di)
      if (i + di >= 0 && j + dj >= 0 && i + di < g->size_i && j + dj < g->size_j)
        around |= observed_layers(g, observed, word_index(g, i + di, j + dj, w), w, bit) << AROUND(di, dj, -1);
  return around;
}

// One work item a chunk of LANES listed candidates.
//   in  voxels[count]: 64 word + bit of each candidate;  observed: C~
//   out around[LANES chunks]: its observed_around;  directions[chunks][3][LANES]: normal of a surfel there, camera frame, not normalised:
//       the sum of the directions to the observed ones of the 26 voxels around it
__kernel void find_directions(const Grid g, __global const float* layer_depth, __global const ulong* observed, __global const int* voxels,
                              const int count, __global int* around, __global float* directions) {
  const int chunk = get_global_id(0);
  if (chunk * LANES >= count) return;
  int16 exist;
  const Voxels v = voxels_of(&g, load_chunk(voxels, count, chunk, &exist));
  int i[LANES], j[LANES], k[LANES], found[LANES];
  vstore16(v.i, 0, i);
  vstore16(v.j, 0, j);
  vstore16(v.k, 0, k);
  for (int n = 0; n < LANES; ++n) found[n] = observed_around(&g, observed, i[n], j[n], k[n]);
  const int16 bits = vload16(0, found);
  vstore16(bits, chunk, around);

  const Points center = voxel_centers(&g, layer_depth, v);
  Points sum = {0.0f, 0.0f, 0.0f};
  for (int dk = -1; dk <= 1; ++dk) {
    LayerOffsets layer;
    layer_around(&g, layer_depth, v, center, dk, &layer);
    for (int n = 0; n < 9; ++n) {
      const int16 is_set = (bits & 1 << AROUND(n % 3 - 1, n / 3 - 1, dk)) != 0;
      if (lane_bits(is_set) == 0) continue;
      const Points direction = {layer.x[n % 3], layer.y[n / 3], layer.z};
      const float16 distance = lengths(direction);
      sum.x += is_set ? direction.x / distance : 0.0f;
      sum.y += is_set ? direction.y / distance : 0.0f;
      sum.z += is_set ? direction.z / distance : 0.0f;
    }
  }
  vstore16(sum.x, 3 * chunk, directions);
  vstore16(sum.y, 3 * chunk + 1, directions);
  vstore16(sum.z, 3 * chunk + 2, directions);
}
