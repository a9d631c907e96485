// Taking back: space behind a surface that stands in known space becomes unknown again - ours. The world has a second lattice of points,
// laid out as the seen points are: is this point taken back? What kept views and seen points know there does not count until a frame sees
// the point again.

// Which points lie at the surfaces of chosen pixels or a little behind them?
//   own_view: from the points' frame to this frame's image
INLINE intv behind_chosen(const Grid* g, const TakeBackLimits* limits, const View* own_view, __global const float* depth,
                          __global const uchar* chosen, Points p) {
  const Points q = transformed(&own_view->to_image, p);
  const floatv scale = divided(1.0f, q.z), s = q.x * scale, t = q.y * scale;
  intv behind = MARK(q.z > 0.0f) & MARK(s >= 0.0f) & MARK(t >= 0.0f) & MARK(s < (float)g->width) & MARK(t < (float)g->height);
  if (!any_lane(behind)) return 0;
  const intv pixel = behind ? convert_intv(t) * g->width + convert_intv(s) : 0;
  const floatv d = gather_float(depth, pixel);
  behind &= MARK(q.z >= d) & MARK(q.z <= d + limits->reach * voxel_size(g, d));
  uint marks = lane_bits(behind);
  int at[LANES];
  vstorev(pixel, 0, at);
  for (uint left = marks; left != 0; left &= left - 1)
    if (chosen[at[lowest_lane(left)]] == 0) marks &= ~(left & -left);
  return lane_marks(marks);
}

// One work item handles a cube of words of a brick, as see_points does. Without has_chosen it may be launched before the host knows whether
// any pixel was chosen: if any was, nothing is done here, because the host launches it again with more bricks.
//   in  own_view: from the window's frame to this frame's image;  depths: its image, as views keep it
//       depth, chosen [height][width]: of this frame;  chosen_count: of choose_pixels
//       taken_by[count]: x, y, z of a brick, counted in bricks from the window's corner, and its number
//   i/o bricks: bits of the points behind chosen pixels are set, and those of points that this frame sees are cleared
__kernel void take_points(const Frame f, const TakeBackLimits limits, const View own_view, __global const ushort* depths,
                          __global const float* depth, const int has_chosen, __global const uchar* chosen,
                          __global const uint* chosen_count, __global const int4* taken_by, const int count, __global ulong* bricks) {
  const int n = get_global_id(0) / SEE_CUBES, cube = get_global_id(0) % SEE_CUBES, edges = 4 / SEE_EDGE;
  if (n >= count || (*chosen_count > 0) != (has_chosen != 0)) return;
  const int4 brick = taken_by[n];
  const int3 corner = SEE_EDGE * (int3)(cube % edges, cube / edges % edges, cube / edges / edges);  // [word]
  __global ulong* words = bricks + SEEN_WORDS * brick.w + (corner.z * 4 + corner.y) * 4 + corner.x;
  ulong any = 0;
  for (int w = 0; w < SEE_EDGE * SEE_EDGE * SEE_EDGE; ++w) any |= words[SEE_WORD(w)];

  const float spacing = seen_spacing(&f.window, f.seen_shift), half_size = 2.0f * SEE_EDGE * spacing;
  const int3 first = SEEN_BRICK * brick.xyz + 4 * corner;  // [point]
  const bool may_see = any != 0 && cube_in_view(&own_view, depths, convert_float3(first) * spacing + half_size, half_size) != SEEN_NONE;
  if (!may_see && !has_chosen) return;
  for (int w = 0; w < SEE_EDGE * SEE_EDGE * SEE_EDGE; ++w) {
    const ulong before = words[SEE_WORD(w)];
    if (before == 0 && !has_chosen) continue;
    const int3 of_word = first + 4 * (int3)(w & 1, w >> 1 & 1, w >> 2);
    ulong taken = 0;
    for (int bit = 0; bit < 64; bit += LANES) {
      const Points p = points_of_word(of_word, bit, spacing);
      intv is_taken = lane_marks((uint)(before >> bit));
      if (has_chosen) is_taken |= behind_chosen(&f.grid, &limits, &own_view, depth, chosen, p);
      if (any_lane(is_taken)) is_taken &= ~knows(&own_view, depths, p, is_taken);
      taken |= (ulong)lane_bits(is_taken) << bit;
    }
    if (taken != before) words[SEE_WORD(w)] = taken;
  }
}
