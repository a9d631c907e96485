// Surfels merged by cells of their block, for views that see them from afar - ours.
//
// The surfels of a cell become one if they have the same label and their normals the same largest coordinate, in absolute value, with the
// same sign: thin sheets keep both of their sides. Surfels with a larger radius than a cell's edge stay as they are. A merged surfel has
// the mean position and normal, and a radius that reaches beyond the outermost centres of its surfels by half the largest radius among
// them: surfels overlap, and with the whole radius what is merged would be too large in views. All is summed in whole numbers, so that the
// order of the surfels does not matter.
//   places[blocks]: what is merged of a block stays for later questions, in a place for as many pages as the block has
//   merged[places][MERGE_LEVELS][slots of the block's pages]: surfels as in the map
//   merged_count[places][MERGE_LEVELS]: how many there are, for the first page of each place

INLINE ulong merged_begin(uint level, uint block, __global const uint* page_begin, __global const uint* places) {
  return PAGE_SLOTS * (MERGE_LEVELS * (ulong)places[block] + (level - 1) * (page_begin[block + 1] - page_begin[block]));
}
INLINE ulong merged_counter(uint level, uint block, __global const uint* places) { return MERGE_LEVELS * (ulong)places[block] + level - 1; }

// No more surfels of a cell are added up: larger sums would not fit.
#define MERGE_MOST 32767

#define MERGE_NORMAL_ONE 1023.0f

// How far merged discs of a level may reach out of their block [m]: half the radius is at most half a cell's edge, and the spread 3/2 of
// it.
INLINE float merged_reach(uint level, float block_size) {
  return level == 0 ? 0.0f : divided(2.01f * block_size, (float)(MERGE_CELLS >> (level - 1)));
}

// The sums of a cell's surfels of one kind.
typedef struct {
  ulong squares;        // of the distances from the block's corner, in the steps of positions
  uint count, x, y, z;  // positions
  int n_x, n_y, n_z;    // normals, in steps of 1 / MERGE_NORMAL_ONE
  uint radius;          // the largest, as the map keeps it
  uint kind;            // number of the normal's side of a cube, and SURFEL_OCCUPIED
  uint next;            // of the same cell: its number + 1, or 0
} MergeSum;

// The cells of a work item. table: number of the first sum of each cell + 1, or 0
typedef struct {
  __global MergeSum* sums;
  __global uint* table;
  uint count, most_radius;
  int shift;  // of positions
} MergeCells;

INLINE uint merge_cell(const MergeCells* cells, uint x, uint y, uint z) {
  const int bits = 16 - cells->shift;
  return ((z >> cells->shift << bits | y >> cells->shift) << bits) | x >> cells->shift;
}

// A cell's edge as a radius of the map: no larger surfel is merged.
INLINE uint merge_most_radius(float block_size, uint cells) {
  uint halves[LANES];
  vstorev(floats_to_halves((floatv)(divided(block_size, (float)cells))), 0, halves);
  return halves[0];
}

// Cells of a level, without any sums.
INLINE void begin_merge_level(MergeCells* cells, uint level, float block_size) {
  const uint edge = MERGE_CELLS >> (level - 1);
  cells->count = 0;
  cells->shift = 16 - (int)popcount(edge - 1);
  cells->most_radius = merge_most_radius(block_size, edge);
}

// Adds a surfel, or the sums of a smaller cell.
//   x, y, z: its position
INLINE void merge_into_cell(MergeCells* cells, MergeSum s, uint x, uint y, uint z) {
  uint first = 0;
  if (s.radius <= cells->most_radius) {
    const uint cell = merge_cell(cells, x, y, z);
    first = cells->table[cell];
    for (uint n = first; n != 0; n = cells->sums[n - 1].next) {
      __global MergeSum* to = &cells->sums[n - 1];
      if (to->kind != s.kind) continue;
      if (to->count + s.count > MERGE_MOST) return;
      to->squares += s.squares;
      to->count += s.count;
      to->x += s.x;
      to->y += s.y;
      to->z += s.z;
      to->n_x += s.n_x;
      to->n_y += s.n_y;
      to->n_z += s.n_z;
      to->radius = max(to->radius, s.radius);
      return;
    }
    cells->table[cell] = cells->count + 1;
  }
  s.next = first;
  cells->sums[cells->count] = s;
  ++cells->count;
}

// Forgets which cells have sums.
INLINE void clear_merge_table(const MergeCells* cells) {
  for (uint n = 0; n < cells->count; ++n) {
    const MergeSum s = cells->sums[n];
    cells->table[merge_cell(cells, s.x / s.count, s.y / s.count, s.z / s.count)] = 0;
  }
}

// From the cells of a level to those of the next one. The sums move towards the beginning of their array.
INLINE void merge_next_level(MergeCells* cells, uint level, float block_size) {
  const uint count = cells->count;
  clear_merge_table(cells);
  begin_merge_level(cells, level, block_size);
  for (uint n = 0; n < count; ++n) {
    const MergeSum s = cells->sums[n];
    merge_into_cell(cells, s, s.x / s.count, s.y / s.count, s.z / s.count);
  }
}

// Adds LANES surfels of a page, those whose bits are set.
INLINE void merge_lanes(MergeCells* cells, Quads packed, uint lanes) {
  const Points n = unpack_normals(packed.z);
  const floatv a_x = fabs(n.x), a_y = fabs(n.y), a_z = fabs(n.z);
  const intv axis = a_x >= a_y ? (a_x >= a_z ? (intv)(0) : (intv)(4)) : (a_y >= a_z ? (intv)(2) : (intv)(4));
  const intv below = axis == 0 ? MARK(n.x < 0.0f) : (axis == 2 ? MARK(n.y < 0.0f) : MARK(n.z < 0.0f));
  uint xy[LANES], zr[LANES], kind[LANES];
  int n_x[LANES], n_y[LANES], n_z[LANES];
  vstorev(packed.x, 0, xy);
  vstorev(packed.y, 0, zr);
  vstorev(as_uintv(axis - below) | (packed.w & SURFEL_OCCUPIED), 0, kind);
  vstorev(floor_int(n.x * MERGE_NORMAL_ONE + 0.5f), 0, n_x);
  vstorev(floor_int(n.y * MERGE_NORMAL_ONE + 0.5f), 0, n_y);
  vstorev(floor_int(n.z * MERGE_NORMAL_ONE + 0.5f), 0, n_z);
  for (uint left = lanes; left != 0; left &= left - 1) {
    const int m = lowest_lane(left);
    const uint x = xy[m] & 0xffff, y = xy[m] >> 16, z = zr[m] & 0xffff;
    const ulong squares = (ulong)(x * x) + (ulong)(y * y) + (ulong)(z * z);
    merge_into_cell(cells, (MergeSum){squares, 1, x, y, z, n_x[m], n_y[m], n_z[m], zr[m] >> 16, kind[m], 0}, x, y, z);
  }
}

// Square of the distance from the middle to the outermost centres, in steps of positions. The mean square of the distance from the middle
// is a third of it at the ends of a line and at the corners of a square.
INLINE float merge_spread(const MergeSum* s) {
  const ulong all = s->squares * s->count, mean = (ulong)s->x * s->x + (ulong)s->y * s->y + (ulong)s->z * s->z;
  return divided(3.0f * (float)(all - mean), (float)s->count * (float)s->count);
}

// Writes the sums as surfels.
INLINE void write_merged(const MergeCells* cells, float block_size, __global uint4* merged) {
  for (uint chunk = 0; chunk < cells->count; chunk += LANES) {
    uint xy[LANES], zs[LANES], radius[LANES], kind[LANES];
    float spread[LANES], n_x[LANES], n_y[LANES], n_z[LANES];
    for (uint m = 0; m < LANES; ++m) {
      const MergeSum s = cells->sums[min(chunk + m, cells->count - 1)];
      xy[m] = s.x / s.count | s.y / s.count << 16;
      zs[m] = s.z / s.count;
      radius[m] = s.radius;
      kind[m] = s.kind & SURFEL_OCCUPIED;
      spread[m] = merge_spread(&s);
      n_x[m] = (float)s.n_x;
      n_y[m] = (float)s.n_y;
      n_z[m] = (float)s.n_z;
    }
    const floatv own = halves_to_floats(vloadv(0, radius)),
                 reach = fmax(own, 0.5f * own + square_root(vloadv(0, spread)) * (block_size * (1.0f / 65536.0f)));
    const Points normal = {vloadv(0, n_x), vloadv(0, n_y), vloadv(0, n_z)};
    const Quads packed = {vloadv(0, xy), vloadv(0, zs) | floats_to_halves(reach) << 16, pack_normals(normal), vloadv(0, kind)};
    scatter_quads(packed, (intv)((int)chunk) + lane_numbers(), MARK((int)chunk + lane_numbers() < (int)cells->count), merged);
  }
}

// One work item merges the surfels of every `workers`-th of the listed blocks. The first level is always made, and each level of the one
// before it, so that the surfels of a level do not depend on which others are asked for.
//   in  pages: of all blocks, one block after the other;  page_begin[blocks + 1];  places[blocks];  list[count]: number of a block <<
//       MERGE_LEVELS, and a bit for each level that is asked for, bit 0 for level 1
//   sums[workers][most_sums] and table[workers][cells of a block]: scratch; all of table is 0 before and afterwards
//   out merged, merged_count
__kernel void merge_surfels(const float block_size, __global const uint4* surfels, __global const ulong* alive, __global const uint* pages,
                            __global const uint* page_begin, __global const uint* places, __global const uint* list, const uint count,
                            const uint workers, __global uint* sums, const uint most_sums, __global uint* table, __global uint4* merged,
                            __global uint* merged_count) {
  const uint worker = get_global_id(0);
  if (worker >= workers) return;
  MergeCells cells;
  cells.sums = (__global MergeSum*)sums + (ulong)worker * most_sums;
  cells.table = table + worker * (MERGE_CELLS * MERGE_CELLS * MERGE_CELLS);
  for (uint n = worker; n < count; n += workers) {
    const uint block = list[n] >> MERGE_LEVELS, begin = page_begin[block], end = page_begin[block + 1];
    begin_merge_level(&cells, 1, block_size);
    for (uint page = begin; page < end; ++page) {
      const ulong word = alive[pages[page]];
      const uint first = PAGE_SLOTS * pages[page];
      for (uint slot = first; slot < first + PAGE_SLOTS; slot += LANES) {
        const uint lanes = lanes_of_page(word, slot);
        if (lanes != 0) merge_lanes(&cells, load_quads(surfels + slot), lanes);
      }
    }
    for (uint level = 1, asked = list[n] % (1u << MERGE_LEVELS); asked != 0; ++level, asked >>= 1) {
      if (level > 1) merge_next_level(&cells, level, block_size);
      if ((asked & 1) == 0) continue;
      write_merged(&cells, block_size, merged + merged_begin(level, block, page_begin, places));
      merged_count[merged_counter(level, block, places)] = cells.count;
    }
    clear_merge_table(&cells);
  }
}
