// Labels and colour - paper 3.5: a surfel where a column of observed voxels ends at a measured surface is occupied, for ever.

// One work item handles LANES surfels of a page of the window, those of them that are new and those that 5_visit has found at a surface;
// work item PAGE_ITEMS n + m has the surfels from LANES m of pages[n].
//   in  counts: of decide_to_go_on;  changed: which surfels they are;  depth, column_end: of 1_observed_space
//       color[height][width]: red | green << 8 | blue << 16, if has_color
//   i/o surfels: their attributes
__kernel void label_surfels(__global const uint* counts, const Frame f, __global const float* depth, __global const int* column_end,
                            __global const uint* color, __global const uint* pages, const uint count, __global const ulong* alive,
                            __global const ulong* changed, __global const int4* page_block, __global uint4* surfels) {
  const uint n = get_global_id(0) / PAGE_ITEMS;
  if (counts[COUNT_GOES_ON] == 0 || n >= count) return;
  const uint page = pages[n], first = PAGE_SLOTS * page + LANES * (get_global_id(0) % PAGE_ITEMS);
  const uint lanes = lanes_of_page(alive[page] & changed[page], first);
  if (lanes == 0) return;
  const Surfels s = load_surfels(&f.window, surfels, page_block[page], first);
  const Points position = transformed(&f.T_camera_local, s.position);
  const Voxels v = voxels_at(&f.grid, position);
  const intv unlabelled = inside_grid(&f.grid, v) & lack_label(s.attributes, f.has_color);
  intv at;
  const intv labelled = at_surface(&f.grid, depth, column_end, f.limits.surface_depth, v, position.z, unlabelled, &at);
  int pixel[LANES];
  vstorev(at, 0, pixel);
  for (uint left = lanes & lane_bits(labelled); left != 0; left &= left - 1) {
    const int m = lowest_lane(left);
    uint attributes = surfels[first + m].w | SURFEL_OCCUPIED;
    if (f.has_color && (attributes & SURFEL_COLORED) == 0) attributes = (attributes & 0xff000000u) | SURFEL_COLORED | color[pixel[m]];
    surfels[first + m].w = attributes;
  }
}
