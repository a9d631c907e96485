// Bricks of the seen points (common/seen_points.cl) on their way to and from the host.

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
