// Evidence that a measured surface stands where space was known to be free - ours. Known space only grows by the paper's method, so the
// deepest measurement of all would decide for ever, and a box that is put down would never appear.
//
// A pixel's surface has strong evidence if most of the last frames that look there measure it as well, and if enough kept views contradict
// it: they have seen farther there, by a wide margin. Views older than the last frames are asked, the newest first. From the newest
// contradiction on some opinions count: a surface with which more than half as many views agree as contradict it is an old one, seen with
// errors. Views that agree and are newer have seen the same thing already. Seen points contradict a surface as well, if they are seen all
// around it. Weak evidence needs smaller numbers and margins.
//
// Only where all pixels of a square have strong evidence is space taken back: at the edges of things that stand still, errors of poses
// alone make surfaces lie in known space. From there it goes on to the pixels around that have weak evidence.

// LANES pixels of the frame, and the points that they measure.
typedef struct {
  intv measured;        // marks of those that measure a surface
  Points p;             // camera frame [m]
  floatv voxel, noise;  // voxel_size there; three standard deviations of a depth and a step [m]
} MeasuredPoints;

//   s, t: columns and rows
INLINE MeasuredPoints points_of_pixels(const Grid* g, const TakeBackLimits* limits, __global const float* depth, intv s, intv t) {
  MeasuredPoints m;
  const intv inside = MARK(s < g->width) & MARK(t < g->height);
  const floatv d = gather_float(depth, inside ? t * g->width + s : 0);
  m.measured = inside & MARK(d > 0.0f);
  m.p.x = divided((convert_floatv(s + g->padding_i) - g->center_i) * d, g->fx);
  m.p.y = divided((convert_floatv(t + g->padding_j) - g->center_j) * d, g->fy);
  m.p.z = d;
  m.voxel = voxel_size(g, d);
  m.noise = 3.0f * (limits->noise + limits->noise_growth * d * d) + limits->quantisation * d * d;
  return m;
}

// Pixels of a view that points lie in, if the view has all 8 pixels around them.
//   out q: the points in the view;  s, t: columns and rows
INLINE intv pixels_in_view(const View* view, Points p, intv asked, Points* q, intv* s, intv* t) {
  *q = transformed(&view->to_image, p);
  const floatv scale = divided(1.0f, q->z), x = q->x * scale, y = q->y * scale;
  const intv inside = asked & MARK(q->z > 0.0f) & MARK(x >= 1.0f) & MARK(y >= 1.0f) & MARK(x < (float)(view->width - 1)) &
                      MARK(y < (float)(view->height - 1));
  *s = inside ? convert_intv(x) : 1;
  *t = inside ? convert_intv(y) : 1;
  return inside;
}

// Does one of the last frames measure a surface at the points, within `margin` [m] of what its 3 x 3 pixels there measure?
//   images: of the last frames, [height][width] each from first_pixel on;   i/o looked: minus the number of frames that look there
INLINE intv frame_supports(const View* view, __global const float* images, Points p, floatv margin, intv asked, intv* looked) {
  Points q;
  intv s, t;
  const intv inside = pixels_in_view(view, p, asked, &q, &s, &t);
  if (!any_lane(inside)) return 0;
  *looked += inside;
  floatv nearest = INFINITY, farthest = 0.0f;
  for (int n = 0; n < 9; ++n) {
    const floatv d = gather_float(images + view->first_pixel, (t + n / 3 - 1) * view->width + s + n % 3 - 1);
    nearest = fmin(nearest, d > 0.0f ? d : (floatv)(INFINITY));
    farthest = fmax(farthest, d);
  }
  return inside & MARK(q.z >= nearest - margin) & MARK(q.z <= farthest + margin);
}

INLINE floatv depths_at(const View* view, __global const ushort* depths, intv s, intv t) {
  const uintv pixel = view->first_pixel + view_pixels((uint)view->width, as_uintv(s), as_uintv(t));
  return view_depths(depths, as_intv(pixel), view->depth_step);
}

// The smallest of the 3 x 3 depths that a kept view has around a pixel [m].
INLINE float smallest_around(const View* view, __global const ushort* depths, int s, int t) {
  const int columns = (view->width + PATCH_COLUMNS - 1) / PATCH_COLUMNS;
  __global const ushort* own = depths + view->first_pixel;
  ushort smallest = 65535;
  for (int row = t - 1; row <= t + 1; ++row) {
    __global const ushort* of_row = own + (row / PATCH_ROWS * columns * PATCH_ROWS + row % PATCH_ROWS) * PATCH_COLUMNS;
    for (int column = s - 1; column <= s + 1; ++column)
      smallest = min(smallest, of_row[column / PATCH_COLUMNS * (PATCH_ROWS * PATCH_COLUMNS) + column % PATCH_COLUMNS]);
  }
  return (float)smallest * view->depth_step;
}

// How much farther than points a kept view has seen there [m]: its pixel there, and all 3 x 3 pixels around it if it sees farther by
// `margin`. -INFINITY where it has not looked, or where that is not clear.
INLINE floatv seen_farther(const View* view, __global const ushort* depths, Points p, floatv margin, intv asked) {
  Points q;
  intv s, t;
  const intv inside = pixels_in_view(view, p, asked, &q, &s, &t);
  if (!any_lane(inside)) return -INFINITY;
  const floatv middle = depths_at(view, depths, s, t);
  const intv looked = inside & MARK(middle > 0.0f), farther = looked & MARK(middle > q.z + margin);
  if (!any_lane(farther)) return looked ? middle - q.z : (floatv)(-INFINITY);
  float seen[LANES];
  int column[LANES], row[LANES];
  vstorev(middle, 0, seen);
  vstorev(s, 0, column);
  vstorev(t, 0, row);
  for (uint left = lane_bits(farther); left != 0; left &= left - 1) {  // mostly few
    const int n = lowest_lane(left);
    seen[n] = smallest_around(view, depths, column[n], row[n]);
  }
  const floatv smallest = vloadv(0, seen);
  const intv unclear = farther & MARK(smallest <= q.z + margin);
  const intv known = looked & ~unclear;
  return known ? smallest - q.z : (floatv)(-INFINITY);
}

// Was the space around points seen before, by `margin` [m]: behind them, and beside them along the image's axes?
INLINE intv deep_in_seen_space(const Frame* f, const SeenPoints* seen, Points p, floatv margin, intv asked) {
  intv deep = seen_before(f, seen, p, asked);
  if (any_lane(deep)) deep = seen_before(f, seen, scaled(1.0f + divided(margin, lengths(p)), p), deep);
  for (int n = 0; n < 4 && any_lane(deep); ++n) {
    const floatv step = n % 2 == 0 ? margin : -margin;
    const Points beside = {p.x + (n < 2 ? step : 0.0f), p.y + (n < 2 ? 0.0f : step), p.z};
    deep = seen_before(f, seen, beside, deep);
  }
  return deep;
}

// What the work items of a group tell each other, where VIEW_TEAM of them have a pixel together.
typedef struct {
  int supporting[HEAVY_GROUP], looking[HEAVY_GROUP];
  uchar said[2][HEAVY_GROUP];  // by turns, so that one may be written while others still read the last round's
  int any;
} Team;

// What the kernels ask: the last frames, older kept views, seen points and taken points.
typedef struct {
  __global const View* last_frames;
  __global const float* images;
  __global const View* views;
  __global const ushort* depths;
  SeenPoints seen, taken;
  int frame_count, view_count;
  __local Team* told;
} Witnesses;

// Distances within which depths agree, and beyond which they contradict a surface [m].
typedef struct {
  floatv agree, weak, strong;
} Margins;

INLINE Margins margins_of(const TakeBackLimits* limits, const MeasuredPoints* m) {
  return (Margins){limits->support_margin * m->voxel + m->noise, fmax(limits->weak_margin * m->voxel, m->noise),
                   fmax(limits->strong_margin * m->voxel, m->noise)};
}

// Of LANES pixels: how many of the last frames support the surface, and minus the number of those that look there.
typedef struct {
  intv supports, looked;
} Support;

// Numbers of opinions: of weak contradictions, strong ones among them, views that agree but are older than the newest contradiction, and
// newer ones, which may have seen the same thing.
typedef struct {
  intv strong, weak, agree, newer;
} Opinions;

// Which of LANES pixels have not heard enough opinions yet?
INLINE intv undecided(const TakeBackLimits* limits, const Opinions* o, intv open) {
  return open & MARK(o->weak + o->agree < limits->opinions) & MARK(o->newer < limits->newer_opinions);
}

// Adds those of the next view.
INLINE void add_opinions(intv agrees, intv contradicts, intv strongly, Opinions* o) {
  const intv first = MARK(o->weak == 0);
  o->newer -= agrees & first;
  o->agree -= agrees & ~first;
  o->weak -= contradicts;
  o->strong -= strongly;
}

#if VIEW_TEAM == 1
INLINE Support support_of(const Witnesses* w, const MeasuredPoints* m, const Margins* margins) {
  Support support = {0, 0};
  for (int n = 0; n < w->frame_count; ++n) {
    const View view = w->last_frames[n];
    support.supports -= frame_supports(&view, w->images, m->p, margins->agree, m->measured, &support.looked);
  }
  return support;
}

INLINE Opinions opinions_of(const TakeBackLimits* limits, const Witnesses* w, const MeasuredPoints* m, const Margins* margins, intv open) {
  Opinions opinions = {0, 0, 0, 0};
  for (int n = 0; n < w->view_count; ++n) {
    const intv asked = undecided(limits, &opinions, open);
    if (!any_lane(asked)) break;
    const View view = w->views[n];
    const floatv farther = seen_farther(&view, w->depths, m->p, margins->weak, asked);
    const intv contradicts = MARK(farther > margins->weak);
    add_opinions(MARK(fabs(farther) <= margins->agree) & ~contradicts, contradicts, MARK(farther > margins->strong), &opinions);
  }
  return opinions;
}
#else
// Where the work items of a team have a pixel together, each asks its own of the last frames and of the kept views, whose opinions are
// added up in their order. Every work item of the group must call this.
INLINE Support support_of(const Witnesses* w, const MeasuredPoints* m, const Margins* margins) {
  const int item = get_local_id(0), own = item % VIEW_TEAM, team = item - own;
  Support support = {0, 0};
  for (int n = own; n < w->frame_count; n += VIEW_TEAM) {
    const View view = w->last_frames[n];
    support.supports -= frame_supports(&view, w->images, m->p, margins->agree, m->measured, &support.looked);
  }
  w->told->supporting[item] = support.supports;
  w->told->looking[item] = support.looked;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int n = team; n < team + VIEW_TEAM; ++n) {
    if (n == item) continue;
    support.supports += w->told->supporting[n];
    support.looked += w->told->looking[n];
  }
  return support;
}

#define AGREES 1
#define CONTRADICTS 2
#define CONTRADICTS_STRONGLY 4

INLINE Opinions opinions_of(const TakeBackLimits* limits, const Witnesses* w, const MeasuredPoints* m, const Margins* margins, intv open) {
  const int item = get_local_id(0), own = item % VIEW_TEAM, team = item - own;
  Opinions opinions = {0, 0, 0, 0};
  for (int first = 0, turn = 0; first < w->view_count; first += VIEW_TEAM, turn = 1 - turn) {
    __local uchar* said = w->told->said[turn];
    const intv asked = undecided(limits, &opinions, open);
    uchar opinion = 0;
    if (asked && first + own < w->view_count) {
      const View view = w->views[first + own];
      const float farther = seen_farther(&view, w->depths, m->p, margins->weak, asked);
      if (farther > margins->weak)
        opinion = farther > margins->strong ? CONTRADICTS | CONTRADICTS_STRONGLY : CONTRADICTS;
      else if (fabs(farther) <= margins->agree)
        opinion = AGREES;
    }
    said[item] = opinion;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int n = team; n < team + VIEW_TEAM && undecided(limits, &opinions, open); ++n)
      add_opinions(MARK((said[n] & AGREES) != 0), MARK((said[n] & CONTRADICTS) != 0), MARK((said[n] & CONTRADICTS_STRONGLY) != 0),
                   &opinions);
  }
  return opinions;
}
#endif

// The evidence of LANES pixels.
INLINE intv evidence_of(const Frame* f, const TakeBackLimits* limits, const Witnesses* w, const MeasuredPoints* m) {
  const Margins margins = margins_of(limits, m);
  const Support support = support_of(w, m, &margins);
  intv open = m->measured & MARK(support.supports >= limits->weak_supports);
  // What was taken back already need not be taken back again.
  if (f->has_taken) open &= ~seen_before(f, &w->taken, scaled(1.0f + divided(0.5f * limits->reach * m->voxel, lengths(m->p)), m->p), open);

  Opinions o = opinions_of(limits, w, m, &margins, open);
  if (f->has_seen) {
    const intv by_seen =
        deep_in_seen_space(f, &w->seen, m->p, margins.weak, open & MARK(2 * (o.agree + o.newer) <= limits->contradictions));
    o.weak = by_seen ? max(o.weak, limits->contradictions) : o.weak;
    o.strong = deep_in_seen_space(f, &w->seen, m->p, margins.strong, by_seen) ? max(o.strong, limits->contradictions) : o.strong;
  }
  const intv is_weak = open & MARK(o.weak >= limits->contradictions) & MARK(o.weak >= 2 * o.agree),
             is_strong = is_weak & MARK(o.strong >= limits->contradictions) &
                         MARK(LAST_FRAMES * support.supports >= -limits->strong_supports * support.looked);
  return is_strong ? STRONG_EVIDENCE : is_weak ? WEAK_EVIDENCE : NO_EVIDENCE;
}

// Is it true for any work item of those that work together? All of the group must ask.
INLINE bool any_of_group(bool own, __local Team* told) {
#if VIEW_TEAM == 1
  return own;
#else
  if (get_local_id(0) == 0) told->any = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (own) told->any = 1;
  barrier(CLK_LOCAL_MEM_FENCE);
  return told->any != 0;
#endif
}

INLINE int coarse_size(int pixels) { return (pixels + TAKE_SQUARE - 1) / TAKE_SQUARE; }

INLINE void store_bytes(intv values, int count, __global uchar* to) {
  int some[LANES];
  vstorev(values, 0, some);
  for (int n = 0; n < min(count, LANES); ++n) to[n] = (uchar)some[n];
}

// Can a pixel of a chunk belong to a square with strong evidence, or be near enough to one? Every square has a pixel of the coarse image.
//   coarse[coarse rows][coarse columns]: evidence there;  column, row: the chunk's first pixel
INLINE bool is_near_evidence(const Grid* g, __global const uchar* coarse, int column, int row) {
  const int columns = coarse_size(g->width), rows = coarse_size(g->height), reach = TAKE_SQUARE / 2 + TAKE_GROWTH;
  bool near = false;
  for (int y = max(row - reach, 0) / TAKE_SQUARE; y <= min((row + reach) / TAKE_SQUARE, rows - 1); ++y)
    for (int x = max(column - reach, 0) / TAKE_SQUARE; x <= min((column + LANES - 1 + reach) / TAKE_SQUARE, columns - 1); ++x)
      near = near || coarse[y * columns + x] == STRONG_EVIDENCE;
  return near;
}

// Evidence of pixels, in two launches: of every TAKE_SQUARE-th column and row, and then of all that are near to what has strong evidence
// there. One work item handles LANES pixels, or a team of work items handles one. Chunks begin anew in each row of the whole image, but not
// in those of the coarse one, which are short.
//   in  depth[height][width] [m]: of this frame;  last_frames[frame_count], images;  views[view_count], depths: as in Witnesses
//       seen_..., taken_...: slots, tables, bricks of the seen points (common/seen_points.cl), and of those that were taken back
//       step: TAKE_SQUARE, then 1;  coarse: what the first launch has found
//   out evidence[rows][columns]: of the coarse image, then of the whole one
__kernel void weigh_evidence(const Frame f, const TakeBackLimits limits, __global const float* depth, __global const View* last_frames,
                             const int frame_count, __global const float* images, __global const View* views, const int view_count,
                             __global const ushort* depths, __global const int* seen_slots, __global const int* seen_tables,
                             __global const int* seen_bricks, __global const int* taken_slots, __global const int* taken_tables,
                             __global const int* taken_bricks, const int step, __global const uchar* coarse, __global uchar* evidence) {
  __local Team told;
  const bool is_coarse = step > 1;
  const int columns = is_coarse ? coarse_size(f.grid.width) : f.grid.width, rows = is_coarse ? coarse_size(f.grid.height) : f.grid.height,
            width = is_coarse ? columns : LANES * chunks_of(columns), first = LANES * ((int)get_global_id(0) / VIEW_TEAM);
  if (VIEW_TEAM == 1 && first >= rows * width) return;
  const bool near = is_coarse || is_near_evidence(&f.grid, coarse, first % width, first / width);
  intv found = NO_EVIDENCE;
  if (any_of_group(near, &told)) {
    const Witnesses w = {
        last_frames, images,     views, depths, {seen_slots, seen_tables, seen_bricks}, {taken_slots, taken_tables, taken_bricks},
        frame_count, view_count, &told};
    const intv n = first + lane_numbers(), row = quotients(n, width);
    MeasuredPoints m = points_of_pixels(&f.grid, &limits, depth, step * (n - row * width), step * row);
    m.measured &= near ? (intv)(-1) : (intv)(0);
    found = evidence_of(&f, &limits, &w, &m);
  }
  if (first >= rows * width || get_global_id(0) % VIEW_TEAM != 0) return;
  if (is_coarse)
    store_bytes(found, rows * columns - first, evidence + first);
  else
    store_bytes(found, columns - first % width, evidence + first / width * columns + first % width);
}

// Middles of squares of TAKE_SQUARE x TAKE_SQUARE pixels that all have strong evidence. One work item handles a pixel.
//   out squares[height][width]: 1 or 0
__kernel void find_squares(const Frame f, __global const uchar* evidence, __global uchar* squares) {
  const int n = get_global_id(0), s = n % f.grid.width, t = n / f.grid.width, half_side = TAKE_SQUARE / 2;
  if (t >= f.grid.height) return;
  bool strong =
      s >= half_side && t >= half_side && s + half_side < f.grid.width && t + half_side < f.grid.height && evidence[n] == STRONG_EVIDENCE;
  for (int m = 0; strong && m < TAKE_SQUARE * TAKE_SQUARE; ++m)
    strong = evidence[n + (m / TAKE_SQUARE - half_side) * f.grid.width + m % TAKE_SQUARE - half_side] == STRONG_EVIDENCE;
  squares[n] = strong ? 1 : 0;
}

// Pixels whose surface takes space back: those with evidence that are near the middle of a square. One work item handles a pixel.
//   out chosen[height][width]: 1 or 0;  count: the number of such pixels is added to it
__kernel void choose_pixels(const Frame f, __global const uchar* evidence, __global const uchar* squares, __global uchar* chosen,
                            __global uint* count) {
  const int n = get_global_id(0), s = n % f.grid.width, t = n / f.grid.width;
  if (t >= f.grid.height) return;
  bool near = false;
  if (evidence[n] != NO_EVIDENCE)
    for (int v = max(t - TAKE_GROWTH, 0); v <= min(t + TAKE_GROWTH, f.grid.height - 1); ++v)
      for (int u = max(s - TAKE_GROWTH, 0); u <= min(s + TAKE_GROWTH, f.grid.width - 1); ++u)
        near = near || squares[v * f.grid.width + u] != 0;
  chosen[n] = near ? 1 : 0;
  if (near) atomic_inc(count);
}
