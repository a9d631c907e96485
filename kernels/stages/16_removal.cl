// Removal - paper 3.4, eq. (12) - of the surfels that 5_visit has decided on.

// One work item handles a page of the window: slots of removed surfels become free.
//   in  counts: of decide_to_go_on;  pages[count], removed[count]: a bit for each surfel of the page;   i/o alive, changed: of the map
__kernel void remove_surfels(__global const uint* counts, __global const uint* pages, const uint count, __global const ulong* removed,
                             __global ulong* alive, __global ulong* changed) {
  const uint n = get_global_id(0);
  if (counts[COUNT_GOES_ON] == 0 || n >= count || removed[n] == 0) return;
  alive[pages[n]] &= ~removed[n];
  changed[pages[n]] |= removed[n];
}
