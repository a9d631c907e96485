// Recent views: our addition to the paper. A candidate whose centre a kept view has seen is known: no surfel there.

// So many views are asked at first before the candidates left are listed anew.
#define FIRST_VIEWS 6

// So many of a tile's candidates show which views should be asked first.
#define PROBES 2

// What a work-group knows of the tiles of a word of the bit fields, and of one of them.
typedef struct {
  ulong words[TILE_COLUMNS];                           // candidates
  ulong layers;                                        // that have one in any column
  ushort entries[TILE_COLUMNS * VIEW_TILE_K + LANES];  // the tile's candidates, VIEW_TILE_K column + layer
  uint entry_count;
  float centers[TILE_COLUMNS][3][LANES];  // of the entries, by chunk
  ushort open[TILE_COLUMNS];              // entries that are not settled, a bit each, by chunk
  ushort chunks[TILE_COLUMNS];            // that have such: work item n's are chunks[n], chunks[n + work items] ...
  ushort views[MOST_VIEWS];               // to be asked, in this order
  uint view_count;
  uint likely_views;  // those of the first LANES that have been asked because of the probes, a bit each
} Tile;

INLINE ulong all_bits(ulong8 words) {
  const ulong4 of_4 = words.lo | words.hi;
  const ulong2 of_2 = of_4.lo | of_4.hi;
  return of_2.x | of_2.y;
}

// Loads the words of tiles one above the other.
INLINE void load_words(__global const ulong* candidates, __local Tile* own) {
  const int lane = get_local_id(0), lanes = get_local_size(0);
  for (int row = lane; row < VIEW_TILE; row += lanes) vstore8(vload8(row, candidates), row, own->words);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (lane == 0) {
    ulong8 words = 0;
    for (int row = 0; row < VIEW_TILE; ++row) words |= vload8(row, own->words);
    own->layers = all_bits(words);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
}

INLINE uint tile_layers(ulong word, int3 tile) { return (uint)(word >> (tile.z * VIEW_TILE_K % 64)) & ((1u << VIEW_TILE_K) - 1); }

// Lists a tile's candidates. One work item does it, and so the next ones.
INLINE void list_entries(__local Tile* own, int3 tile) {
  uint count = 0;
  for (int column = 0; column < TILE_COLUMNS; ++column)
    for (uint left = tile_layers(own->words[column], tile); left != 0; left &= left - 1)
      own->entries[count++] = (ushort)(column * VIEW_TILE_K + lowest_lane(left));
  own->entry_count = count;
}

// Takes those off the list that are settled.
INLINE void drop_settled(__local Tile* own) {
  uint count = 0;
  for (uint first = 0; first < own->entry_count; first += LANES)
    for (uint left = own->open[first / LANES]; left != 0; left &= left - 1) own->entries[count++] = own->entries[first + lowest_lane(left)];
  own->entry_count = count;
}

// Puts the candidates left in the place of the tile's.
INLINE void keep_entries(__local Tile* own, int3 tile) {
  const int first_bit = tile.z * VIEW_TILE_K % 64;
  for (int column = 0; column < TILE_COLUMNS; ++column) own->words[column] &= ~(((1ul << VIEW_TILE_K) - 1) << first_bit);
  for (uint n = 0; n < own->entry_count; ++n)
    own->words[own->entries[n] / VIEW_TILE_K] |= 1ul << (first_bit + own->entries[n] % VIEW_TILE_K);
}

// All points near the candidates of a tile.
INLINE void find_candidates_box(const Grid* g, __local const Tile* own, int3 tile, __global const float* layer_depth, float min_gap,
                                Box* box) {
  const ulong mask = ((1ul << VIEW_TILE_K) - 1) << (tile.z * VIEW_TILE_K % 64);
  ulong8 of_columns = 0;
  uint rows = 0, columns = 0;
  for (int row = 0; row < VIEW_TILE; ++row) {
    const ulong8 words = vload8(row, own->words) & mask;
    of_columns |= words;
    rows |= (uint)(all_bits(words) != 0) << row;
  }
  ulong each[VIEW_TILE];
  vstore8(of_columns, 0, each);
  for (int column = 0; column < VIEW_TILE; ++column) columns |= (uint)(each[column] != 0) << column;
  const uint layers = tile_layers(all_bits(of_columns), tile);
  const int3 corner = tile * (int3)(VIEW_TILE, VIEW_TILE, VIEW_TILE_K);
  *box = tile_box(g, layer_depth, corner + (int3)(lowest_lane(columns), lowest_lane(rows), lowest_lane(layers)),
                  corner + 31 - (int3)((int)clz(columns), (int)clz(rows), (int)clz(layers)), min_gap);
}

// How many of PROBES candidates of a tile each of LANES views knows, but for rounding: it decides who is asked first, no more.
INLINE int16 count_known(const Grid* g, int3 tile, __global const float* layer_depth, __global const float* lanes,
                         __global const ushort* depths, float depth_step, __local const Tile* own) {
  const float16 r00 = vload16(0, lanes), r01 = vload16(1, lanes), r02 = vload16(2, lanes);
  const float16 r10 = vload16(3, lanes), r11 = vload16(4, lanes), r12 = vload16(5, lanes);
  const float16 r20 = vload16(6, lanes), r21 = vload16(7, lanes), r22 = vload16(8, lanes);
  const float16 t0 = vload16(9, lanes), t1 = vload16(10, lanes), t2 = vload16(11, lanes);
  const float16 fx = vload16(12, lanes), fy = vload16(13, lanes), cx = vload16(14, lanes) + 0.5f, cy = vload16(15, lanes) + 0.5f;
  const float16 width = vload16(16, lanes), height = vload16(17, lanes);
  const uint16 first_pixel = as_uint16(vload16(18, lanes));
  int16 counts = 0;
  for (int n = 0; n < PROBES; ++n) {
    const int entry = own->entries[(own->entry_count - 1) * n / (PROBES - 1)], column = entry / VIEW_TILE_K;
    const float z = layer_depth[tile.z * VIEW_TILE_K + entry % VIEW_TILE_K], width_there = fmax(z, g->z_min);
    const float x = ((float)(tile.x * VIEW_TILE + column % VIEW_TILE) - g->center_i) * width_there / g->fx,
                y = ((float)(tile.y * VIEW_TILE + column / VIEW_TILE) - g->center_j) * width_there / g->fy;
    const float16 depth = r20 * x + r21 * y + r22 * z + t2, scale = 1.0f / depth;
    const float16 s = (r00 * x + r01 * y + r02 * z + t0) * fx * scale + cx, t = (r10 * x + r11 * y + r12 * z + t1) * fy * scale + cy;
    const int16 seen = (depth > 0.0f) & (s >= 0.0f) & (t >= 0.0f) & (s < width) & (t < height);
    const uint16 pixel = first_pixel + view_pixels(convert_uint16(width), convert_uint16(s), convert_uint16(t));
    counts -= seen & (depth < view_depths(depths, seen ? as_int16(pixel) : 0, depth_step));
  }
  return counts;
}

// Lists those of the first LANES views that know some of the probes, those that know most first.
INLINE void list_likely_views(const Grid* g, int3 tile, __global const float* layer_depth, __global const View* views,
                              __global const float* lanes, __global const ushort* depths, __local Tile* own) {
  const int16 counts = count_known(g, tile, layer_depth, lanes, depths, views->depth_step, own);
  uint count = 0;
  for (int known = PROBES; known > 0; --known)
    for (uint left = lane_bits(counts == known); left != 0; left &= left - 1) own->views[count++] = (ushort)lowest_lane(left);
  own->view_count = count;
  own->likely_views = lane_bits(counts > 0);
}

// Lists the others that may know something near a tile's candidates.
INLINE void list_views(__local Tile* own, __global const ushort* tile_views, int view_groups) {
  uint count = 0;
  for (int group = 0; group < view_groups; ++group) {
    uint left = tile_views[group];
    if (group == 0) left &= ~own->likely_views;
    for (; left != 0; left &= left - 1) own->views[count++] = (ushort)(group * LANES + lowest_lane(left));
  }
  own->view_count = count;
}

// Makes a work item's chunks of the entries; returns how many there are.
INLINE uint open_chunks(const Grid* g, int3 tile, __global const float* layer_depth, __local Tile* own) {
  const int lane = get_local_id(0), lanes = get_local_size(0), entries = own->entry_count;
  uint count = 0;
  for (int chunk = lane; chunk * LANES < entries; chunk += lanes) {
    const int16 exist = lane_numbers() < entries - chunk * LANES;
    const int16 candidate = exist ? convert_int16(vload16(chunk, own->entries)) : 0, column = candidate / VIEW_TILE_K;
    const Voxels v = {tile.x * VIEW_TILE + column % VIEW_TILE, tile.y * VIEW_TILE + column / VIEW_TILE,
                      tile.z * VIEW_TILE_K + candidate % VIEW_TILE_K};
    const Points center = voxel_centers(g, layer_depth, v);
    vstore16(center.x, 0, own->centers[chunk][0]);
    vstore16(center.y, 0, own->centers[chunk][1]);
    vstore16(center.z, 0, own->centers[chunk][2]);
    own->open[chunk] = (ushort)lane_bits(exist);
    own->chunks[count++ * lanes + lane] = (ushort)chunk;
  }
  return count;
}

// Asks a view of all chunks of a work item, one after the other: what is asked of one does not wait for another, and no branch has to be
// guessed. Returns how many have entries left.
INLINE uint ask_view(const View* view, __global const ushort* depths, uint chunks, __local Tile* own) {
  const int lane = get_local_id(0), lanes = get_local_size(0);
  uint left = 0;
  for (uint n = 0; n < chunks; ++n) {
    const int chunk = own->chunks[n * lanes + lane];
    const Points center = {vload16(0, own->centers[chunk][0]), vload16(0, own->centers[chunk][1]), vload16(0, own->centers[chunk][2])};
    const int16 open = lane_marks(own->open[chunk]);
    const uint still = lane_bits(open & ~knows(view, depths, center, open));
    own->open[chunk] = (ushort)still;
    own->chunks[left * lanes + lane] = (ushort)chunk;
    left += still != 0 ? 1 : 0;
  }
  return left;
}

// Asks the listed views of a tile's candidates, and drops those that one knows. The first views settle most of them; those left are listed
// anew before more views are asked, FIRST_VIEWS at first, then twice as many and so on, so that vectors have few lanes to spare.
INLINE void ask_views(const Grid* g, int3 tile, __global const float* layer_depth, __global const View* views,
                      __global const ushort* depths, __local Tile* own) {
  for (uint first = 0, count = FIRST_VIEWS; first < own->view_count && own->entry_count != 0; first += count, count *= 2) {
    const uint last = min(first + count, own->view_count);
    uint chunks = open_chunks(g, tile, layer_depth, own);
    for (uint n = first; n < last && chunks != 0; ++n) {
      const View view = views[own->views[n]];
      chunks = ask_view(&view, depths, chunks, own);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (get_local_id(0) == 0) drop_settled(own);
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}

// One work-group VIEW_TILE x VIEW_TILE columns and a word's layers: 64 / VIEW_TILE_K tiles, each of VIEW_TILE_K layers.
//   in  views[view_count];  view_lanes: the same, by lanes;  depths: their images, and the largest depth of each block of them;
//       layer_depth[size_k]
//   out tile_views[tiles][groups of LANES views]: of tiles with candidates left: a bit for each view that may know something near them
//   i/o candidates: those that a view knows are cleared
__kernel void settle_candidates(const Grid g, const float min_gap, __global const View* views, __global const float* view_lanes,
                                const int view_count, __global const ushort* depths, __global const float* layer_depth,
                                __global ushort* tile_views, __global ulong* candidates) {
  const int lane = get_local_id(0), lanes = get_local_size(0), tiles_of_word = 64 / VIEW_TILE_K,
            view_groups = (view_count + LANES - 1) / LANES;
  const int group = get_group_id(0), tiles_i = grid_tiles(g.size_i);
  __global ulong* own_candidates = candidates + group * TILE_COLUMNS;
  __local Tile own;
  load_words(own_candidates, &own);
  if (own.layers == 0) return;

  int3 tile = (int3)(group % tiles_i, group / tiles_i / g.words_k, group / tiles_i % g.words_k * tiles_of_word);
  for (const int last_tile = tile.z + tiles_of_word - 1; tile.z <= last_tile; ++tile.z) {
    if (tile_layers(own.layers, tile) == 0) continue;
    if (lane == 0) {
      list_entries(&own, tile);
      list_likely_views(&g, tile, layer_depth, views, view_lanes, depths, &own);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    ask_views(&g, tile, layer_depth, views, depths, &own);
    if (own.entry_count != 0) {
      if (lane == 0) keep_entries(&own, tile);
      barrier(CLK_LOCAL_MEM_FENCE);
      Box box;
      find_candidates_box(&g, &own, tile, layer_depth, min_gap, &box);
      __global ushort* own_views = tile_views + ((tile.y * g.words_k * tiles_of_word + tile.z) * tiles_i + tile.x) * view_groups;
      for (int n = lane; n < view_groups; n += lanes)
        own_views[n] = (ushort)views_of_box(view_lanes + n * VIEW_LANE_FIELDS * LANES, views + n * LANES, depths, &box);
      barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
      if (lane == 0) list_views(&own, own_views, view_groups);
      barrier(CLK_LOCAL_MEM_FENCE);
      ask_views(&g, tile, layer_depth, views, depths, &own);
    }
    if (lane == 0) keep_entries(&own, tile);
    barrier(CLK_LOCAL_MEM_FENCE);
  }

  for (int row = lane; row < VIEW_TILE; row += lanes) vstore8(vload8(row, own.words), row, own_candidates);
}
