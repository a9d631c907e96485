// Visit of the window's surfels: all that a frame asks of them, in one pass. Which are in view, and which of these must be split -
// paper 3.4; which are removed - eq. (12): surfels in observed space go -; and which 18_labels is to label. Voxels of surfels that stay are
// no candidates for new ones. Ours: surfels go also where this frame has seen their back, and frontier on a sheet of unknown thinner than
// min_gap; and those that float in space that was taken back.

// Which of LANES surfels have an ellipsoid that may reach into the grid, generously.
//   s: camera frame;  voxel: voxel_size at each of them
INLINE intv reach_grid(const Grid* g, const Limits* limits, const Surfels* s, floatv voxel) {
  const Points p = s->position;
  const floatv slope = divided(1.0f, fmax(p.z, g->z_min));
  const floatv reach = fmax(divided(2.0f * s->radius, voxel), limits->thickness) + REACH_MARGIN;
  const floatv i = p.x * slope * g->fx + g->center_i, j = p.y * slope * g->fy + g->center_j;
  const floatv reach_i = reach * (1.0f + fabs(p.x * slope)), reach_j = reach * (1.0f + fabs(p.y * slope));
  return MARK(p.z >= -((float)g->padding_k + reach) * voxel) & MARK(p.z <= g->z_max + 2.0f * reach * voxel) & MARK(i > -reach_i) &
         MARK(i < (float)g->size_i + reach_i) & MARK(j > -reach_j) & MARK(j < (float)g->size_j + reach_j);
}

// Which surfels this frame's view takes away, of those that are asked.
//   s, normal: camera frame
INLINE intv are_seen_through(const Limits* limits, const View* view, __global const ushort* depths, const Surfels* s, Points normal,
                             intv asked) {
  intv gone = 0;
  if (limits->remove_buried) gone |= own_view_knows(view, depths, add_scaled(s->position, -limits->back_probe * s->radius, normal), asked);
  if (limits->min_gap > 0.0f)
    gone |= own_view_knows(view, depths, add_scaled(s->position, -limits->min_gap, normal),
                           asked & ~gone & MARK((s->attributes & SURFEL_OCCUPIED) == 0));
  return gone;
}

// Which surfels float: the space before them, which should be known, was taken back, and this frame does not see it.
//   s, normal: camera frame
INLINE intv are_floating(const Frame* f, const SeenPoints* taken, __global const ushort* depths, const Surfels* s, Points normal,
                         intv asked) {
  const Points front = add_scaled(s->position, divided(f->limits.front_probe, f->limits.create_radius) * s->radius, normal);
  const intv floating = seen_before(f, taken, front, asked);
  return any_lane(floating) ? floating & ~own_view_knows(&f->own_view, depths, front, floating) : 0;
}

// Takes voxels off the candidates.
//   at, bit: numbers of 32-bit halves of words, and bits of them;  taken: marks of those that go
INLINE void clear_candidates(__global int* candidates, intv at, intv bit, intv taken) {
  int words[LANES], bits[LANES];
  vstorev(at, 0, words);
  vstorev(bit, 0, bits);
  for (uint left = lane_bits(taken); left != 0; left &= left - 1) {
    const int n = lowest_lane(left);
    atomic_and(&candidates[words[n]], ~bits[n]);
  }
}

// What is found out of some surfels: a bit for each.
typedef struct {
  uint in_view, large, removed, labelled;
} Findings;

// Findings about the surfels of a page.
typedef struct {
  SharedWord in_view, large, removed, labelled;
} PageFindings;

// One work item handles LANES surfels of a page; work item PAGE_ITEMS n + m has the surfels from LANES m of pages[n].
//   in  pages[count]: those of the window;  depths: images of views, this frame's among them;  depth, column_end: of 1_observed_space
//       alive, page_block, surfels: the map;  observed: bit field C~, as 32-bit halves
//       slots, tables, bricks: of points that were taken back (common/seen_points.cl)
//   i/o candidates: bit field by tiles, as 32-bit halves: voxels of surfels that stay are taken off
//       changed: bits of surfels that stay and that 18_labels will label are set
//       counts[COUNTS]: COUNT_IN_VIEW, COUNT_LARGE, COUNT_REMOVED and COUNT_LABELLED are added to
//   out in_view[count], large[count], removed[count]: a bit for each surfel of each page
__kernel __attribute__((reqd_work_group_size(PAGE_GROUP, 1, 1))) void visit_surfels(
    const Frame f, __global const ushort* depths, __global const float* depth, __global const int* column_end, __global const uint* pages,
    const uint count, __global const ulong* alive, __global const int4* page_block, __global const uint4* surfels,
    __global const int* observed, __global const int* slots, __global const int* tables, __global const int* bricks,
    __global int* candidates, __global ulong* changed, __global ulong* in_view, __global ulong* large, __global ulong* removed,
    __global uint* counts) {
  __local PageFindings of_pages[PAGE_GROUP / PAGE_ITEMS];
  const SeenPoints taken = {slots, tables, bricks};
  const uint n = get_global_id(0) / PAGE_ITEMS, item = get_local_id(0) % PAGE_ITEMS;
  __local PageFindings* of_page = &of_pages[get_local_id(0) / PAGE_ITEMS];
  const uint page = pages[min(n, count - 1)], first = PAGE_SLOTS * page + LANES * item;
  const uint next = pages[min(n + 3, count - 1)];  // pages lie anywhere in the map
  for (int m = 0; m < LANES; m += 4) PREFETCH(surfels + PAGE_SLOTS * next + LANES * item + m);
  const uint lanes = n < count ? lanes_of_page(alive[page], first) : 0;
  Findings found = {0, 0, 0, 0};
  if (lanes != 0) {
    Surfels s = load_surfels(&f.window, surfels, page_block[page], first);
    s.position = transformed(&f.T_camera_local, s.position);
    const floatv voxel = voxel_size(&f.grid, s.position.z);
    const intv seen = reach_grid(&f.grid, &f.limits, &s, voxel) & lane_marks(lanes);
    found.in_view = lane_bits(seen);
    if (found.in_view != 0) {
      const Voxels v = voxels_at(&f.grid, s.position);
      const intv inside = inside_grid(&f.grid, v) & seen;
      found.large = lane_bits(inside & MARK(divided(s.radius, voxel) >= f.limits.split_radius));
      const intv bit = half_bits(v.k), candidate = inside ? candidate_halves(&f.grid, v) : 0;
      const intv is_candidate = inside & MARK((gather_int(candidates, candidate) & bit) != 0);
      // Candidates are not observed: only the others are looked up. A voxel that another work item takes off meanwhile is looked up as
      // well, which makes no difference.
      const intv rest = inside & ~is_candidate, at = rest ? voxel_halves(&f.grid, v) : 0;
      intv stay = is_candidate | (rest & MARK((gather_int(observed, at) & bit) == 0));
      const Points normal = rotated(&f.T_camera_local, unpack_normals(s.normal));
      stay &= ~are_seen_through(&f.limits, &f.own_view, depths, &s, normal, stay);
      if (f.takes_back) stay &= ~are_floating(&f, &taken, depths, &s, normal, stay);
      found.removed = lane_bits(inside & ~stay);
      intv pixel;
      const intv unlabelled = stay & lack_label(s.attributes, f.has_color);
      found.labelled = lane_bits(at_surface(&f.grid, depth, column_end, f.limits.surface_depth, v, s.position.z, unlabelled, &pixel));
      clear_candidates(candidates, candidate, bit, stay & is_candidate);
    }
  }
  share_lane_bits(found.in_view, item, &of_page->in_view);
  share_lane_bits(found.large, item, &of_page->large);
  share_lane_bits(found.removed, item, &of_page->removed);
  share_lane_bits(found.labelled, item, &of_page->labelled);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item > 0 || n >= count) return;
  const ulong in_view_here = read_shared_word(&of_page->in_view), large_here = read_shared_word(&of_page->large),
              removed_here = read_shared_word(&of_page->removed), labelled_here = read_shared_word(&of_page->labelled);
  in_view[n] = in_view_here;
  large[n] = large_here;
  removed[n] = removed_here;
  changed[page] |= labelled_here;
  if (in_view_here != 0) atomic_add(&counts[COUNT_IN_VIEW], (uint)popcount(in_view_here));
  if (large_here != 0) atomic_add(&counts[COUNT_LARGE], (uint)popcount(large_here));
  if (removed_here != 0) atomic_add(&counts[COUNT_REMOVED], (uint)popcount(removed_here));
  if (labelled_here != 0) atomic_add(&counts[COUNT_LABELLED], (uint)popcount(labelled_here));
}
