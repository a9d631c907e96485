// Lists in a fixed order from bit fields and counts, whatever the number of threads: counts, their prefix sum, then the entries.

// One work item a chunk of WORD_CHUNK words: their set bits.
__kernel void count_bits(__global const ulong* words, const uint count, __global uint* counts) {
  const uint chunk = get_global_id(0), begin = WORD_CHUNK * chunk;
  if (begin >= count) return;
  uint sum = 0;
  for (uint n = begin; n < min(begin + WORD_CHUNK, count); ++n) sum += (uint)popcount(words[n]);
  counts[chunk] = sum;
}

// One work item: counts and lists at once, where a launch takes longer than the work.
//   out list[room]: no more than there is room for;  total: of all set bits
__kernel void list_few_bits(__global const ulong* words, const uint count, __global uint* list, const uint room, __global uint* total) {
  if (get_global_id(0) > 0) return;
  uint at = 0;
  for (uint n = 0; n < count; ++n) {
    for (ulong left = words[n]; left != 0; left &= left - 1, ++at)
      if (at < room) list[at] = 64 * n + lowest_bit(left);
  }
  *total = at;
}

// One work item a chunk of SCAN_CHUNK values: their sum.
__kernel void sum_chunks(__global const uint* values, const uint count, __global uint* chunk_sums) {
  const uint chunk = get_global_id(0);
  const uint begin = chunk * SCAN_CHUNK, end = min(begin + SCAN_CHUNK, count);
  if (begin >= count) return;
  uint sum = 0;
  for (uint n = begin; n < end; ++n) sum += values[n];
  chunk_sums[chunk] = sum;
}

// One work item a chunk: values become the sums of all values before them.
//   in  chunk_offsets: sum of all chunks before;   i/o values[count + 1]: the last becomes the total
__kernel void scan_chunks(__global uint* values, const uint count, __global const uint* chunk_offsets) {
  const uint chunk = get_global_id(0);
  const uint begin = chunk * SCAN_CHUNK, end = min(begin + SCAN_CHUNK, count);
  if (begin >= count) return;
  uint sum = chunk_offsets[chunk];
  for (uint n = begin; n < end; ++n) {
    const uint value = values[n];
    values[n] = sum;
    sum += value;
  }
  if (end == count) values[count] = sum;
}

// One work item: the prefix sum of few values, the total behind them.
__kernel void scan_few(__global uint* values, const uint count) {
  if (get_global_id(0) > 0) return;
  uint sum = 0;
  for (uint n = 0; n < count; ++n) {
    const uint value = values[n];
    values[n] = sum;
    sum += value;
  }
  values[count] = sum;
}

// One work item a chunk of WORD_CHUNK words: the numbers 64 n + bit of their set bits.
//   in  offsets: prefix sum of count_bits'
__kernel void list_bits(__global const ulong* words, const uint count, __global const uint* offsets, __global uint* list) {
  const uint chunk = get_global_id(0), begin = WORD_CHUNK * chunk;
  if (begin >= count) return;
  uint at = offsets[chunk];
  for (uint n = begin; n < min(begin + WORD_CHUNK, count); ++n)
    for (ulong left = words[n]; left != 0; left &= left - 1) list[at++] = 64 * n + lowest_bit(left);
}
