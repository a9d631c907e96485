// Cells of the grid of states, for planners - ours: through which of them do surfels pass?

// One work item handles LANES surfels of a page: work item PAGE_ITEMS n + m has the surfels from LANES m of pages[n]. A surfel passes
// through the cells that the box around its disc touches.
//   place: corner of the map's window from that of the cells [m], and the edge of a cell [m];  cells: their number along each axis
//   out labels[2][z][y][x], which was 0: 1 where a frontier surfel passes, then 1 where an occupied one does
__kernel void mark_state_cells(const Window window, const float4 place, const int4 cells, __global const uint4* surfels,
                               __global const ulong* alive, __global const int4* page_block, __global const uint* pages, const int count,
                               __global uchar* labels) {
  const int n = get_global_id(0) / PAGE_ITEMS;
  if (n >= count) return;
  const uint page = pages[n], first = PAGE_SLOTS * page + LANES * (get_global_id(0) % PAGE_ITEMS);
  const uint lanes = lanes_of_page(alive[page], first);
  if (lanes == 0) return;
  const Surfels s = load_surfels(&window, surfels, page_block[page], first);
  float low[3][LANES], high[3][LANES];
  const float scale = 1.0f / place.w;
  const Points normal = unpack_normals(s.normal);
  const floatv rx = s.radius * sqrt(fmax(1.0f - normal.x * normal.x, 0.0f)), ry = s.radius * sqrt(fmax(1.0f - normal.y * normal.y, 0.0f)),
               rz = s.radius * sqrt(fmax(1.0f - normal.z * normal.z, 0.0f));
  vstorev((s.position.x + place.x - rx) * scale, 0, low[0]);
  vstorev((s.position.y + place.y - ry) * scale, 0, low[1]);
  vstorev((s.position.z + place.z - rz) * scale, 0, low[2]);
  vstorev((s.position.x + place.x + rx) * scale, 0, high[0]);
  vstorev((s.position.y + place.y + ry) * scale, 0, high[1]);
  vstorev((s.position.z + place.z + rz) * scale, 0, high[2]);
  const uint occupied = lane_bits(MARK((s.attributes & SURFEL_OCCUPIED) != 0));
  for (uint left = lanes; left != 0; left &= left - 1) {
    const int m = lowest_lane(left);
    const int3 first = max(convert_int3(floor((float3)(low[0][m], low[1][m], low[2][m]))), 0),
               last = min(convert_int3(floor((float3)(high[0][m], high[1][m], high[2][m]))), cells.xyz - 1);
    __global uchar* label = labels + (size_t)(occupied >> m & 1) * cells.x * cells.y * cells.z;
    for (int k = first.z; k <= last.z; ++k)
      for (int j = first.y; j <= last.y; ++j)
        for (int i = first.x; i <= last.x; ++i) label[((size_t)k * cells.y + j) * cells.x + i] = 1;
  }
}
