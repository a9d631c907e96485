// Known state hull - supplement C: for each path that enters the grid through a face, the state of the last surfel that it met outside.
//
// Six images of keys, one after the other: faces i low, i high [size_j][size_k], j low, j high [size_i][size_k], k low, k high
// [size_j][size_i]. A key is the surfel's distance from the face (bits of a positive float, which sort like the number) with the state in
// its lowest bit: the smallest key is the nearest surfel, and an unknown one wins a tie. HULL_EMPTY means no surfel.

#define HULL_EMPTY 0xffffffffu

// Where one of six faces starts in a buffer that holds them in order, opposite ones being of the same size.
INLINE uint face_start(int face, uint face_i, uint face_j, uint face_k) {
  switch (face) {
    case FACE_I_LOW:
      return 0;
    case FACE_I_HIGH:
      return face_i;
    case FACE_J_LOW:
      return 2 * face_i;
    case FACE_J_HIGH:
      return 2 * face_i + face_j;
    case FACE_K_LOW:
      return 2 * (face_i + face_j);
    default:
      return 2 * (face_i + face_j) + face_k;
  }
}

// Number of the first key of a face.
INLINE uint face_offset(const Grid* g, int face) {
  return face_start(face, g->size_j * g->size_k, g->size_i * g->size_k, g->size_i * g->size_j);
}

// Enters a surfel into the cells of an ellipse in a face, as far as they are on paths to be walked or beside them.
//   center, axes: of the ellipse, in the face's coordinates (column, row);  width, height: cells of the face
//   lines: those of the face's first row;  along_k: whether columns are layers, which have a bit each in lines, else a number each;
//   row_lines: numbers from one row of lines to the next
INLINE void stamp_face(__global uint* face, int width, int height, float2 center, float2 axes, uint key, __global const uint* lines,
                       bool along_k, int row_lines) {
  const float2 half_axes = fmax(axes, 0.5f);
  if (center.x + half_axes.x < 0.0f || center.x - half_axes.x > (float)(width - 1)) return;
  const int last_row = min(floor_int(center.y + half_axes.y), height - 1);
  for (int row = max(ceil_int(center.y - half_axes.y), 0); row <= last_row; ++row) {
    const float d = divided((float)row - center.y, half_axes.y);
    const float half_width = half_axes.x * square_root(fmax(1.0f - d * d, 0.0f));
    const int last = min(floor_int(center.x + half_width), width - 1);
    __global const uint* needed = lines + row * row_lines;
    for (int column = max(ceil_int(center.x - half_width), 0); column <= last; ++column) {
      if (along_k && needed[column >> 5] == 0) {
        column |= 31;  // the whole word
        continue;
      }
      if ((along_k ? (needed[column >> 5] >> (column & 31)) & 1 : needed[column]) == 0) continue;
      atomic_min(&face[row * width + column], key);
    }
  }
}

// A surfel's key in the face that it is beyond along one family of paths; HULL_EMPTY if it is beyond neither.
//   position, size: along that family;  entering: cosine between normal and paths
INLINE uint face_key(float position, int size, float entering, float th_d, bool ragged) {
  const bool below = position < -0.5f;
  if (!below && position < (float)size - 0.5f) return HULL_EMPTY;
  const bool known = !ragged && (below ? entering > th_d : entering < -th_d);
  const float distance = below ? -0.5f - position : position - ((float)size - 0.5f);
  return (as_uint(distance) & ~1u) | (known ? 1u : 0u);
}

// Enters a surfel into the faces that it is beyond.
INLINE void enter_surfel(const Grid* grid, const Limits* limits, const ViewSurfel* surfel, __global const uint* lines,
                         __global uint* faces) {
  const Grid g = *grid;
  const ViewSurfel s = *surfel;
  const uint key_i = face_key(s.i, g.size_i, s.n_x, limits->th_d, s.ragged != 0),
             key_j = face_key(s.j, g.size_j, s.n_y, limits->th_d, s.ragged != 0);
  const uint key_k = face_key(s.k, g.size_k, s.n_k, limits->th_d, s.ragged != 0);
  const float3 axes = s.reach * square_root(fmax(1.0f - (float3)(s.n_x * s.n_x, s.n_y * s.n_y, s.n_k * s.n_k), 0.0f));
  const float unknown = limits->hull_unknown_scale;
  if (key_i != HULL_EMPTY)
    stamp_face(faces + face_offset(&g, s.i < 0.0f ? FACE_I_LOW : FACE_I_HIGH), g.size_k, g.size_j, (float2)(s.k, s.j),
               axes.zy * (key_i & 1 ? 1.0f : unknown), key_i, lines + lines_i(&g, 0, 0), true, 2 * g.words_k);
  if (key_j != HULL_EMPTY)
    stamp_face(faces + face_offset(&g, s.j < 0.0f ? FACE_J_LOW : FACE_J_HIGH), g.size_k, g.size_i, (float2)(s.k, s.i),
               axes.zx * (key_j & 1 ? 1.0f : unknown), key_j, lines + lines_j(&g, 0, 0), true, 2 * g.words_k);
  if (key_k != HULL_EMPTY)
    stamp_face(faces + face_offset(&g, s.k < 0.0f ? FACE_K_LOW : FACE_K_HIGH), g.size_i, g.size_j, (float2)(s.i, s.j),
               axes.xy * (key_k & 1 ? 1.0f : unknown), key_k, lines + lines_k(&g, 0, 0), false, g.size_i);
}

// One work item handles LANES surfels of a page: those beyond a face, and within its range in the other two coordinates (with their own
// reach as a margin), enter it. Work item PAGE_ITEMS n + m has the surfels from LANES m of pages[n].
//   in  pages[count];  alive, page_block, surfels: the map;  lines: of 10_needed_paths
//   i/o faces: six images of keys, HULL_EMPTY before; they are right on the paths to be walked
__kernel void project_hull(const Frame f, __global const uint* pages, const uint count, __global const ulong* alive,
                           __global const int4* page_block, __global const uint4* surfels, __global const uint* lines,
                           __global uint* faces) {
  const uint n = get_global_id(0) / PAGE_ITEMS;
  if (n >= count) return;
  const uint page = pages[n], first = PAGE_SLOTS * page + LANES * (get_global_id(0) % PAGE_ITEMS);
  const uint lanes = lanes_of_page(alive[page], first);
  if (lanes == 0) return;
  Surfels s = load_surfels(&f.window, surfels, page_block[page], first);
  s.position = transformed(&f.T_camera_local, s.position);
  const Voxels at = voxels_at(&f.grid, s.position);
  const intv reach = convert_intv(divided(2.0f * f.limits.hull_unknown_scale * s.radius * f.grid.f, fmax(s.position.z, f.grid.z_min))) + 2;
  const intv near_i = MARK(at.i >= -reach) & MARK(at.i < f.grid.size_i + reach),
             near_j = MARK(at.j >= -reach) & MARK(at.j < f.grid.size_j + reach),
             near_k = MARK(at.k >= -reach) & MARK(at.k < f.grid.size_k + reach);
  const intv beyond_i = MARK(at.i < 0) | MARK(at.i >= f.grid.size_i), beyond_j = MARK(at.j < 0) | MARK(at.j >= f.grid.size_j),
             beyond_k = MARK(at.k < 0) | MARK(at.k >= f.grid.size_k);
  uint left = lanes & lane_bits((beyond_i & near_j & near_k) | (beyond_j & near_i & near_k) | (beyond_k & near_i & near_j));
  if (left == 0) return;
  ViewSurfel placed[LANES];
  place_in_view(&f.grid, &s, rotated(&f.T_camera_local, unpack_normals(s.normal)), first + as_uintv(lane_numbers()), placed);
  for (; left != 0; left &= left - 1) enter_surfel(&f.grid, &f.limits, &placed[lowest_lane(left)], lines, faces);
}

// Is the state of a cell known? Not if no surfel was met there or beside it.
INLINE bool hull_cell(__global const uint* face, int width, int height, int column, int row) {
  const uint key = face[row * width + column];
  if ((key & 1u) == 0 || key == HULL_EMPTY) return false;
  return !((column > 0 && face[row * width + column - 1] == HULL_EMPTY) ||
           (column < width - 1 && face[row * width + column + 1] == HULL_EMPTY) ||
           (row > 0 && face[(row - 1) * width + column] == HULL_EMPTY) ||
           (row < height - 1 && face[(row + 1) * width + column] == HULL_EMPTY));
}

// Number of the first word of a face in the hull's bits: i faces [size_j][words_k], j faces [size_i][words_k], bits along k;
// k faces [size_j][size_i], a word each.
INLINE uint hull_word_offset(const Grid* g, int face) {
  return face_start(face, g->size_j * g->words_k, g->size_i * g->words_k, g->size_i * g->size_j);
}

// One work item handles a word of the hull: of face get_global_id(1).
//   in  faces: of project_hull;   out hull: words as hull_word_offset says, 1 = known
__kernel void hull_states(const Frame f, __global const uint* faces, __global ulong* hull) {
  const int word = get_global_id(0), face = get_global_id(1);
  __global const uint* image = faces + face_offset(&f.grid, face);
  if (face >= FACE_K_LOW) {
    if (word >= f.grid.size_i * f.grid.size_j) return;
    hull[hull_word_offset(&f.grid, face) + word] =
        hull_cell(image, f.grid.size_i, f.grid.size_j, word % f.grid.size_i, word / f.grid.size_i) ? 1 : 0;
    return;
  }
  const int rows = face <= FACE_I_HIGH ? f.grid.size_j : f.grid.size_i;
  if (word >= rows * f.grid.words_k) return;
  const int row = word / f.grid.words_k, first = word % f.grid.words_k * 64;
  ulong bits = 0;
  for (int k = first; k < min(first + 64, f.grid.size_k); ++k) bits |= (ulong)hull_cell(image, f.grid.size_k, rows, k, row) << (k - first);
  hull[hull_word_offset(&f.grid, face) + word] = bits;
}
