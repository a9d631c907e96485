// Removal - paper 3.4, eq. (12): surfels in observed space go; voxels of the others are no candidates for new ones. Which of these are to
// be labelled (12_labels) is found out on the way. Ours: so do those whose back this frame has seen, and frontier on a sheet of unknown
// thinner than min_gap.

// Which surfels go, of those inside the grid.
INLINE int16 leaves(const Limits* limits, const View* view, int remove_buried, __global const float* depths, const Surfels* s,
                    Points normal, int16 inside) {
  int16 gone = 0;
  if (remove_buried) gone |= knows(view, depths, add_scaled(s->position, -0.25f * s->radius, normal), inside);
  if (limits->min_gap > 0.0f)
    gone |=
        knows(view, depths, add_scaled(s->position, -limits->min_gap, normal), inside & ~gone & ((s->attributes & SURFEL_OCCUPIED) == 0));
  return gone;
}

// One work item LANES surfels, one group a page of the window.
//   in  in_view: which surfels are;  observed: C~, as 32-bit halves;  view, depths: this frame as its own camera sees it, for the exact
//       test;  depth, column_end: of 2_observed_space
//   i/o candidates: as 32-bit halves: voxels of surfels that stay are taken off;  changed: those that stay and that 12_labels will label
//   out removed[count]
__kernel __attribute__((reqd_work_group_size(PAGE_SLOTS / LANES, 1, 1))) void mark_removed(
    const Grid g, const Limits limits, const Window window, const Transform T_camera_local, const View view, const int remove_buried,
    const int has_color, __global const float* depths, __global const float* depth, __global const int* column_end,
    __global const uint* pages, __global const ulong* in_view, __global const int4* page_block, __global const uint4* surfels,
    __global const int* observed, __global int* candidates, __global ulong* changed, __global ulong* removed) {
  __local ushort removed_lanes[PAGE_SLOTS / LANES], labelled_lanes[PAGE_SLOTS / LANES];
  const uint page = pages[get_group_id(0)], item = get_local_id(0), first = PAGE_SLOTS * page + LANES * item;
  removed_lanes[item] = labelled_lanes[item] = 0;
  const uint lanes = lanes_of_page(in_view[get_group_id(0)], first);
  if (lanes != 0) {
    const Surfels s = load_surfels(&window, &T_camera_local, surfels, page_block[page], first);
    const Voxels v = voxels_at(&g, s.position);
    const int16 inside = inside_grid16(&g, v) & lane_marks(lanes);
    if (lane_bits(inside) != 0) {
      const int16 at = inside ? 2 * ((v.j * g.words_k + (v.k >> 6)) * g.size_i + v.i) + ((v.k >> 5) & 1) : 0;
      const int16 bit = (int16)(1) << (v.k & 31);
      int16 stay = inside & ((gather_int(observed, at) & bit) == 0);
      stay &= ~leaves(&limits, &view, remove_buried, depths, &s, stored_normals(&s, &T_camera_local), stay);
      int16 pixel;
      const int16 unlabelled = stay & lacks_label(s.attributes, has_color);
      labelled_lanes[item] =
          (ushort)lane_bits(at_surface(&g, depth, column_end, limits.surface_depth, v, s.position.z, unlabelled, &pixel));
      removed_lanes[item] = (ushort)lane_bits(inside & ~stay);
      int words[LANES], bits[LANES];
      vstore16(at, 0, words);
      vstore16(bit, 0, bits);
      for (uint left = lane_bits(stay & ((gather_int(candidates, at) & bit) != 0)); left != 0; left &= left - 1) {
        const int n = lowest_lane(left);
        atomic_and(&candidates[words[n]], ~bits[n]);
      }
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item > 0) return;
  removed[get_group_id(0)] = pack_lanes(removed_lanes);
  changed[page] |= pack_lanes(labelled_lanes);
}

// One work item a page of the window: slots of removed surfels become free.
//   i/o counts: COUNT_REMOVED
__kernel void remove_surfels(__global const uint* pages, const uint count, __global const ulong* removed, __global ulong* alive,
                             __global ulong* changed, __global uint* counts) {
  const uint n = get_global_id(0);
  if (n >= count || removed[n] == 0) return;
  atomic_add(&counts[COUNT_REMOVED], (uint)popcount(removed[n]));
  alive[pages[n]] &= ~removed[n];
  changed[pages[n]] |= removed[n];
}
