// Labels and colour - paper 3.5: a surfel where a column of observed voxels ends at a measured surface is occupied, for ever.

// One work item eight surfels, one group a page of the window.
//   in  depth, column_end: of 2_observed_space;  color[height][width]: red | green << 8 | blue << 16, if has_color
__kernel __attribute__((reqd_work_group_size(8, 1, 1))) void label_surfels(const Grid g, const Limits limits, const Window window,
                                                                           const Transform T_camera_local, __global const float* depth,
                                                                           __global const int* column_end, __global const uint* color,
                                                                           const int has_color, __global const uint* pages,
                                                                           __global const ulong* alive, __global const int4* page_block,
                                                                           __global uint4* surfels, __global uint* changed) {
  const uint page = pages[get_group_id(0)], first = PAGE_SLOTS * page + 8 * get_local_id(0);
  const uint lanes = (uint)(alive[page] >> (8 * get_local_id(0))) & 0xff;
  if (lanes == 0) return;
  const Surfels8 s = load_eight(&window, &T_camera_local, surfels, page_block[page], first);
  const uint done = SURFEL_OCCUPIED | (has_color ? SURFEL_COLORED : 0);
  int8 i, j, k;
  const int8 inside = voxels_of_eight(&g, s.x, s.y, s.z, &i, &j, &k);
  const int8 column = i - g.padding_i, row = j - g.padding_j;
  const int8 open = inside && column >= 0 && row >= 0 && column < g.width && row < g.height && (s.attributes & done) != done;
  int pixel[8], layer[8];
  float z[8];
  vstore8(row * g.width + column, 0, pixel);
  vstore8(k, 0, layer);
  vstore8(s.z, 0, z);
  for (uint left = lanes & lanes_of(open); left != 0; left &= left - 1) {
    const int n = lowest_lane(left);
    if (!at_surface(&g, depth[pixel[n]], column_end[pixel[n]], limits.surface_depth, layer[n], z[n])) continue;
    uint labelled = surfels[first + n].w | SURFEL_OCCUPIED;
    if (has_color && (labelled & SURFEL_COLORED) == 0) labelled = (labelled & 0xff000000u) | SURFEL_COLORED | color[pixel[n]];
    surfels[first + n].w = labelled;
    set_slot(changed, first + n);
  }
}
