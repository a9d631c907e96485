// The non-uniform voxel grid (NUVG) of a view - paper 3.1, eq. (2)-(3), supplement A - and the layout of its bit fields.
//
// Grid coordinates (i, j, k) are real numbers; the voxel (i, j, k) is the cell around whole ones. F maps the camera frame to them, also
// beyond the grid, and is continuous at z_min:
//   z <  z_min, the cuboid:   (x fx / z_min + center_i, y fy / z_min + center_j, z / delta_min + padding_k)
//   z >= z_min, the pyramid:  (x fx / z + center_i,     y fy / z + center_j,     f ln(z / z_min) + k_min)
//
// A bit field has a bit for each voxel. Bits run along k in 64-bit words, and neighbouring words are neighbours along i:
//   bit k % 64 of word (j words_k + k / 64) size_i + i.
// The field of candidates has the same bits, but its words lie tile by tile of VIEW_TILE x VIEW_TILE columns, which are asked for, and
// listed, together (tile_word_index). There columns beyond the grid have words as well, whose bits are 0.

// Edge of voxels at depths z [m].
INLINE floatv voxel_size(const Grid* g, floatv z) { return divided(fmax(z, g->z_min), g->f); }

// F along k: grid coordinates of depths z [m].
INLINE floatv layers_at(const Grid* g, floatv z) {
  return z < g->z_min ? divided(z, g->delta_min) + (float)g->padding_k
                      : g->f * natural_log(divided(fmax(z, g->z_min), g->z_min)) + g->k_min;
}

// F: points of the camera frame [m] in grid coordinates.
INLINE Points to_grid(const Grid* g, Points p) {
  const floatv depth = fmax(p.z, g->z_min);
  return (Points){divided(p.x * g->fx, depth) + g->center_i, divided(p.y * g->fy, depth) + g->center_j, layers_at(g, p.z)};
}

typedef struct {
  intv i, j, k;
} Voxels;

// The voxels that points of the camera frame lie in, which may be beyond the grid.
INLINE Voxels voxels_at(const Grid* g, Points p) {
  const Points c = to_grid(g, p);
  return (Voxels){floor_int(c.x + 0.5f), floor_int(c.y + 0.5f), floor_int(c.z + 0.5f)};
}

INLINE intv inside_grid(const Grid* g, Voxels v) {
  return MARK(v.i >= 0) & MARK(v.j >= 0) & MARK(v.k >= 0) & MARK(v.i < g->size_i) & MARK(v.j < g->size_j) & MARK(v.k < g->size_k);
}

INLINE intv same_voxels(Voxels a, Voxels b) { return MARK(a.i == b.i) & MARK(a.j == b.j) & MARK(a.k == b.k); }

// F^-1 of the centres of voxels in the grid's layers.
//   layer_depth[size_k]: z of each layer's centre [m]
INLINE Points voxel_centers(const Grid* g, __global const float* layer_depth, Voxels v) {
  Points p;
  p.z = gather_float(layer_depth, clamp(v.k, 0, g->size_k - 1));
  const floatv depth = convert_floatv(v.k) < g->k_min ? g->z_min : p.z;
  p.x = divided((convert_floatv(v.i) - g->center_i) * depth, g->fx);
  p.y = divided((convert_floatv(v.j) - g->center_j) * depth, g->fy);
  return p;
}

INLINE int word_index(const Grid* g, int i, int j, int w) { return (j * g->words_k + w) * g->size_i + i; }

#define TILE_COLUMNS (VIEW_TILE * VIEW_TILE)

INLINE int grid_tiles(int size) { return (size + VIEW_TILE - 1) / VIEW_TILE; }
INLINE int tile_word_index(const Grid* g, int i, int j, int w) {
  return ((j / VIEW_TILE * g->words_k + w) * grid_tiles(g->size_i) + i / VIEW_TILE) * TILE_COLUMNS + j % VIEW_TILE * VIEW_TILE +
         i % VIEW_TILE;
}

// The 32-bit halves of words that voxels' bits are in, in word_index's order and in tile_word_index's; and the bits there.
INLINE intv voxel_halves(const Grid* g, Voxels v) { return 2 * ((v.j * g->words_k + (v.k >> 6)) * g->size_i + v.i) + ((v.k >> 5) & 1); }
INLINE intv candidate_halves(const Grid* g, Voxels v) {
  const intv tile = (v.j / VIEW_TILE * g->words_k + (v.k >> 6)) * grid_tiles(g->size_i) + v.i / VIEW_TILE;
  return 2 * (tile * TILE_COLUMNS + v.j % VIEW_TILE * VIEW_TILE + v.i % VIEW_TILE) + ((v.k >> 5) & 1);
}
INLINE intv half_bits(intv k) { return (intv)(1) << (k & 31); }

// The voxels of candidates, which are listed by the numbers of their bits: 64 tile_word_index + bit.
INLINE Voxels voxels_of(const Grid* g, intv numbers) {
  const intv tiles = numbers / (64 * TILE_COLUMNS), columns = numbers / 64 & (TILE_COLUMNS - 1);
  const intv rows = quotients(tiles, grid_tiles(g->size_i)), tiles_j = quotients(rows, g->words_k);
  Voxels v;
  v.i = VIEW_TILE * (tiles - rows * grid_tiles(g->size_i)) + columns % VIEW_TILE;
  v.j = VIEW_TILE * tiles_j + columns / VIEW_TILE;
  v.k = 64 * (rows - tiles_j * g->words_k) + (numbers & 63);
  return v;
}

// Bits [from, to) of a word; both are clamped to 0 ... 64.
INLINE ulong bit_run(int from, int to) {
  from = clamp(from, 0, 64);
  to = clamp(to, 0, 64);
  if (from >= to) return 0;
  const ulong below_to = to == 64 ? ~0ul : (1ul << to) - 1;
  return below_to & ~((1ul << from) - 1);  // from < to <= 64, so the shift is defined
}

INLINE int lowest_bit(ulong bits) { return 63 - (int)clz(bits & -bits); }
INLINE int highest_bit(ulong bits) { return 63 - (int)clz(bits); }

// Bits of the word's layers that exist; the last word may have fewer than 64.
INLINE ulong valid_layers(const Grid* g, int w) { return bit_run(0, g->size_k - 64 * w); }

// Words of 32 pixels that hold a row of the working image.
INLINE int image_words(const Grid* g) { return (g->width + 31) / 32; }
