// Work on whole bricks of the seen points (common/seen_points.cl): new ones, those on their way to and from the host, and forgetting.

// One work item handles a place in the tables.
//   in  entries[count]: place in the tables, number of the brick
__kernel void set_seen_entries(__global const int2* entries, const int count, __global int* tables) {
  const int n = get_global_id(0);
  if (n < count) tables[entries[n].x] = entries[n].y;
}

// One work item handles a word of a brick: its points are not seen.
//   in  numbers[count]: of bricks
__kernel void empty_bricks(__global const int* numbers, const int count, __global ulong* bricks) {
  const int n = get_global_id(0) / SEEN_WORDS, word = get_global_id(0) % SEEN_WORDS;
  if (n < count) bricks[SEEN_WORDS * numbers[n] + word] = 0;
}

// One work item copies a word of a brick.
//   in  numbers[count]: of bricks;   out gathered[count][SEEN_WORDS]
__kernel void gather_bricks(__global const int* numbers, const int count, __global const ulong* bricks, __global ulong* gathered) {
  const int n = get_global_id(0) / SEEN_WORDS, word = get_global_id(0) % SEEN_WORDS;
  if (n < count) gathered[get_global_id(0)] = bricks[SEEN_WORDS * numbers[n] + word];
}

// The other way round.
__kernel void scatter_bricks(__global const int* numbers, const int count, __global const ulong* gathered, __global ulong* bricks) {
  const int n = get_global_id(0) / SEEN_WORDS, word = get_global_id(0) % SEEN_WORDS;
  if (n < count) bricks[SEEN_WORDS * numbers[n] + word] = gathered[get_global_id(0)];
}

// One work item handles a word of a brick of which the points in a box are forgotten.
//   in  ranges[count]: first point along x, y, z, the number of the brick, one past the last point, and whether all its points were seen
//   before
__kernel void forget_points(__global const int8* ranges, const int count, __global ulong* bricks) {
  const int n = get_global_id(0) / SEEN_WORDS, word = get_global_id(0) % SEEN_WORDS;
  if (n >= count) return;
  const int8 range = ranges[n];
  const int3 corner = 4 * (int3)(word & 3, word >> 2 & 3, word >> 4);
  ulong forgotten = 0;
  for (int bit = 0; bit < 64; ++bit) {
    const int3 p = corner + (int3)(bit & 3, bit >> 2 & 3, bit >> 4);
    if (p.x >= range.s0 && p.y >= range.s1 && p.z >= range.s2 && p.x < range.s4 && p.y < range.s5 && p.z < range.s6)
      forgotten |= 1ul << bit;
  }
  __global ulong* own = bricks + SEEN_WORDS * range.s3 + word;
  *own = (range.s7 != 0 ? ~0ul : *own) & ~forgotten;
}

// One work item handles a brick: is no point of it seen any more?
__kernel void find_empty_bricks(__global const int8* ranges, const int count, __global const ulong* bricks, __global uchar* empty) {
  const int n = get_global_id(0);
  if (n >= count) return;
  ulong any = 0;
  for (int word = 0; word < SEEN_WORDS; ++word) any |= bricks[SEEN_WORDS * ranges[n].s3 + word];
  empty[n] = any == 0 ? 1 : 0;
}
