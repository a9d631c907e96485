// Known state hull - supplement C: for each path that enters the grid through a face, the state of the last surfel that it met outside.
//
// Six images of keys, one after the other: faces i low, i high [size_j][size_k], j low, j high [size_i][size_k], k low, k high [size_j][size_i].
// A key is the surfel's distance from the face (bits of a positive float, which sort like the number) with the state in its lowest bit:
// the smallest key is the nearest surfel, and an unknown one wins a tie. HULL_EMPTY: no surfel.

#define HULL_EMPTY 0xffffffffu

uint face_offset(const Grid* g, int face) {
  const uint face_i = g->size_j * g->size_k, face_j = g->size_i * g->size_k, face_k = g->size_i * g->size_j;
  switch (face) {
    case FACE_I_LOW: return 0;
    case FACE_I_HIGH: return face_i;
    case FACE_J_LOW: return 2 * face_i;
    case FACE_J_HIGH: return 2 * face_i + face_j;
    case FACE_K_LOW: return 2 * (face_i + face_j);
    default: return 2 * (face_i + face_j) + face_k;
  }
}

// Enters a surfel into every cell of an ellipse in a face.
//   center, axes: of the ellipse, in the face's coordinates (column, row);  width, height: cells of the face
void stamp_face(__global uint* face, int width, int height, float2 center, float2 axes, float distance, bool known) {
  const float2 half_axes = fmax(axes, 0.5f);
  const int2 low = max(convert_int2_rtp(center - half_axes), 0);
  const int2 high = min(convert_int2_rtn(center + half_axes), (int2)(width - 1, height - 1));
  const uint key = (as_uint(distance) & ~1u) | (known ? 1u : 0u);
  for (int row = low.y; row <= high.y; ++row) {
    for (int column = low.x; column <= high.x; ++column) {
      const float2 d = ((float2)((float)column, (float)row) - center) / half_axes;
      if (dot(d, d) > 1.0f) continue;
      __global uint* cell = &face[row * width + column];
      if (key < *cell) atomic_min(cell, key);  // the look before saves most of the atomics
    }
  }
}

// Enters a surfel into the face that it is beyond along one family of paths.
//   position, size: along that family;  entering: cosine between normal and paths;  low_face: number of the family's low face
void project_along(const Grid* g, const Limits* limits, __global uint* faces, int low_face, float position, int size, float entering,
                   float2 center, float2 axes, int width, int height) {
  const bool below = position < -0.5f;
  if (!below && position < (float)size - 0.5f) return;
  const bool known = below ? entering > limits->th_d : entering < -limits->th_d;
  const float distance = below ? -0.5f - position : position - ((float)size - 0.5f);
  const float2 reach = known ? axes : axes * limits->hull_unknown_scale;
  stamp_face(faces + face_offset(g, below ? low_face : low_face + 1), width, height, center, reach, distance, known);
}

// One work item a slot: surfels beyond a face, and within its range in the other two coordinates (with their own reach as a margin), enter it.
//   i/o faces: six images of keys, HULL_EMPTY before
__kernel void project_hull(const Grid g, const Limits limits, const Transform T_camera_world, __global const float4* position_radius,
                           __global const float4* normal_attributes, const uint slots, __global uint* faces) {
  const uint slot = get_global_id(0);
  if (slot >= slots || !is_alive(normal_attributes[slot])) return;
  const ViewSurfel s = place_in_view(&g, &T_camera_world, position_radius[slot], normal_attributes[slot], slot);
  const float axis_i = s.reach * sqrt(fmax(1.0f - s.n_x * s.n_x, 0.0f));
  const float axis_j = s.reach * sqrt(fmax(1.0f - s.n_y * s.n_y, 0.0f));
  const float axis_k = s.reach * sqrt(fmax(1.0f - s.n_k * s.n_k, 0.0f));
  project_along(&g, &limits, faces, FACE_I_LOW, s.i, g.size_i, s.n_x, (float2)(s.k, s.j), (float2)(axis_k, axis_j), g.size_k, g.size_j);
  project_along(&g, &limits, faces, FACE_J_LOW, s.j, g.size_j, s.n_y, (float2)(s.k, s.i), (float2)(axis_k, axis_i), g.size_k, g.size_i);
  project_along(&g, &limits, faces, FACE_K_LOW, s.k, g.size_k, s.n_k, (float2)(s.i, s.j), (float2)(axis_i, axis_j), g.size_i, g.size_j);
}

// Is the state of a cell known? Not if no surfel was met there or beside it.
bool hull_cell(__global const uint* face, int width, int height, int column, int row) {
  const uint key = face[row * width + column];
  if ((key & 1u) == 0 || key == HULL_EMPTY) return false;
  return !((column > 0 && face[row * width + column - 1] == HULL_EMPTY) ||
           (column < width - 1 && face[row * width + column + 1] == HULL_EMPTY) ||
           (row > 0 && face[(row - 1) * width + column] == HULL_EMPTY) ||
           (row < height - 1 && face[(row + 1) * width + column] == HULL_EMPTY));
}

// Number of the first word of a face in the hull's bits: i faces [size_j][words_k], j faces [size_i][words_k], bits along k;
// k faces [size_j][size_i], a word each.
uint hull_word_offset(const Grid* g, int face) {
  const uint face_i = g->size_j * g->words_k, face_j = g->size_i * g->words_k, face_k = g->size_i * g->size_j;
  switch (face) {
    case FACE_I_LOW: return 0;
    case FACE_I_HIGH: return face_i;
    case FACE_J_LOW: return 2 * face_i;
    case FACE_J_HIGH: return 2 * face_i + face_j;
    case FACE_K_LOW: return 2 * (face_i + face_j);
    default: return 2 * (face_i + face_j) + face_k;
  }
}

// One work item a word of the hull; dimension 1 is the face.
//   out hull: bits as hull_word_offset says, 1 = known
__kernel void hull_states(const Grid g, __global const uint* faces, __global ulong* hull) {
  const int word = get_global_id(0), face = get_global_id(1);
  __global const uint* image = faces + face_offset(&g, face);
  if (face >= FACE_K_LOW) {
    if (word >= g.size_i * g.size_j) return;
    hull[hull_word_offset(&g, face) + word] = hull_cell(image, g.size_i, g.size_j, word % g.size_i, word / g.size_i) ? 1 : 0;
    return;
  }
  const int rows = face <= FACE_I_HIGH ? g.size_j : g.size_i;
  if (word >= rows * g.words_k) return;
  const int row = word / g.words_k, first = word % g.words_k * 64;
  ulong bits = 0;
  for (int k = first; k < min(first + 64, g.size_k); ++k)
    bits |= (ulong)hull_cell(image, g.size_k, rows, k, row) << (k - first);
  hull[hull_word_offset(&g, face) + word] = bits;
}
