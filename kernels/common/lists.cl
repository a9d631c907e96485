// Lists from bit fields and counts, in an order that does not depend on the number of threads: counts, their prefix sum, then the entries.
// A total that does not fit is UINT_MAX, so that the host can refuse it. add_sat would make every sum wait longer for the one before it.
//
// A list may be longer than its room, because the host does not wait for its length. Kernels that go through it are launched for its whole
// room and find its length in length[0]: number of its entries, which length[1] exceeds if there was no room for all.
INLINE void note_length(uint total, uint room, __global uint* length) {
  length[0] = min(total, room);
  length[1] = total;
}

// One work item handles `size` words, a chunk: it counts their set bits.
//   in  words[count];   out counts[chunks]
__kernel void count_bits(__global const ulong* words, const uint count, const uint size, __global uint* counts) {
  const uint chunk = get_global_id(0), begin = size * chunk;
  if (begin >= count) return;
  uint sum = 0;
  for (uint n = begin; n < min(begin + size, count); ++n) sum += (uint)popcount(words[n]);
  counts[chunk] = sum;
}

// One work item does all: it counts and lists the set bits, where a launch takes longer than that.
//   in  words[count];   out list[room]: the numbers 64 n + bit of set bits;  length[2]
__kernel void list_few_bits(__global const ulong* words, const uint count, __global uint* list, const uint room, __global uint* length) {
  if (get_global_id(0) > 0) return;
  uint at = 0;
  for (uint n = 0; n < count; ++n) {
    for (ulong left = words[n]; left != 0; left &= left - 1, ++at)
      if (at < room) list[at] = 64 * n + lowest_bit(left);
  }
  note_length(at, room, length);
}

// One work item handles a chunk of SCAN_CHUNK values: it adds them up.
//   in  values[count];   out chunk_sums[chunks]
__kernel void sum_chunks(__global const uint* values, const uint count, __global uint* chunk_sums) {
  const uint chunk = get_global_id(0);
  const uint begin = chunk * SCAN_CHUNK, end = min(begin + SCAN_CHUNK, count);
  if (begin >= count) return;
  uint sum = 0, too_large = 0;
  for (uint n = begin; n < end; ++n) {
    const uint value = values[n];
    sum += value;
    too_large |= sum < value;
  }
  chunk_sums[chunk] = too_large ? UINT_MAX : sum;
}

// One work item handles a chunk of SCAN_CHUNK values: they become the sums of all values before them.
//   in  chunk_offsets[chunks + 1]: sums of all chunks before, and the total;   i/o values[count + 1]: the last becomes the total
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
  if (end == count) values[count] = chunk_offsets[chunk + 1];
}

// One work item does all: the prefix sum of few values.
//   i/o values[count + 1]: the last becomes the total
__kernel void scan_few(__global uint* values, const uint count) {
  if (get_global_id(0) > 0) return;
  uint sum = 0, too_large = 0;
  for (uint n = 0; n < count; ++n) {
    const uint value = values[n];
    values[n] = sum;
    sum += value;
    too_large |= sum < value;
  }
  values[count] = too_large ? UINT_MAX : sum;
}

// One work-group does all, for some thousand values: they come in rounds, and each work item has SCAN_STRIP neighbours of a round. Where
// there are many work items this takes as long as scan_few for some dozen values.
//   i/o values[count + 1]: the last becomes the total
__kernel void scan_by_group(__global uint* values, const uint count) {
  __local ulong sums[MOST_SCAN_ITEMS];
  const uint item = get_local_id(0), items = get_local_size(0);
  ulong before = 0;  // sum of the rounds before; of 64 bits, so that a total that does not fit is noticed
  for (uint round = 0; round < count; round += SCAN_STRIP * items) {
    const uint first = round + SCAN_STRIP * item;
    uint own[SCAN_STRIP];
    ulong sum = 0;
    for (uint n = 0; n < SCAN_STRIP; ++n) {
      own[n] = first + n < count ? values[first + n] : 0;
      sum += own[n];
    }
    sums[item] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint step = 1; step < items; step *= 2) {
      const ulong of_others = item >= step ? sums[item - step] : 0;
      barrier(CLK_LOCAL_MEM_FENCE);
      sums[item] += of_others;
      barrier(CLK_LOCAL_MEM_FENCE);
    }
    ulong at = before + sums[item] - sum;
    for (uint n = 0; n < SCAN_STRIP && first + n < count; ++n) {
      values[first + n] = (uint)at;
      at += own[n];
    }
    before += sums[items - 1];
    barrier(CLK_LOCAL_MEM_FENCE);  // the sums are read before the next round
  }
  if (item == 0) values[count] = (uint)min(before, (ulong)UINT_MAX);
}

// One work item handles `size` words, a chunk: it lists their set bits.
//   in  words[count];  offsets[chunks + 1]: prefix sum of count_bits', and the total
//   out list[room]: the numbers 64 n + bit of set bits;  length[2]
__kernel void list_bits(__global const ulong* words, const uint count, const uint size, __global const uint* offsets, __global uint* list,
                        const uint room, __global uint* length) {
  const uint chunk = get_global_id(0), begin = size * chunk;
  if (begin >= count) return;
  uint at = offsets[chunk];
  for (uint n = begin; n < min(begin + size, count) && at < room; ++n)
    for (ulong left = words[n]; left != 0 && at < room; left &= left - 1) list[at++] = 64 * n + lowest_bit(left);
  if (begin + size >= count) note_length(offsets[chunk + 1], room, length);
}
