// The boundary near points, and in boxes that move, for planners - ours.
//
// The surfels of a window are listed cell by cell, `cells`^3 cells in each block. Cells of a row along x come one after the other, so that
// a part of a row is one run of entries. Within a cell, the order is left to chance: no answer may depend on it.
//   entries[...]: x, y, z of the centre in the window's frame [m], and the bits of the surfel's slot
//   cell_begin[number of cells + 1]: first entry of each cell

// The window's cells.
typedef struct {
  int3 count;   // along each axis
  float scale;  // cells per metre
  float edge;   // [m], a power of two: borders of cells are exact
} Cells;

INLINE Cells cells_of_window(const Window* window, int cells) {
  const float edge = divided(window->block_size, (float)cells);
  return (Cells){cells * (int3)(window->size_x, window->size_y, window->size_z), divided(1.0f, edge), edge};
}

INLINE int first_cell_of_row(const Cells* cells, int j, int k) { return (k * cells->count.y + j) * cells->count.x; }

INLINE intv cells_of_surfels(const Cells* cells, const Surfels* s) {
  return (convert_intv(s->position.z * cells->scale) * cells->count.y + convert_intv(s->position.y * cells->scale)) * cells->count.x +
         convert_intv(s->position.x * cells->scale);
}

// One work item handles LANES surfels of a page, as in mark_occupied.
//   i/o cell_counts[number of cells + 1]: the entry behind a cell's counts its surfels
__kernel void count_in_cells(const Window window, const int cells, __global const uint4* surfels, __global const ulong* alive,
                             __global const int4* page_block, __global const uint* pages, const int count, __global uint* cell_counts) {
  const int n = get_global_id(0) / PAGE_ITEMS;
  if (n >= count) return;
  const uint page = pages[n], first = PAGE_SLOTS * page + LANES * (get_global_id(0) % PAGE_ITEMS);
  const uint lanes = lanes_of_page(alive[page], first);
  if (lanes == 0) return;
  const Cells c = cells_of_window(&window, cells);
  const Surfels s = load_surfels(&window, surfels, page_block[page], first);
  int cell[LANES];
  vstorev(cells_of_surfels(&c, &s), 0, cell);
  for (uint left = lanes; left != 0; left &= left - 1) atomic_inc(&cell_counts[cell[lowest_lane(left)] + 1]);
}

// One work item handles LANES surfels of a page.
//   i/o cell_begin[number of cells + 1]: the entry behind a cell's says where its next surfel goes, at first where the cell begins. At the
//       end it is where the next cell begins
//   out entries
__kernel void list_by_cells(const Window window, const int cells, __global const uint4* surfels, __global const ulong* alive,
                            __global const int4* page_block, __global const uint* pages, const int count, __global uint* cell_begin,
                            __global float4* entries) {
  const int n = get_global_id(0) / PAGE_ITEMS;
  if (n >= count) return;
  const uint page = pages[n], first = PAGE_SLOTS * page + LANES * (get_global_id(0) % PAGE_ITEMS);
  const uint lanes = lanes_of_page(alive[page], first);
  if (lanes == 0) return;
  const Cells c = cells_of_window(&window, cells);
  const Surfels s = load_surfels(&window, surfels, page_block[page], first);
  int cell[LANES];
  float x[LANES], y[LANES], z[LANES];
  vstorev(cells_of_surfels(&c, &s), 0, cell);
  vstorev(s.position.x, 0, x);
  vstorev(s.position.y, 0, y);
  vstorev(s.position.z, 0, z);
  for (uint left = lanes; left != 0; left &= left - 1) {
    const int m = lowest_lane(left);
    entries[atomic_inc(&cell_begin[cell[m] + 1])] = (float4)(x[m], y[m], z[m], as_float(first + m));
  }
}

// The nearest surfel so far.
typedef struct {
  float square;     // of its distance [m^2]
  uint slot;        // UINT_MAX: none. Of surfels at the same distance, the lowest slot
  float3 position;  // if there is one
} Nearest;

INLINE float square_distance(float3 p, float3 surfel) {
  const float3 d = surfel - p;
  return d.x * d.x + (d.y * d.y + d.z * d.z);
}

// Distance from p to the cells with number n along an axis [m]. Rounding cannot make it more than that of a surfel in them.
INLINE float distance_to_cells(float p, int n, float edge) { return fmax(fmax((float)n * edge - p, p - (float)(n + 1) * edge), 0.0f); }

// Looks at the surfels of row (j, k) that may be as near to p as the nearest one so far.
INLINE void look_along_row(const Cells* cells, __global const float4* entries, __global const uint* cell_begin, float3 p, int j, int k,
                           Nearest* nearest) {
  const float y = distance_to_cells(p.y, j, cells->edge), z = distance_to_cells(p.z, k, cells->edge);
  const float rest = nearest->square - (y * y + z * z);
  if (rest < 0.0f) return;
  const float width = 1.00001f * square_root(rest) + 1e-5f;  // more than rounding loses
  const int low = max((int)floor((p.x - width) * cells->scale), 0),
            high = min((int)floor((p.x + width) * cells->scale), cells->count.x - 1);
  if (low > high) return;
  const int row = first_cell_of_row(cells, j, k);
  for (uint at = cell_begin[row + low]; at < cell_begin[row + high + 1]; ++at) {
    const float4 entry = entries[at];
    const float square = square_distance(p, entry.xyz);
    const uint slot = as_uint(entry.w);
    if (square < nearest->square || (square == nearest->square && slot < nearest->slot)) *nearest = (Nearest){square, slot, entry.xyz};
  }
}

// Rows of cells come in rings around that of the point, until the next ring is farther than the nearest surfel.
//   guess: the answer for a point near by. It only decides how long this takes
Nearest nearest_surfel(const Cells* cells, __global const float4* entries, __global const uint* cell_begin, float3 p, float reach,
                       const Nearest* guess) {
  Nearest nearest = *guess;
  nearest.square = square_distance(p, guess->position);
  if (guess->slot == UINT_MAX || nearest.square > reach * reach) nearest = (Nearest){reach * reach, UINT_MAX, p};
  const int2 at = convert_int2(floor(p.yz * cells->scale));
  const int rings = max(max(at.x, cells->count.y - 1 - at.x), max(at.y, cells->count.z - 1 - at.y));
  for (int ring = 0; ring <= rings; ++ring) {
    const float2 low = p.yz - convert_float2(at + 1 - ring) * cells->edge, high = convert_float2(at + ring) * cells->edge - p.yz;
    const float gap = ring == 0 ? 0.0f : fmin(fmin(low.x, low.y), fmin(high.x, high.y));
    if (gap * gap > nearest.square) break;
    for (int k = max(at.y - ring, 0); k <= min(at.y + ring, cells->count.z - 1); ++k) {
      const bool whole = k == at.y - ring || k == at.y + ring;  // else only both ends of the line are the ring's
      for (int j = at.x - ring; j <= at.x + ring; j += whole || ring == 0 ? 1 : 2 * ring)
        if (j >= 0 && j < cells->count.y) look_along_row(cells, entries, cell_begin, p, j, k, &nearest);
    }
  }
  return nearest;
}

// Stores on which side of surfels points are, and whether the surfels are occupied, for the first `count` lanes.
INLINE void store_sides_of_boundaries(Surfels s, Points p, int count, __global uchar* sides) {
  const Points away = {p.x - s.position.x, p.y - s.position.y, p.z - s.position.z};
  const uint front = lane_bits(MARK(dot_products(away, unpack_normals(s.normal)) >= 0.0f)),
             occupied = lane_bits(MARK((s.attributes & SURFEL_OCCUPIED) != 0));
  for (int m = 0; m < count; ++m) sides[m] = (front >> m & 1 ? BOUNDARY_IN_FRONT : 0) | (occupied >> m & 1 ? BOUNDARY_OCCUPIED : 0);
}

// Looks at all surfels of a page, LANES at once.
INLINE void look_through_page(const Window* window, __global const uint4* surfels, __global const ulong* alive,
                              __global const int4* page_block, uint page, Points p, Nearest* nearest) {
  const ulong word = alive[page];
  for (uint first = PAGE_SLOTS * page; first < PAGE_SLOTS * (page + 1); first += LANES) {
    const Surfels s = load_surfels(window, surfels, page_block[page], first);
    const Points d = {s.position.x - p.x, s.position.y - p.y, s.position.z - p.z};
    const floatv squares = d.x * d.x + (d.y * d.y + d.z * d.z);  // as square_distance()
    uint left = lanes_of_page(word, first) & lane_bits(MARK(squares <= nearest->square));
    if (left == 0) continue;
    float square[LANES];
    vstorev(squares, 0, square);
    for (; left != 0; left &= left - 1) {
      const int m = lowest_lane(left);
      if (square[m] > nearest->square || (square[m] == nearest->square && first + m >= nearest->slot)) continue;
      nearest->square = square[m];
      nearest->slot = first + m;
    }
  }
}

// One work item handles LANES points, which should lie near each other: which surfel is the nearest to each, within reach [m]?
//   in  points[3][stride]: as in states.cl
//   out distances[count] [m], slots[count]: of the surfels, UINT_MAX for none;  sides[count]: BOUNDARY_IN_FRONT | BOUNDARY_OCCUPIED
__kernel void find_nearest_boundaries(const Window window, const int cells, const float reach, __global const uint4* surfels,
                                      __global const int4* page_block, __global const float4* entries, __global const uint* cell_begin,
                                      __global const float* points, const int stride, const int count, __global float* distances,
                                      __global uint* slots, __global uchar* sides) {
  const int first = LANES * get_global_id(0), own = min(count - first, LANES);
  if (own <= 0) return;
  const Cells c = cells_of_window(&window, cells);
  uint found[LANES];
  for (int m = 0; m < LANES; ++m) found[m] = 0;
  Nearest nearest = {0.0f, UINT_MAX, (float3)(0.0f)};
  for (int m = 0; m < own; ++m) {
    const int at = first + m;
    const float3 p = (float3)(points[at], points[stride + at], points[2 * stride + at]);
    nearest = nearest_surfel(&c, entries, cell_begin, p, reach, &nearest);
    distances[at] = square_root(nearest.square);
    slots[at] = nearest.slot;
    if (nearest.slot != UINT_MAX) found[m] = nearest.slot;
  }
  store_sides_of_boundaries(surfels_at(&window, surfels, page_block, vloadv(0, found)), load_asked_points(points, stride, first), own,
                            sides + first);
}

// The same of few points, without a list of surfels by cells: one work item handles a point.
//   in  pages: of all blocks, one block after the other;  page_begin[blocks + 1];  near_begin[count + 1], near: for each point the blocks
//       that may have a surfel within reach, nearest first;  near_squares: squares of at most their distances from the point [m^2]
__kernel void find_nearest_in_blocks(const Window window, const float reach, __global const uint4* surfels, __global const ulong* alive,
                                     __global const int4* page_block, __global const uint* pages, __global const uint* page_begin,
                                     __global const uint* near_begin, __global const uint* near, __global const float* near_squares,
                                     __global const float* points, const int stride, const int count, __global float* distances,
                                     __global uint* slots, __global uchar* sides) {
  const int n = get_global_id(0);
  if (n >= count) return;
  const Points p = {points[n], points[stride + n], points[2 * stride + n]};
  Nearest nearest = {reach * reach, UINT_MAX, (float3)(0.0f)};
  for (uint at = near_begin[n]; at < near_begin[n + 1] && near_squares[at] <= nearest.square; ++at)
    for (uint m = page_begin[near[at]]; m < page_begin[near[at] + 1]; ++m)
      look_through_page(&window, surfels, alive, page_block, pages[m], p, &nearest);
  distances[n] = square_root(nearest.square);
  slots[n] = nearest.slot;
  const uint found = nearest.slot != UINT_MAX ? nearest.slot : 0;
  store_sides_of_boundaries(surfels_at(&window, surfels, page_block, (uintv)(found)), p, 1, sides + n);
}

// When, from 0 to 1, is from + t way within half of [low, high]? @return first and last t; the first is larger: never
INLINE float2 times_within(float low, float high, float from, float way, float half_size) {
  const float begin = low - half_size - from, end = high + half_size - from;
  if (way == 0.0f) return begin <= 0.0f && end >= 0.0f ? (float2)(0.0f, 1.0f) : (float2)(1.0f, 0.0f);
  const float a = divided(begin, way), b = divided(end, way);
  return (float2)(fmax(fmin(a, b), 0.0f), fmin(fmax(a, b), 1.0f));
}

INLINE float2 both_times(float2 a, float2 b) { return (float2)(fmax(a.x, b.x), fmin(a.y, b.y)); }

// One work item moves a box: when is the first surfel within it, and is one that comes first occupied?
//   in  frontier_counts: do frontier surfels stop the box?
//       boxes[count][3]: where its centre starts, window's frame; the way to its end; half its size [m]
//   out times[count]: share of the way, 2 for none;  sides[count]: 0 or BOUNDARY_OCCUPIED
__kernel void move_boxes(const Window window, const int cells, const int frontier_counts, __global const uint4* surfels,
                         __global const float4* entries, __global const uint* cell_begin, __global const float4* boxes, const int count,
                         __global float* times, __global uchar* sides) {
  const int n = get_global_id(0);
  if (n >= count) return;
  const Cells c = cells_of_window(&window, cells);
  const float slack = 1e-5f;  // [m], more than rounding loses
  const float3 from = boxes[3 * n].xyz, way = boxes[3 * n + 1].xyz, half_size = boxes[3 * n + 2].xyz;
  const int3 low = max(convert_int3(floor((fmin(from, from + way) - half_size - slack) * c.scale)), 0),
             high = min(convert_int3(floor((fmax(from, from + way) + half_size + slack) * c.scale)), c.count - 1);
  float first = 2.0f;
  bool occupied = false;
  for (int k = low.z; k <= high.z; ++k)
    for (int j = low.y; j <= high.y; ++j) {
      const float2 in_row = both_times(times_within(j * c.edge - slack, (j + 1) * c.edge + slack, from.y, way.y, half_size.y),
                                       times_within(k * c.edge - slack, (k + 1) * c.edge + slack, from.z, way.z, half_size.z));
      if (in_row.x > fmin(in_row.y, first) || (occupied && first == 0.0f)) continue;
      const float a = from.x + in_row.x * way.x, b = from.x + in_row.y * way.x, margin = half_size.x + slack;
      const int i_low = max((int)floor((fmin(a, b) - margin) * c.scale), low.x),
                i_high = min((int)floor((fmax(a, b) + margin) * c.scale), high.x);
      if (i_low > i_high) continue;
      const int row = first_cell_of_row(&c, j, k);
      for (uint at = cell_begin[row + i_low]; at < cell_begin[row + i_high + 1]; ++at) {
        const float4 p = entries[at];
        const float2 within =
            both_times(both_times(times_within(p.x, p.x, from.x, way.x, half_size.x), times_within(p.y, p.y, from.y, way.y, half_size.y)),
                       times_within(p.z, p.z, from.z, way.z, half_size.z));
        if (within.x > within.y || within.x > first) continue;
        const bool is_occupied = (surfels[as_uint(p.w)].w & SURFEL_OCCUPIED) != 0;
        if (!is_occupied && !frontier_counts) continue;
        occupied = is_occupied || (occupied && within.x == first);
        first = within.x;
      }
    }
  times[n] = first;
  sides[n] = occupied ? BOUNDARY_OCCUPIED : 0;
}
