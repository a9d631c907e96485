// Labels and colour - paper 3.5: a surfel where a column of observed voxels ends at a measured surface is occupied, for ever.

// One work item a surfel in view, new ones included.
//   in  depth, column_end: of 2_observed_space;  color[height][width]: red | green << 8 | blue << 16, if has_color
__kernel void label_surfels(const Grid g, const Limits limits, const Window window, const Transform T_camera_local,
                            __global const float* depth, __global const int* column_end, __global const uint* color, const int has_color,
                            __global const uint* in_view_slots, const uint count, __global const ulong* alive,
                            __global const int4* page_block, __global uint4* surfels, __global uint* changed) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const uint slot = in_view_slots[n];
  if (!is_alive(alive, slot)) return;
  const uint4 surfel = surfels[slot];
  const bool colored = (surfel.w & SURFEL_COLORED) != 0 || !has_color;
  if ((surfel.w & SURFEL_OCCUPIED) != 0 && colored) return;

  const float3 p = transform_point(&T_camera_local, surfel_position(&window, surfel, page_block[slot / PAGE_SLOTS]));
  const int3 v = voxel_of(to_grid(&g, p));
  if (!at_surface(&g, depth, column_end, limits.surface_depth, v, p.z)) return;

  uint labelled = surfel.w | SURFEL_OCCUPIED;
  if (!colored) labelled = (labelled & 0xff000000u) | SURFEL_COLORED | color[pixel_of(&g, v)];
  surfels[slot].w = labelled;
  set_slot(changed, slot);
}
