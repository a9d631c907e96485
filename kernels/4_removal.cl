// Removal - paper 3.4, eq. (12): surfels in observed space go; the voxels of the others are noted.
// Ours: so do those whose back this frame has seen, and frontier on a sheet of unknown thinner than min_gap.

// One work item eight surfels, one group a page of the window.
//   in  in_view: which surfels are;  observed: C~;  view, depths: this frame as its own camera sees it, for the exact test
//   i/o occupied_voxels: bit field as 32-bit halves, zero before
//   out removed[count]
__kernel __attribute__((reqd_work_group_size(8, 1, 1))) void mark_removed(
    const Grid g, const Limits limits, const Window window, const Transform T_camera_local, const View view, const int remove_buried,
    __global const float* depths, __global const uint* pages, __global const ulong* in_view, __global const int4* page_block,
    __global const uint4* surfels, __global const ulong* observed, __global uint* occupied_voxels, __global ulong* removed) {
  __local uchar removed_lanes[8];
  const uint page = pages[get_group_id(0)], item = get_local_id(0);
  const uint lanes = (uint)(in_view[get_group_id(0)] >> (8 * item)) & 0xff;
  uint gone = 0;
  if (lanes != 0) {
    const Surfels8 s = load_eight(&window, &T_camera_local, surfels, page_block[page], PAGE_SLOTS * page + 8 * item);
    float8 n_x, n_y, n_z;
    normals_of_eight(&s, &T_camera_local, &n_x, &n_y, &n_z);
    int8 i, j, k;
    const uint inside = lanes & lanes_of(voxels_of_eight(&g, s.x, s.y, s.z, &i, &j, &k));
    if (inside != 0 && remove_buried) {
      const float8 back = 0.25f * s.radius;
      gone |= lanes_of(view_knows_eight(&view, depths, s.x - back * n_x, s.y - back * n_y, s.z - back * n_z));
    }
    if (inside != 0 && limits.min_gap > 0.0f) {
      const float gap = limits.min_gap;
      gone |= lanes_of((s.attributes & SURFEL_OCCUPIED) == 0 &&
                       view_knows_eight(&view, depths, s.x - gap * n_x, s.y - gap * n_y, s.z - gap * n_z));
    }
    gone &= inside;
    int word[8], layer[8];
    vstore8((j * g.words_k + (k >> 6)) * g.size_i + i, 0, word);
    vstore8(k, 0, layer);
    for (uint left = inside & ~gone; left != 0; left &= left - 1) {
      const int n = lowest_lane(left);
      if ((observed[word[n]] >> (layer[n] & 63)) & 1) {
        gone |= 1u << n;
      } else {
        atomic_or(&occupied_voxels[2 * word[n] + ((layer[n] >> 5) & 1)], 1u << (layer[n] & 31));
      }
    }
  }
  removed_lanes[item] = gone;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0) removed[get_group_id(0)] = pack_lanes(removed_lanes);
}

// One work item a page of the window: slots of removed surfels become free.
__kernel void remove_surfels(__global const uint* pages, const uint count, __global const ulong* removed, __global ulong* alive,
                             __global ulong* changed) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  alive[pages[n]] &= ~removed[n];
  changed[pages[n]] |= removed[n];
}
