// States of points, for planners - ours: unknown, free, or occupied.
//
// The points lie in a window of the map and are sorted by cells, STATE_CELLS^3 of each block; the cells of a cube of STATE_CUBE^3 come one
// after the other. Neighbours are asked for together, LANES at once.
//   points[3][stride]: x, y, z in the window's frame [m];  states[...]: of the points, in the same order

#define STATE_PARTS (STATE_CHUNK / LANES)

INLINE Points load_asked_points(__global const float* points, int stride, int at) {
  return (Points){vloadv(0, points + at), vloadv(0, points + stride + at), vloadv(0, points + 2 * stride + at)};
}

// Number of a cell: cubes first, then the cells of a cube.
INLINE int state_cell(const Window* window, int3 cell) {
  const int cubes = STATE_CELLS / STATE_CUBE;  // along a block's edge
  const int3 cube = cell / STATE_CUBE, in_cube = cell % STATE_CUBE;
  const int number = (cube.z * (cubes * window->size_y) + cube.y) * (cubes * window->size_x) + cube.x;
  return ((number * STATE_CUBE + in_cube.z) * STATE_CUBE + in_cube.y) * STATE_CUBE + in_cube.x;
}

// Asks the kept views for the points of a chunk that are still open, a bit each. Only those views are asked that may know something of its
// cube.
void ask_kept_views(__global const View* views, __global const float* view_lanes, int view_count, __global const ushort* depths,
                    const Box* cube, __global const float* points, int stride, int first, uint* open) {
  uint any = 0;
  for (int part = 0; part < STATE_PARTS; ++part) any |= open[part];
  for (int group = 0; group * VIEW_GROUP < view_count && any != 0; ++group) {
    uint left = views_of_box(view_lanes + group * (VIEW_LANE_FIELDS * VIEW_GROUP), views + group * VIEW_GROUP, depths, cube);
    for (; left != 0 && any != 0; left &= left - 1) {
      const View view = views[group * VIEW_GROUP + lowest_lane(left)];
      any = 0;
      for (int part = 0; part < STATE_PARTS; ++part) {
        if (open[part] == 0) continue;
        const Points p = load_asked_points(points, stride, first + part * LANES);
        open[part] &= ~lane_bits(knows(&view, depths, p, lane_marks(open[part])));
        any |= open[part];
      }
    }
  }
}

// One work item handles a chunk of at most STATE_CHUNK points of a cube: which of them are free?
//   f: its window, and what there is of seen and taken points;  T_local_camera is the identity
//   in  views, view_lanes, depths: kept views from the window's frame;  seen_..., taken_...: common/seen_points.cl
//       chunks[count]: first point, number of points; and the cube: x | y << 16, z, counted in cubes from the window's corner
//   out states: SPACE_UNKNOWN or SPACE_FREE
__kernel void find_states(const Frame f, __global const View* views, __global const float* view_lanes, const int view_count,
                          __global const ushort* depths, __global const int* seen_slots, __global const int* seen_tables,
                          __global const int* seen_bricks, __global const int* taken_slots, __global const int* taken_tables,
                          __global const int* taken_bricks, __global const float* points, const int stride, __global const int4* chunks,
                          const int count, __global uchar* states) {
  const int n = get_global_id(0);
  if (n >= count) return;
  const SeenPoints seen = {seen_slots, seen_tables, seen_bricks}, taken = {taken_slots, taken_tables, taken_bricks};
  const int4 chunk = chunks[n];
  uint asked[STATE_PARTS], open[STATE_PARTS];
  for (int part = 0; part < STATE_PARTS; ++part) {
    const Points p = load_asked_points(points, stride, chunk.x + part * LANES);
    intv marks = MARK(part * LANES + lane_numbers() < chunk.y);
    if (f.has_taken) marks &= ~seen_before(&f, &taken, p, marks);
    asked[part] = lane_bits(marks);
    open[part] = f.has_seen ? lane_bits(marks & ~seen_before(&f, &seen, p, marks)) : asked[part];
  }
  const float half_size = 0.5f * f.window.block_size * STATE_CUBE / STATE_CELLS;
  const float3 cube = convert_float3((int3)(chunk.z & 0xffff, chunk.z >> 16, chunk.w));
  const Box box = {(2.0f * cube + 1.0f) * half_size, (float3)(half_size)};
  ask_kept_views(views, view_lanes, view_count, depths, &box, points, stride, chunk.x, open);
  for (int m = 0; m < chunk.y; ++m)
    states[chunk.x + m] = (asked[m / LANES] & ~open[m / LANES]) >> (m % LANES) & 1 ? SPACE_FREE : SPACE_UNKNOWN;
}

// One work item handles LANES surfels of a page: points at most a voxel from an occupied one are occupied. Work item PAGE_ITEMS n + m has
// the surfels from LANES m of pages[n].
//   voxels: edge of a voxel [radii of its surfel];  in cell_begin[cells + 1]: first point of each cell
//   i/o states
__kernel void mark_occupied(const Window window, const float voxels, __global const uint4* surfels, __global const ulong* alive,
                            __global const int4* page_block, __global const uint* pages, const int count, __global const float* points,
                            const int stride, __global const int* cell_begin, __global uchar* states) {
  const int n = get_global_id(0) / PAGE_ITEMS;
  if (n >= count) return;
  const uint page = pages[n], first = PAGE_SLOTS * page + LANES * (get_global_id(0) % PAGE_ITEMS);
  const uint lanes = lanes_of_page(alive[page], first);
  if (lanes == 0) return;
  const Surfels s = load_surfels(&window, surfels, page_block[page], first);
  float x[LANES], y[LANES], z[LANES], reach[LANES];
  vstorev(s.position.x, 0, x);
  vstorev(s.position.y, 0, y);
  vstorev(s.position.z, 0, z);
  vstorev(voxels * s.radius, 0, reach);
  const float scale = divided((float)STATE_CELLS, window.block_size);
  const int3 last_cell = STATE_CELLS * (int3)(window.size_x, window.size_y, window.size_z) - 1;
  for (uint left = lanes & lane_bits(MARK((s.attributes & SURFEL_OCCUPIED) != 0)); left != 0; left &= left - 1) {
    const int m = lowest_lane(left);
    const float3 p = (float3)(x[m], y[m], z[m]);
    const int3 low = max(convert_int3(floor((p - reach[m]) * scale)), 0),
               high = min(convert_int3(floor((p + reach[m]) * scale)), last_cell);
    for (int k = low.z; k <= high.z; ++k)
      for (int j = low.y; j <= high.y; ++j)
        for (int i = low.x; i <= high.x; ++i) {
          const int cell = state_cell(&window, (int3)(i, j, k));
          for (int at = cell_begin[cell]; at < cell_begin[cell + 1]; ++at) {
            const float3 d = (float3)(points[at], points[stride + at], points[2 * stride + at]) - p;
            if (d.x * d.x + d.y * d.y + d.z * d.z <= reach[m] * reach[m]) states[at] = SPACE_OCCUPIED;
          }
        }
  }
}
