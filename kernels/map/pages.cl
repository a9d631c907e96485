// The pages of the map: where new surfels go, what a frame has changed, and pages for the host. The map is described in common/surfels.cl.
//
// New surfels take the free slots of their block's pages, page after page, lowest slot first, in the order of their list: this does not
// depend on the number of threads. For that they are sorted by cell (block of the window), and keep the list's order in each cell.
//
// A slot is free if it is neither in `alive` nor in `reserved`. Where no ids are reserved, both are the same buffer, and has_reserved is 0.
//
// The new surfels' number is in length[0], as in common/lists.cl. They may be sorted while some surfels have not left the map yet.

// One work item handles an entry of a list of bits in pages: it becomes a slot of the map.
//   in  pages;   i/o list[count]: before: 64 n + bit for page pages[n]; after: slots
__kernel void to_slots(__global const uint* pages, __global uint* list, const uint count) {
  const uint n = get_global_id(0);
  if (n < count) list[n] = PAGE_SLOTS * pages[list[n] / PAGE_SLOTS] + list[n] % PAGE_SLOTS;
}

INLINE uint chunk_begin(uint count, uint chunk, uint chunks) { return (uint)((ulong)count * chunk / chunks); }

// One work item handles a chunk of the new surfels; at width 1 a work-group has a chunk.
//   in  new_cells[length[0]];   i/o histogram[cells][chunks]: before: 0; after: how many of each chunk go to each cell
__kernel void count_cells(__global const uint* new_cells, __global const uint* length, const uint chunks, __global uint* histogram) {
  const uint count = length[0];
#if LANES == 1
  const uint chunk = get_group_id(0), end = chunk_begin(count, chunk + 1, chunks);
  for (uint n = chunk_begin(count, chunk, chunks) + get_local_id(0); n < end; n += SORT_GROUP)
    atomic_inc(&histogram[chunks * new_cells[n] + chunk]);
#else
  const uint chunk = get_global_id(0);
  if (chunk >= chunks) return;
  for (uint n = chunk_begin(count, chunk, chunks); n < chunk_begin(count, chunk + 1, chunks); ++n)
    ++histogram[chunks * new_cells[n] + chunk];
#endif
}

#if LANES == 1
// Where a new surfel stands among SORT_GROUP neighbours of the list, a round: a work-group handles them together.
typedef struct {
  uint cell;     // where it goes
  uint before;   // how many of the round that come before it go there, too
  bool exists;   // false behind the end of the chunk
  bool is_last;  // none of those after it goes there
} PlaceInRound;

// All work items of the group call it for the round that begins at surfel `first` of the list. What they have read and written before is
// done then.
INLINE PlaceInRound place_in_round(__global const uint* new_cells, uint first, uint end, __local uint* cells) {
  const uint item = get_local_id(0), size = min((uint)SORT_GROUP, end - first);
  PlaceInRound place = {item < size ? new_cells[first + item] : 0, 0, item < size, item < size};
  cells[item] = place.cell;
  barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
  for (uint n = 0; n < size; ++n) {
    const bool same = cells[n] == place.cell;
    place.before += same && n < item ? 1 : 0;
    place.is_last = place.is_last && !(same && n > item);
  }
  return place;
}
#endif

// One work item handles a chunk of the new surfels; at width 1 a work-group has a chunk, and its work items the surfels of a round.
//   in  new_cells[length[0]];   i/o histogram: before: its prefix sum; after: where each chunk's share of each cell ends
//   out order[length[0]]: new surfels sorted by cell
__kernel void sort_by_cell(__global const uint* new_cells, __global const uint* length, const uint chunks, __global uint* histogram,
                           __global uint* order) {
  const uint count = length[0];
#if LANES == 1
  __local uint cells[SORT_GROUP];
  const uint chunk = get_group_id(0), end = chunk_begin(count, chunk + 1, chunks);
  for (uint first = chunk_begin(count, chunk, chunks); first < end; first += SORT_GROUP) {
    const PlaceInRound place = place_in_round(new_cells, first, end, cells);
    const uint bin = chunks * place.cell + chunk, at = histogram[bin] + place.before;
    if (place.exists) order[at] = first + get_local_id(0);
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);  // all have read the histogram and the cells
    if (place.is_last) histogram[bin] = at + 1;
  }
#else
  const uint chunk = get_global_id(0);
  if (chunk >= chunks) return;
  for (uint n = chunk_begin(count, chunk, chunks); n < chunk_begin(count, chunk + 1, chunks); ++n)
    order[histogram[chunks * new_cells[n] + chunk]++] = n;
#endif
}

// Number of free slots of a page once the surfels in `leaving` have left it.
INLINE uint free_slots_of(uint page, ulong leaving, __global const ulong* alive, int has_reserved, __global const ulong* reserved) {
  return PAGE_SLOTS - (uint)popcount((alive[page] & ~leaving) | (has_reserved ? reserved[page] : 0));
}

// One work item handles a page: it counts its free slots.
//   in  pages[count]: of the window, by cell;  leaving[count]: a bit for each surfel that is going to be removed;  alive, reserved
//   out free_slots[count]
__kernel void count_free(__global const uint* pages, const uint count, __global const ulong* leaving, __global const ulong* alive,
                         const int has_reserved, __global const ulong* reserved, __global uint* free_slots) {
  const uint n = get_global_id(0);
  if (n < count) free_slots[n] = free_slots_of(pages[n], leaving[n], alive, has_reserved, reserved);
}

// Pages that a block needs for new surfels in addition to its free slots.
INLINE uint missing_pages(uint wanted, uint there) { return wanted > there ? (wanted - there + PAGE_SLOTS - 1) / PAGE_SLOTS : 0; }

// One work item handles a cell, and one more the end.
//   in  histogram: its prefix sum, with the total behind it;  cell_pages[cells + 1]: where each cell's pages begin in their list
//       free_before: prefix sum of count_free's, with the total behind it
//   out cell_begin[cells + 1]: where each cell's new surfels begin when sorted;  missing[cells + 1]: pages that its block needs in
//       addition; their prefix sum is next
__kernel void begin_cells(__global const uint* histogram, __global const uint* cell_pages, __global const uint* free_before,
                          const uint cells, const uint chunks, __global uint* cell_begin, __global uint* missing) {
  const uint cell = get_global_id(0);
  if (cell > cells) return;
  cell_begin[cell] = histogram[chunks * cell];
  if (cell == cells) return;
  const uint wanted = histogram[chunks * (cell + 1)] - histogram[chunks * cell],
             there = free_before[cell_pages[cell + 1]] - free_before[cell_pages[cell]];
  missing[cell] = missing_pages(wanted, there);
}

// One work item does all of the above for few new surfels, where launches take longer than that.
//   out missing_before[cells + 1]: prefix sum of begin_cells' `missing`, with the total behind it
__kernel void sort_few(__global const uint* new_cells, __global const uint* length, __global const uint* pages, const uint page_count,
                       __global const ulong* leaving, __global const ulong* alive, const int has_reserved, __global const ulong* reserved,
                       __global const uint* cell_pages, const uint cells, __global uint* free_before, __global uint* cell_begin,
                       __global uint* missing_before, __global uint* order) {
  if (get_global_id(0) > 0) return;
  const uint count = length[0];
  for (uint cell = 0; cell <= cells; ++cell) cell_begin[cell] = 0;
  for (uint n = 0; n < count; ++n) ++cell_begin[new_cells[n] + 1];
  __global uint* next = missing_before;  // in each cell
  for (uint cell = 0; cell < cells; ++cell) {
    next[cell] = cell_begin[cell];
    cell_begin[cell + 1] += cell_begin[cell];
  }
  for (uint n = 0; n < count; ++n) order[next[new_cells[n]]++] = n;
  uint free_slots = 0;
  for (uint n = 0; n < page_count; ++n) {
    free_before[n] = free_slots;
    free_slots += free_slots_of(pages[n], leaving[n], alive, has_reserved, reserved);
  }
  free_before[page_count] = free_slots;
  uint missing = 0;
  for (uint cell = 0; cell < cells; ++cell) {
    missing_before[cell] = missing;
    missing += missing_pages(cell_begin[cell + 1] - cell_begin[cell], free_before[cell_pages[cell + 1]] - free_before[cell_pages[cell]]);
  }
  missing_before[cells] = missing;
}

// May the frame's changes be carried out before the host knows them? Not if the frame has to look for them again, because it takes space
// back, splits surfels or has had no room for all entries of a list; nor if it needs more pages, or room to keep what it overwrites, than
// there are. One work item decides. The kernels that come after it ask counts[COUNT_GOES_ON]: 16_removal, 18_labels and those below. Where
// the host has waited they get counts that say 1.
//   in  evidence[1]: number of pixels that want to take space back, if it `asks` for it;  listed[2], chosen[2]: lengths of lists
//       missing_before[cells + 1];  spare: pages that the map can get;  room: surfels that can be kept
//   i/o counts[COUNTS]
__kernel void decide_to_go_on(__global const uint* evidence, const int asks, __global const uint* listed, __global const uint* chosen,
                              __global const uint* missing_before, const uint cells, const uint spare, const uint room,
                              __global uint* counts) {
  if (get_global_id(0) > 0) return;
  const bool takes_back = (asks != 0) & (evidence[0] > 0), is_whole = (listed[0] == listed[1]) & (chosen[0] == chosen[1]);
  const bool has_room = (missing_before[cells] <= spare) & (counts[COUNT_REMOVED] + counts[COUNT_LABELLED] <= room);
  const bool goes_on = (!takes_back) & (counts[COUNT_LARGE] == 0) & is_whole & has_room;
  counts[COUNT_GOES_ON] = goes_on ? 1 : 0;
}

// The cell whose block gets an added page: the last one with missing_before[cell] <= n.
INLINE uint cell_of_added(uint n, uint cells, __global const uint* missing_before) {
  uint first = 0, end = cells;
  while (end - first > 1) {
    const uint middle = (first + end) / 2;
    if (missing_before[middle] <= n)
      first = middle;
    else
      end = middle;
  }
  return first;
}

// Notes which slots of a page have been filled.
INLINE void note_filled(const Window* window, uint page, uint cell, ulong filled, __global int4* page_block, __global ulong* alive,
                        __global ulong* changed) {
  if (filled == 0) return;
  const int3 place = (int3)(cell % window->size_x, cell / window->size_x % window->size_y, cell / window->size_x / window->size_y);
  page_block[page].xyz = (int3)(window->origin_x, window->origin_y, window->origin_z) + place;
  alive[page] |= filled;
  changed[page] |= filled;
}

// The free slots of the window's pages take their share of the cell's new surfels. One work item handles a page; at width 1 a work-group
// has a page, and a work item a slot.
//   in  counts: of decide_to_go_on
//       pages[count]: first the `known` pages that begin_cells knows, by cell, then pages for the surfels that those do not take, as many
//       or more than are missing;  page_cells[known];  missing_before: prefix sum of begin_cells' `missing`
//       reserved: may be the same buffer as `alive`
//   i/o page_block, alive, changed, surfels: the map
__kernel void fill_pages(__global const uint* counts, const Window window, __global const uint* pages, __global const uint* page_cells,
                         const uint count, const uint known, __global const uint* missing_before, __global const uint* cell_begin,
                         __global const uint* cell_pages, __global const uint* free_before, __global const uint* order,
                         __global const uint4* new_surfels, __global int4* page_block, __global ulong* alive, __global ulong* changed,
                         __global const ulong* reserved, __global uint4* surfels) {
  const uint n = LANES == 1 ? get_group_id(0) : get_global_id(0), cells = (uint)(window.size_x * window.size_y * window.size_z);
  if (counts[COUNT_GOES_ON] == 0 || n >= count || (n >= known && n - known >= missing_before[cells])) return;
  const uint page = pages[n], cell = n < known ? page_cells[n] : cell_of_added(n - known, cells, missing_before);
  // Free slots of the cell in the pages before this one, counted from the first page of all
  const uint free_so_far = n < known ? free_before[n] : free_before[cell_pages[cell + 1]] + PAGE_SLOTS * (n - known - missing_before[cell]);
  const uint first = cell_begin[cell] + free_so_far - free_before[cell_pages[cell]], end = cell_begin[cell + 1];
  const ulong before = n < known ? alive[page] | reserved[page] : 0;  // added pages are free, whatever they have been before
#if LANES == 1
  __local SharedWord filled;
  const uint slot = get_local_id(0), at = first + (uint)popcount(~before & ((1ul << slot) - 1));
  const bool fills = (before >> slot & 1) == 0 && at < end;
  if (fills) surfels[PAGE_SLOTS * page + slot] = new_surfels[order[at]];
  share_lane_bits(fills ? 1 : 0, (int)slot, &filled);
  barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
  if (slot == 0) note_filled(&window, page, cell, read_shared_word(&filled), page_block, alive, changed);
#else
  ulong filled = 0;
  uint at = first;
  for (ulong left = ~before; left != 0 && at < end; left &= left - 1, ++at) {
    const uint bit = (uint)lowest_bit(left);
    surfels[PAGE_SLOTS * page + bit] = new_surfels[order[at]];
    filled |= 1ul << bit;
  }
  note_filled(&window, page, cell, filled, page_block, alive, changed);
#endif
}

// What the frame may overwrite next is kept. Called again before more is overwritten. One work item handles a page of the window; at width
// 1 a work-group has a page, and a work item a slot.
//   in  counts: of decide_to_go_on
//       pages[count];  first: nothing is kept yet;  freed[count]: a bit for each surfel that is going to be removed
//       page_block, alive, changed, surfels: the map; surfels marked as changed may be overwritten, too
//       room: number of surfels that can be kept
//   out kept_pages[count], kept_frames[count], kept_alive[count]: as at the first call
//   i/o kept_slots[count]: a bit for each surfel that is kept;  kept_count: number of these
//       kept_surfel_slots[kept_count], kept_surfels[kept_count]: where each of them was, in any order
__kernel void back_up_pages(__global const uint* counts, __global const uint* pages, const uint count, const int first,
                            __global const ulong* freed, __global const int4* page_block, __global const ulong* alive,
                            __global const ulong* changed, __global const uint4* surfels, const uint room, __global uint* kept_pages,
                            __global int* kept_frames, __global ulong* kept_alive, __global ulong* kept_slots, __global uint* kept_count,
                            __global uint* kept_surfel_slots, __global uint4* kept_surfels) {
  const uint n = LANES == 1 ? get_group_id(0) : get_global_id(0);
  if (counts[COUNT_GOES_ON] == 0 || n >= count) return;
  const uint page = pages[n];
  const ulong at_first = first ? alive[page] : kept_alive[n], before = first ? 0 : kept_slots[n];
  const ulong slots = at_first & ~before & (freed[n] | changed[page]);
#if LANES == 1
  __local uint begin;
  const uint slot = get_local_id(0);
  barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);  // all have read kept_slots
  if (slot == 0) begin = slots != 0 ? atomic_add(kept_count, (uint)popcount(slots)) : 0;
#else
  const uint slot = 0;
#endif
  if (slot == 0 && first) {
    kept_pages[n] = page;
    kept_frames[n] = page_block[page].w;
    kept_alive[n] = at_first;
  }
  if (slot == 0 && (first || slots != 0)) kept_slots[n] = before | slots;
#if LANES == 1
  barrier(CLK_LOCAL_MEM_FENCE);
  const uint place = begin + (uint)popcount(slots & ((1ul << slot) - 1));
  if ((slots >> slot & 1) == 0 || place >= room) return;
  kept_surfel_slots[place] = PAGE_SLOTS * page + slot;
  kept_surfels[place] = surfels[PAGE_SLOTS * page + slot];
#else
  if (slots == 0) return;
  uint at = atomic_add(kept_count, (uint)popcount(slots));
  for (ulong left = slots; left != 0 && at < room; left &= left - 1, ++at) {
    kept_surfel_slots[at] = PAGE_SLOTS * page + (uint)lowest_bit(left);
    kept_surfels[at] = surfels[kept_surfel_slots[at]];
  }
#endif
}

// One work item handles a page that back_up_pages has kept, after the frame has failed.
//   in  counts: of decide_to_go_on;  kept_pages[count], kept_frames[count], kept_alive[count];   out page_block, alive: the map as it was
__kernel void restore_pages(__global const uint* counts, __global const uint* kept_pages, const uint count, __global const int* kept_frames,
                            __global const ulong* kept_alive, __global int4* page_block, __global ulong* alive) {
  const uint n = get_global_id(0);
  if (counts[COUNT_GOES_ON] == 0 || n >= count) return;
  const uint page = kept_pages[n];
  page_block[page].w = kept_frames[n];
  alive[page] = kept_alive[n];
}

// One work item handles a page that a failed frame may have added.
//   in  pages[first + count]: the last ones;   out alive: of these, 0
__kernel void clear_pages(__global const uint* pages, const uint first, const uint count, __global ulong* alive) {
  const uint n = get_global_id(0);
  if (n < count) alive[pages[first + n]] = 0;
}

// One work item handles a surfel that back_up_pages has kept.
//   in  kept_surfel_slots[count], kept_surfels[count];   out surfels: the map as it was
__kernel void restore_surfels(const uint count, __global const uint* kept_surfel_slots, __global const uint4* kept_surfels,
                              __global uint4* surfels) {
  const uint n = get_global_id(0);
  if (n < count) surfels[kept_surfel_slots[n]] = kept_surfels[n];
}

// One work item handles a page of the window at the end of a frame.
//   in  counts: of decide_to_go_on;  pages[count], alive
//   i/o changed: cleared for the next frame;  page_block: gets `frame` if the page has changed
//   out changes[count]: what this frame has changed in them;  empty[count]: 1 if nothing is left
__kernel void finish_pages(__global const uint* counts, __global const uint* pages, const uint count, __global const ulong* alive,
                           __global ulong* changed, const uint frame, __global int4* page_block, __global ulong* changes,
                           __global uchar* empty) {
  const uint n = get_global_id(0);
  if (counts[COUNT_GOES_ON] == 0 || n >= count) return;
  const uint page = pages[n];
  changes[n] = changed[page];
  empty[n] = alive[page] == 0 ? 1 : 0;
  if (changed[page] != 0) page_block[page].w = (int)frame;
  changed[page] = 0;
}

// One work item handles a page of a list: it copies its words for the host.
//   in  pages[count], alive, page_block;   out page_alive[count], blocks[count]
__kernel void gather_page_words(__global const uint* pages, const uint count, __global const ulong* alive, __global const int4* page_block,
                                __global ulong* page_alive, __global int4* blocks) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  page_alive[n] = alive[pages[n]];
  blocks[n] = page_block[pages[n]];
}

// One work item handles a slot of a list: it copies its surfel for the host.
//   in  slots[count];   out gathered[count]
__kernel void gather_surfels(__global const uint* slots, const uint count, __global const uint4* surfels, __global uint4* gathered) {
  const uint n = get_global_id(0);
  if (n < count) gathered[n] = surfels[slots[n]];
}

// One work item handles a slot of a list of pages: it copies its surfel for the host, which gets the pages one after the other.
//   in  pages[count];   out gathered[PAGE_SLOTS count]
__kernel void gather_pages(__global const uint* pages, const uint count, __global const uint4* surfels, __global uint4* gathered) {
  const uint n = get_global_id(0);
  if (n < PAGE_SLOTS * count) gathered[n] = surfels[PAGE_SLOTS * pages[n / PAGE_SLOTS] + n % PAGE_SLOTS];
}
