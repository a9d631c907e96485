// Sweeps - paper 3.2, Algorithm 1: the state e of each path, walked forward and backward, along each family, gives K'.
//
// At each voxel, in this order: if it is invalid or an exit, e = 0; K' |= e; if it is an entry and not invalid, e = 1. Along i and j one
// word carries 64 paths.
//   in  events[3][EVENT_PLANES]: bit fields of 11_sign_field;  hull: of 12_known_hull: states in which paths enter the grid
//       lines: of 10_needed_paths: other paths are not walked
//   i/o known: bit field K'

INLINE bool is_needed(__global const uint* lines, int word) { return (lines[word] | lines[word + 1]) != 0; }

INLINE ulong step_paths(ulong* e, ulong enter, ulong exit, ulong invalid) {
  *e &= ~(exit | invalid);
  const ulong known = *e;
  *e |= enter & ~invalid;
  return known;
}

// The paths of one word of a face through the grid and back: words first, first + stride, ... are `count` voxels of them.
//   out known: set where a path is known
void sweep_words(__global const ulong* events, size_t plane, int first, int stride, int count, ulong from_low, ulong from_high,
                 __global ulong* known, bool overwrite) {
  __global const ulong* invalid = events + EVENT_INVALID * plane;
  ulong e = from_low;
  for (int n = 0, at = first; n < count; ++n, at += stride) {
    const ulong bits = step_paths(&e, events[EVENT_ENTER_FORWARD * plane + at], events[EVENT_EXIT_FORWARD * plane + at], invalid[at]);
    known[at] = overwrite ? bits : known[at] | bits;
  }
  e = from_high;
  for (int n = 0, at = first + (count - 1) * stride; n < count; ++n, at -= stride)
    known[at] |= step_paths(&e, events[EVENT_ENTER_BACKWARD * plane + at], events[EVENT_EXIT_BACKWARD * plane + at], invalid[at]);
}

// One work item handles a word (j, w) of the i faces. This kernel runs first: it sets known, and the others add to it.
__kernel void sweep_i(const Frame f, __global const uint* lines, __global const ulong* events, __global const ulong* hull,
                      __global ulong* known) {
  const int path = get_global_id(0);
  if (path >= f.grid.size_j * f.grid.words_k || !is_needed(lines, 2 * path)) return;
  const size_t plane = (size_t)f.grid.size_i * f.grid.size_j * f.grid.words_k;
  sweep_words(events, plane, path * f.grid.size_i, 1, f.grid.size_i, hull[hull_word_offset(&f.grid, FACE_I_LOW) + path],
              hull[hull_word_offset(&f.grid, FACE_I_HIGH) + path], known, true);
}

// One work item handles a word (i, w) of the j faces.
__kernel void sweep_j(const Frame f, __global const uint* lines, __global const ulong* events, __global const ulong* hull,
                      __global ulong* known) {
  const int path = get_global_id(0);
  if (path >= f.grid.size_i * f.grid.words_k) return;
  const int i = path % f.grid.size_i, w = path / f.grid.size_i;
  if (!is_needed(lines, lines_j(&f.grid, i, w))) return;
  const size_t plane = (size_t)f.grid.size_i * f.grid.size_j * f.grid.words_k;
  sweep_words(events + EVENT_PLANES * plane, plane, word_index(&f.grid, i, 0, w), f.grid.size_i * f.grid.words_k, f.grid.size_j,
              hull[hull_word_offset(&f.grid, FACE_J_LOW) + i * f.grid.words_k + w],
              hull[hull_word_offset(&f.grid, FACE_J_HIGH) + i * f.grid.words_k + w], known, false);
}

// One path, up a word's bits: between events its state is a run.
INLINE ulong walk_up(bool* e, ulong enter, ulong exit, ulong invalid) {
  ulong known = 0;
  int from = 0;
  for (ulong left = enter | exit | invalid; left != 0; left &= left - 1) {
    const int k = lowest_bit(left);
    const ulong bit = 1ul << k;
    if (*e) known |= bit_run(from, k);
    if ((exit | invalid) & bit) *e = false;
    if (*e) known |= bit;
    if (enter & ~invalid & bit) *e = true;
    from = k + 1;
  }
  if (*e) known |= bit_run(from, 64);
  return known;
}

// The same, down.
INLINE ulong walk_down(bool* e, ulong enter, ulong exit, ulong invalid) {
  ulong known = 0, left = enter | exit | invalid;
  int to = 64;
  while (left != 0) {
    const int k = highest_bit(left);
    const ulong bit = 1ul << k;
    if (*e) known |= bit_run(k + 1, to);
    if ((exit | invalid) & bit) *e = false;
    if (*e) known |= bit;
    if (enter & ~invalid & bit) *e = true;
    to = k;
    left ^= bit;
  }
  if (*e) known |= bit_run(0, to);
  return known;
}

// One work item handles a path (i, j).
__kernel void sweep_k(const Frame f, __global const uint* lines, __global const ulong* events, __global const ulong* hull,
                      __global ulong* known) {
  const int path = get_global_id(0);
  if (path >= f.grid.size_i * f.grid.size_j) return;
  const int i = path % f.grid.size_i, j = path / f.grid.size_i;
  if (lines[lines_k(&f.grid, i, j)] == 0) return;
  const size_t plane = (size_t)f.grid.size_i * f.grid.size_j * f.grid.words_k;
  __global const ulong* planes = events + 2 * EVENT_PLANES * plane;

  bool e = hull[hull_word_offset(&f.grid, FACE_K_LOW) + path] != 0;
  for (int w = 0; w < f.grid.words_k; ++w) {
    const int at = word_index(&f.grid, i, j, w);
    known[at] |= valid_layers(&f.grid, w) & walk_up(&e, planes[EVENT_ENTER_FORWARD * plane + at], planes[EVENT_EXIT_FORWARD * plane + at],
                                                    planes[EVENT_INVALID * plane + at]);
  }
  e = hull[hull_word_offset(&f.grid, FACE_K_HIGH) + path] != 0;
  for (int w = f.grid.words_k - 1; w >= 0; --w) {
    const int at = word_index(&f.grid, i, j, w);
    known[at] |= valid_layers(&f.grid, w) & walk_down(&e, planes[EVENT_ENTER_BACKWARD * plane + at],
                                                      planes[EVENT_EXIT_BACKWARD * plane + at], planes[EVENT_INVALID * plane + at]);
  }
}
