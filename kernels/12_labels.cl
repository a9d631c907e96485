// Labels and colour - paper 3.5: a surfel where a column of observed voxels ends at a measured surface is occupied, for ever.

// One work item a surfel in view, new ones included.
//   in  depth, column_end: of 2_observed_space;  color[height][width]: red | green << 8 | blue << 16, if has_color
__kernel void label_surfels(const Grid g, const Limits limits, const Transform T_camera_world, __global const float* depth,
                            __global const int* column_end, __global const uint* color, const int has_color,
                            __global const uint* in_view_slots, const uint count, __global const float4* position_radius,
                            __global float4* normal_attributes, __global uint* changed, const uint frame) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const uint slot = in_view_slots[n];
  const uint attributes = as_uint(normal_attributes[slot].w);
  if ((attributes & SURFEL_ALIVE) == 0) return;
  const bool colored = (attributes & SURFEL_COLORED) != 0 || !has_color;
  if ((attributes & SURFEL_OCCUPIED) != 0 && colored) return;

  const float3 p = transform_point(&T_camera_world, position_radius[slot].xyz);
  const int3 v = voxel_of(to_grid(&g, p));
  if (!at_surface(&g, depth, column_end, limits.surface_depth, v, p.z)) return;

  uint labelled = attributes | SURFEL_OCCUPIED;
  if (!colored) labelled = (labelled & 0xff000000u) | SURFEL_COLORED | color[pixel_of(&g, v)];
  normal_attributes[slot].w = as_float(labelled);
  changed[slot] = frame;
}
