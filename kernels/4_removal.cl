// Removal - paper 3.4, eq. (12): surfels in observed space go; the voxels of the others are noted.
// Ours: so do those whose back this frame has seen, and frontier on a sheet of unknown thinner than min_gap.

// One work item a surfel in view, one group a word.
//   in  observed: C~;  view, depths: this frame as its own camera sees it, for the exact test
//   i/o occupied_voxels: bit field as 32-bit halves, zero before
//   out removed[ceil(count / 64)]: bit n % 64 of word n / 64 for surfel n in view
__kernel __attribute__((reqd_work_group_size(64, 1, 1))) void mark_removed(
    const Grid g, const Limits limits, const Window window, const Transform T_camera_local, const View view, const int remove_buried,
    __global const float* depths, __global const ViewSurfel* view_surfels, const uint count, __global const int4* page_block,
    __global const uint4* surfels, __global const ulong* observed, __global uint* occupied_voxels, __global ulong* removed) {
  __local uchar mark[64];
  const uint n = get_global_id(0), lane = get_local_id(0);
  mark[lane] = 0;
  if (n < count) {
    const ViewSurfel s = view_surfels[n];
    const int3 v = voxel_of((float3)(s.i, s.j, s.k));
    if (inside_grid(&g, v)) {
      const uint4 surfel = surfels[s.slot];
      const float3 p = transform_point(&T_camera_local, surfel_position(&window, surfel, page_block[s.slot / PAGE_SLOTS]));
      const float3 normal = (float3)(s.n_x, s.n_y, s.n_z);
      const bool frontier = (surfel.w & SURFEL_OCCUPIED) == 0;
      mark[lane] = test_bit(&g, observed, v) || (remove_buried && view_knows(&view, depths, p - 0.25f * surfel_radius(surfel) * normal)) ||
                   (limits.min_gap > 0.0f && frontier && view_knows(&view, depths, p - limits.min_gap * normal));
      if (!mark[lane]) atomic_or(&occupied_voxels[2 * word_index(&g, v.x, v.y, v.z >> 6) + ((v.z >> 5) & 1)], 1u << (v.z & 31));
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  if (lane == 0) removed[get_group_id(0)] = pack_marks(mark);
}

// One work item a removed surfel: its slot becomes free.
//   in  removed_list[count]: numbers of surfels in view
__kernel void remove_surfels(__global const uint* removed_list, const uint count, __global const ViewSurfel* view_surfels,
                             __global uint* alive, __global uint* changed) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const uint slot = view_surfels[removed_list[n]].slot;
  clear_slot(alive, slot);
  set_slot(changed, slot);
}
