// Split of surfels that are large for this view - paper 3.4. A surfel of radius r becomes four of radius r / 2 at
// p +- r / (2 sqrt 2) x_psi +- r / (2 sqrt 2) y_psi, with unit axes x_psi and y_psi of the disc, until they are small enough: after L times
// they are 2^L x 2^L of radius r / 2^L.

// How many times large surfels must be halved until they are small enough.
//   z: their depths [m]
INLINE intv split_levels(const Grid* g, const Limits* limits, floatv z, floatv radius) {
  floatv r = divided(0.5f * radius, voxel_size(g, z));  // [voxel]
  intv levels = 1;
  for (int n = 1; n < SPLIT_LEVELS; ++n, r *= 0.5f) levels -= MARK(r >= limits->split_radius);
  return levels;
}

// One work item handles a chunk of LANES surfels that are to be split.
//   in  split_slots[count];  page_block, surfels: the map
//   out children[count]: surfels that each of them is split into
__kernel void count_children(const Frame f, __global const int4* page_block, __global const uint4* surfels, __global const int* split_slots,
                             const int count, __global int* children) {
  const int chunk = get_global_id(0);
  if (chunk * LANES >= count) return;
  intv exist;
  const uintv slots = as_uintv(load_chunk(split_slots, count, chunk, &exist));
  const Surfels s = surfels_at(&f.window, surfels, page_block, slots);
  const intv levels = split_levels(&f.grid, &f.limits, transformed(&f.T_camera_local, s.position).z, s.radius);
  store_first((intv)(1) << (2 * levels), count - chunk * LANES, children + chunk * LANES);
}

// One work item handles a chunk of LANES surfels that are to be split. They leave the map.
//   in  split_slots[count];  offset[count]: prefix sum of count_children's;  page_block, surfels: the map
//   out new_surfels, new_cells: the children, packed for the map, and their cells of the window; those of surfel n start at offset[n]
//   i/o alive, changed: of the map, as 32-bit halves
__kernel void split(const Frame f, __global const int4* page_block, __global const uint4* surfels, __global const int* split_slots,
                    const int count, __global const int* offset, __global uint4* new_surfels, __global int* new_cells, __global uint* alive,
                    __global uint* changed) {
  const int chunk = get_global_id(0);
  if (chunk * LANES >= count) return;
  intv exist;
  const intv slots = load_chunk(split_slots, count, chunk, &exist), first = load_chunk(offset, count, chunk, &exist);
  const Surfels s = surfels_at(&f.window, surfels, page_block, as_uintv(slots));
  const intv levels = split_levels(&f.grid, &f.limits, transformed(&f.T_camera_local, s.position).z, s.radius), side = (intv)(1) << levels;
  const Points normal = unpack_normals(s.normal);
  const intv from_x = MARK(fabs(normal.x) < 0.6f);  // any axis that is not near the normal's
  const Points axis = {from_x ? (floatv)(1.0f) : (floatv)(0.0f), from_x ? (floatv)(0.0f) : (floatv)(1.0f), 0.0f};
  const Points x_psi = normalized(cross_products(normal, axis)), y_psi = cross_products(normal, x_psi);
  const floatv radius = divided(s.radius, convert_floatv(side)), spacing = radius * M_SQRT2_F, middle = 0.5f * convert_floatv(side - 1);

  intv more = exist;
  for (int child = 0; any_lane(more); ++child) {
    const floatv column = convert_floatv((intv)(child) & (side - 1)), row = convert_floatv((intv)(child) >> levels);
    const floatv a = (column - middle) * spacing, b = (row - middle) * spacing;
    const Points p = add_scaled(add_scaled(s.position, a, x_psi), b, y_psi);
    intv cells;
    const Quads packed = pack_surfels(&f.window, p, radius, normal, s.attributes, &cells);
    scatter_quads(packed, first + child, more, new_surfels);
    scatter_int(cells, first + child, more, new_cells);
    more &= MARK(child + 1 < side * side);
  }

  int slot[LANES];
  vstorev(slots, 0, slot);
  for (uint left = lane_bits(exist); left != 0; left &= left - 1) {
    clear_slot(alive, slot[lowest_lane(left)]);
    set_slot(changed, slot[lowest_lane(left)]);
  }
}
