// Tiles of the grid as work-groups have them in local memory: VIEW_TILE x VIEW_TILE columns of VIEW_TILE_K layers, the candidates in them,
// and the views that are asked. 7_recent_views goes through them.

#define TILE_ENTRIES (TILE_COLUMNS * VIEW_TILE_K)  // maximum number of candidates of a tile
#define TILE_CHUNKS (TILE_ENTRIES / LANES)
#define GROUP_TILES (LANES == 1 ? 1 : WORD_TILES)  // tiles that a work-group has; where it has few, there are more groups

// A work-group of one item waits for nobody, and PoCL, where it has one (src/opencl/work_shape.hpp), takes minutes to compile barriers
// within branches and loops.
#if TILE_GROUP == 1
#define GROUP_BARRIER(flags)
#else
#define GROUP_BARRIER(flags) barrier(flags)
#endif

// What a work-group knows of the tiles of a word of the bit fields, and of one of them.
typedef struct {
  ulong words[TILE_COLUMNS];             // candidates
  ulong taken[TILE_COLUMNS];             // those of them that are taken back
  ulong layers;                          // that have one in any column
  ushort entries[TILE_ENTRIES + LANES];  // the tile's candidates, VIEW_TILE_K column + layer
  uint entry_count;
#if LANES == 1
  float x[VIEW_TILE_K][VIEW_TILE], y[VIEW_TILE_K][VIEW_TILE], z[VIEW_TILE_K];  // of the tile's voxels: by layers, and columns or rows
#else
  float centers[TILE_CHUNKS][3][LANES];  // of the entries: x, y, z of each chunk
#endif
  ushort open[TILE_CHUNKS];    // entries of each chunk that are not settled, a bit each
  ushort chunks[TILE_CHUNKS];  // that have such: work item n's are chunks[n], chunks[n + work items] ...
  ushort views[MOST_VIEWS];    // to be asked, in this order
  uint view_count;
  uint likely_views;          // of the first group: those asked because of the probes, a bit each
  uint known_by[PROBES + 1];  // of the first group: those that know so many probes, a bit each
#if LANES == 1
  uint near[MOST_VIEWS / VIEW_GROUP];  // of each group: those that may know something near the candidates, a bit each
#endif
} Tile;

INLINE ulong all_bits(ulong8 words) {
  const ulong4 of_4 = words.lo | words.hi;
  const ulong2 of_2 = of_4.lo | of_4.hi;
  return of_2.x | of_2.y;
}

// Loads the words of the tiles one above the other: whole words, or the part of each that this work-group is going to put back.
INLINE void load_words(__global const ulong* candidates, int part, __local Tile* own) {
  const int item = get_local_id(0), items = get_local_size(0);
#if LANES == 1
  __global const ushort* parts = (__global const ushort*)candidates + part;
  for (int column = item; column < TILE_COLUMNS; column += items) {
    own->words[column] = (ulong)parts[WORD_TILES * column] << (part * VIEW_TILE_K);
    own->taken[column] = 0;
  }
#else
  for (int row = item; row < VIEW_TILE; row += items) {
    vstore8(vload8(row, candidates), row, own->words);
    vstore8((ulong8)(0), row, own->taken);
  }
#endif
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
  if (item == 0) {
    ulong8 words = 0;
    for (int row = 0; row < VIEW_TILE; ++row) words |= vload8(row, own->words);
    own->layers = all_bits(words);
  }
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
}

// The bits of a tile's layers in the words of its columns.
INLINE ulong tile_mask(int3 tile) { return ((1ul << VIEW_TILE_K) - 1) << (tile.z * VIEW_TILE_K % 64); }

INLINE uint tile_layers(ulong word, int3 tile) { return (uint)(word >> (tile.z * VIEW_TILE_K % 64)) & ((1u << VIEW_TILE_K) - 1); }

// Lists a tile's candidates, by columns. Each work item has a share of the columns, and counts what those before it have.
INLINE void list_entries(__local Tile* own, int3 tile) {
  const int item = get_local_id(0), items = get_local_size(0), first = TILE_COLUMNS * item / items,
            last = TILE_COLUMNS * (item + 1) / items;
  uint count = 0;
  for (int column = 0; column < first; ++column) count += popcount(tile_layers(own->words[column], tile));
  for (int column = first; column < last; ++column)
    for (uint left = tile_layers(own->words[column], tile); left != 0; left &= left - 1)
      own->entries[count++] = (ushort)(column * VIEW_TILE_K + lowest_lane(left));
  if (item == items - 1) own->entry_count = count;
}

// Adds an entry to the bits of a tile's columns. Other work items may add theirs at the same time.
INLINE void add_entry(__local ulong* words, int3 tile, int entry) {
  const int column = entry / VIEW_TILE_K, bit = (tile.z * VIEW_TILE_K + entry % VIEW_TILE_K) % 64;
  if (get_local_size(0) == 1)
    words[column] |= 1ul << bit;
  else
    atomic_or((volatile __local uint*)words + 2 * column + bit / 32, 1u << (bit % 32));
}

INLINE void clear_entries(__local ulong* words, int3 tile) {
  const ulong mask = tile_mask(tile);
  for (int column = get_local_id(0); column < TILE_COLUMNS; column += get_local_size(0)) words[column] &= ~mask;
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
}

INLINE bool entry_is_open(__local const Tile* own, uint n) { return (own->open[n / LANES] >> (n % LANES) & 1) != 0; }

// Takes those off the list that are settled. One work item alone goes through those that are not; of several, each has its share of the
// list, and then of the columns.
INLINE void drop_settled(__local Tile* own, int3 tile) {
  const uint items = get_local_size(0);
  if (items == 1) {
    uint count = 0;
    for (uint first = 0; first < own->entry_count; first += LANES)
      for (uint left = own->open[first / LANES]; left != 0; left &= left - 1)
        own->entries[count++] = own->entries[first + lowest_lane(left)];
    own->entry_count = count;
  } else {
    clear_entries(own->words, tile);
    for (uint n = get_local_id(0); n < own->entry_count; n += items)
      if (entry_is_open(own, n)) add_entry(own->words, tile, own->entries[n]);
    GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
    list_entries(own, tile);
  }
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
}

// Puts the candidates left in the place of the tile's.
INLINE void keep_entries(__local Tile* own, int3 tile) {
  clear_entries(own->words, tile);
  for (uint n = get_local_id(0); n < own->entry_count; n += get_local_size(0)) add_entry(own->words, tile, own->entries[n]);
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
}

// All points near the candidates of a tile. Every work item of the group must ask for them.
INLINE void find_candidates_box(const Grid* g, __local const Tile* own, int3 tile, __global const float* layer_depth, float min_gap,
                                Box* box) {
  const ulong mask = tile_mask(tile);
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
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);  // all have read the words, which may change now
}

// Coordinates of a tile's voxels: at width 1 the entries share them, because local memory decides how many work-groups a graphics processor
// runs at once, and the centres of all entries would take most of it.
INLINE void find_coordinates(const Grid* g, int3 tile, __global const float* layer_depth, __local Tile* own) {
#if LANES == 1
  for (int n = get_local_id(0); n < VIEW_TILE_K * VIEW_TILE; n += get_local_size(0)) {
    const int layer = n / VIEW_TILE, across = n % VIEW_TILE;
    const Voxels v = {tile.x * VIEW_TILE + across, tile.y * VIEW_TILE + across, tile.z * VIEW_TILE_K + layer};
    const Points center = voxel_centers(g, layer_depth, v);
    own->x[layer][across] = center.x;
    own->y[layer][across] = center.y;
    own->z[layer] = center.z;
  }
#endif
}

// Centres of a chunk of a tile's entries, camera frame.
INLINE Points entry_centers(__local const Tile* own, int chunk) {
#if LANES == 1
  const int entry = own->entries[chunk], layer = entry % VIEW_TILE_K, column = entry / VIEW_TILE_K;
  return (Points){own->x[layer][column % VIEW_TILE], own->y[layer][column / VIEW_TILE], own->z[layer]};
#else
  return (Points){vloadv(0, own->centers[chunk][0]), vloadv(0, own->centers[chunk][1]), vloadv(0, own->centers[chunk][2])};
#endif
}

// Puts the tiles of a work-group back: whole words, or a part of each. Other groups have the other parts.
INLINE void store_words(__local const Tile* own, int part, __global ulong* candidates) {
  const int item = get_local_id(0), items = get_local_size(0);
#if LANES == 1
  __global ushort* parts = (__global ushort*)candidates + part;
  for (int column = item; column < TILE_COLUMNS; column += items)
    parts[WORD_TILES * column] = (ushort)((own->words[column] | own->taken[column]) >> (part * VIEW_TILE_K));
#else
  for (int row = item; row < VIEW_TILE; row += items) vstore8(vload8(row, own->words) | vload8(row, own->taken), row, candidates);
#endif
}

INLINE void clear_words(__local Tile* own, int part, __global ulong* candidates) {
  for (int column = get_local_id(0); column < TILE_COLUMNS; column += get_local_size(0)) own->words[column] = own->taken[column] = 0;
  GROUP_BARRIER(CLK_LOCAL_MEM_FENCE);
  store_words(own, part, candidates);
}
