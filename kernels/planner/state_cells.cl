// Cells of the grid of states, for planners - ours: the centres of which are free, and through which do surfels pass?
//
// Blocks of the grid have words of 4 x 4 x 4 cells: word (z 4 + y) 4 + x of a block, and bit (z 4 + y) 4 + x of a word.

#define CUBE_PARTS (64 / LANES)
#define PART_MASK ((1u << LANES) - 1)

// Centres of LANES cells of a cube, from bit `bit` on.
//   corner: of the cube;  edge: of a cell [m]
INLINE Points centres_of_cells(float3 corner, float edge, int bit) {
  const intv cell = bit + lane_numbers();
  return (Points){corner.x + (convert_floatv(cell & 3) + 0.5f) * edge, corner.y + (convert_floatv(cell >> 2 & 3) + 0.5f) * edge,
                  corner.z + (convert_floatv(cell >> 4) + 0.5f) * edge};
}

// Asks the kept views for the cells of a cube that are still open. Only those views are asked that may know something of the cube.
//   i/o open[CUBE_PARTS]
void ask_views_of_cells(__global const View* views, __global const float* view_lanes, int view_count, __global const ushort* depths,
                        const Box* cube, float edge, uint* open) {
  const float3 corner = cube->center - cube->half_size;
  uint any = 0;
  for (int part = 0; part < CUBE_PARTS; ++part) any |= open[part];
  for (int group = 0; group * VIEW_GROUP < view_count && any != 0; ++group) {
    uint left = views_of_box(view_lanes + group * (VIEW_LANE_FIELDS * VIEW_GROUP), views + group * VIEW_GROUP, depths, cube);
    for (; left != 0 && any != 0; left &= left - 1) {
      const View view = views[group * VIEW_GROUP + lowest_lane(left)];
      any = 0;
      for (int part = 0; part < CUBE_PARTS; ++part) {
        if (open[part] == 0) continue;
        open[part] &= ~lane_bits(knows(&view, depths, centres_of_cells(corner, edge, part * LANES), lane_marks(open[part])));
        any |= open[part];
      }
    }
  }
}

// One work item handles a cube of cells. Cells that were free stay so; the others become free if seen points or one of the views know their
// centre, and no taken point forbids it.
//   f: window of the blocks, and what there is of seen and taken points;  T_local_camera is the identity
//   in  views, view_lanes, depths: kept views from the window's frame;  seen_..., taken_...: common/seen_points.cl
//       edge: of a cell [m];  blocks[count]: lowest corner [m] in the window's frame;  w: not 0 if points have been taken, so that cells
//       may have ceased to be free
//   i/o free[count][STATE_BLOCK_CUBES]: a bit for each cell
__kernel void find_free_cells(const Frame f, __global const View* views, __global const float* view_lanes, const int view_count,
                              __global const ushort* depths, __global const int* seen_slots, __global const int* seen_tables,
                              __global const int* seen_bricks, __global const int* taken_slots, __global const int* taken_tables,
                              __global const int* taken_bricks, const float edge, __global const float4* blocks, const int count,
                              __global ulong* free) {
  const int n = get_global_id(0) / STATE_BLOCK_CUBES, cube = get_global_id(0) % STATE_BLOCK_CUBES;
  if (n >= count) return;
  __global ulong* word = free + STATE_BLOCK_CUBES * n + cube;
  const float4 block = blocks[n];
  const bool may_lose = block.w != 0.0f && f.has_taken;
  ulong known = *word;
  if (known == ~0ul && !may_lose) return;

  const SeenPoints seen = {seen_slots, seen_tables, seen_bricks}, taken = {taken_slots, taken_tables, taken_bricks};
  const float3 corner = block.xyz + 4.0f * edge * convert_float3((int3)(cube & 3, cube >> 2 & 3, cube >> 4));
  const Box box = {corner + 2.0f * edge, (float3)(2.0f * edge)};
  const int of_taken = f.has_taken ? seen_in_box(&f, &taken, &box) : SEEN_NONE,
            of_seen = f.has_seen ? seen_in_box(&f, &seen, &box) : SEEN_NONE;
  uint open[CUBE_PARTS];
  ulong forbidden = 0, left = 0;
  for (int part = 0; part < CUBE_PARTS; ++part) {
    const Points p = centres_of_cells(corner, edge, part * LANES);
    uint asked = PART_MASK;
    if (of_taken == SEEN_ALL) asked = 0;
    if (of_taken == SEEN_MIXED) asked &= ~lane_bits(seen_before(&f, &taken, p, lane_marks(PART_MASK)));
    forbidden |= (ulong)(PART_MASK & ~asked) << (part * LANES);
    asked &= ~(uint)(known >> (part * LANES));
    if (of_seen == SEEN_ALL) asked = 0;
    if (of_seen == SEEN_MIXED && asked != 0) asked &= ~lane_bits(seen_before(&f, &seen, p, lane_marks(asked)));
    open[part] = asked;
  }
  ask_views_of_cells(views, view_lanes, view_count, depths, &box, edge, open);
  for (int part = 0; part < CUBE_PARTS; ++part) left |= (ulong)open[part] << (part * LANES);
  if (may_lose) known &= ~forbidden;
  *word = known | ~(left | forbidden);
}

// Index of the word of a cell's row in the marks.
//   cells: of the region along each axis, x a multiple of 32;  kind: 0 frontier, 1 occupied
INLINE intv mark_word(int4 cells, intv kind, intv x, intv y, intv z) {
  return ((kind * cells.z + z) * cells.y + y) * (cells.x / 32) + (x >> 5);
}

// One work item handles LANES surfels of a page: work item PAGE_ITEMS n + m has the surfels from LANES m of pages[n]. A surfel passes
// through the cells that the box around its disc touches. Most cells are marked by many surfels, most of which touch at most two cells
// along an axis: these are looked at together first.
//   place: corner of the map's window from that of the region [m], and the edge of a cell [m]
//   cells: of the region along each axis, x a multiple of 32
//   i/o marks[2][z][y][x / 32]: a bit for each cell through which frontier, or occupied, surfels pass
__kernel void mark_state_cells(const Window window, const float4 place, const int4 cells, __global const uint4* surfels,
                               __global const ulong* alive, __global const int4* page_block, __global const uint* pages, const int count,
                               __global uint* marks) {
  const int n = get_global_id(0) / PAGE_ITEMS;
  if (n >= count) return;
  const uint page = pages[n], first = PAGE_SLOTS * page + LANES * (get_global_id(0) % PAGE_ITEMS);
  const uint lanes = lanes_of_page(alive[page], first);
  if (lanes == 0) return;
  const Surfels s = load_surfels(&window, surfels, page_block[page], first);
  const float scale = divided(1.0f, place.w);
  const Points normal = unpack_normals(s.normal);
  const floatv rx = s.radius * square_root(fmax(1.0f - normal.x * normal.x, 0.0f)),
               ry = s.radius * square_root(fmax(1.0f - normal.y * normal.y, 0.0f)),
               rz = s.radius * square_root(fmax(1.0f - normal.z * normal.z, 0.0f));
  const intv x0 = max(floor_int((s.position.x + place.x - rx) * scale), 0), y0 = max(floor_int((s.position.y + place.y - ry) * scale), 0),
             z0 = max(floor_int((s.position.z + place.z - rz) * scale), 0),
             x1 = min(floor_int((s.position.x + place.x + rx) * scale), cells.x - 1),
             y1 = min(floor_int((s.position.y + place.y + ry) * scale), cells.y - 1),
             z1 = min(floor_int((s.position.z + place.z + rz) * scale), cells.z - 1);
  const intv kind = -MARK((s.attributes & SURFEL_OCCUPIED) != 0);
  const intv within = lane_marks(lanes) & MARK(x0 <= x1) & MARK(y0 <= y1) & MARK(z0 <= z1);
  const intv small = within & MARK((x0 >> 5) == (x1 >> 5)) & MARK(y1 <= y0 + 1) & MARK(z1 <= z0 + 1);
  const uintv bits = ((uintv)(2) << as_uintv(x1 & 31)) - ((uintv)(1) << as_uintv(x0 & 31));
  __global const int* words = (__global const int*)marks;
  const intv all = gather_int(words, small ? mark_word(cells, kind, x0, y0, z0) : 0) &
                   gather_int(words, small ? mark_word(cells, kind, x0, y1, z0) : 0) &
                   gather_int(words, small ? mark_word(cells, kind, x0, y0, z1) : 0) &
                   gather_int(words, small ? mark_word(cells, kind, x0, y1, z1) : 0);
  uint left = lane_bits(within & ~(small & MARK((as_uintv(all) & bits) == bits)));
  if (left == 0) return;

  int low[3][LANES], high[3][LANES], kinds[LANES];
  vstorev(x0, 0, low[0]);
  vstorev(y0, 0, low[1]);
  vstorev(z0, 0, low[2]);
  vstorev(x1, 0, high[0]);
  vstorev(y1, 0, high[1]);
  vstorev(z1, 0, high[2]);
  vstorev(kind, 0, kinds);
  for (; left != 0; left &= left - 1) {
    const int m = lowest_lane(left);
    for (int z = low[2][m]; z <= high[2][m]; ++z)
      for (int y = low[1][m]; y <= high[1][m]; ++y)
        for (int x = low[0][m]; x <= high[0][m]; ++x) {
          __global uint* word = marks + ((kinds[m] * cells.z + z) * cells.y + y) * (cells.x / 32) + (x >> 5);
          if ((*word >> (x & 31) & 1) == 0) atomic_or(word, 1u << (x & 31));
        }
  }
}
