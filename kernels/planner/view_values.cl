// Values of views, for planners - ours: what a camera would see of the map.

#define HIDING_BLOCKS 8  // so many blocks are drawn before tiles are looked at again

// `per_view` work items share an image: each draws the surfels of some of the blocks that the view may see.
//   in  views[count];  drawn: for each view, nearest first: number of the block * (MERGE_LEVELS + 1), + the level of its merged surfels if
//       those are drawn;  pages, page_begin, places, merged, merged_count: see merged_surfels.cl
//   i/o images: VIEW_NOTHING before;  tiles[views][image_tiles]: the same, if one work item draws an image; see view_hiding.cl
__kernel void draw_views(const AskedCamera camera, const float block_size, const float largest_radius, __global const AskedView* views,
                         const int count, const int per_view, __global const uint* drawn, __global const uint4* surfels,
                         __global const ulong* alive, __global const int4* page_block, __global const uint* pages,
                         __global const uint* page_begin, __global const uint* places, __global const uint4* merged,
                         __global const uint* merged_count, __global uint* images, const uint image_tiles, __global uint* tiles) {
  const int n = get_global_id(0) / per_view;
  if (n >= count) return;
  const AskedView view = views[n];
  const Window window = {view.origin_x, view.origin_y, view.origin_z, 1, 1, 1, block_size};
  __global uint* image = images + (ulong)n * camera.image;
  __global uint* own_tiles = tiles + (ulong)n * image_tiles;
  const bool shared = per_view > 1;
  int since_tiles = 0;
  for (int at = view.first_block + get_global_id(0) % per_view; at < view.end_block; at += per_view) {
    const uint block = drawn[at] / (MERGE_LEVELS + 1), level = drawn[at] % (MERGE_LEVELS + 1), begin = page_begin[block],
               end = page_begin[block + 1];
    const int4 corner = page_block[pages[begin]];
    if (!shared) {
      if (since_tiles == HIDING_BLOCKS) {
        find_tiles(&camera, image, own_tiles);
        since_tiles = 0;
      }
      const float3 lowest =
          block_size * (float3)((float)(corner.x - view.origin_x), (float)(corner.y - view.origin_y), (float)(corner.z - view.origin_z));
      const float margin = fmax(largest_radius, merged_reach(level, block_size));
      if (is_block_hidden(&camera, &view.T_camera_local, lowest, block_size, margin, own_tiles)) continue;
      ++since_tiles;
    }
    if (level != 0) {
      const uint left = merged_count[merged_counter(level, block, places)];
      __global const uint4* own = merged + merged_begin(level, block, page_begin, places);
      for (uint m = 0; m < left; m += LANES) {
        const Surfels s = load_surfels(&window, own, corner, m);
        draw_surfels(&camera, &view.T_camera_local, s, lane_bits(MARK((int)m + lane_numbers() < (int)left)), image, shared);
      }
      continue;
    }
    for (uint m = begin; m < end; ++m) {
      const ulong word = alive[pages[m]];
      for (uint first = PAGE_SLOTS * pages[m]; first < PAGE_SLOTS * (pages[m] + 1); first += LANES) {
        const uint lanes = lanes_of_page(word, first);
        if (lanes == 0) continue;
        draw_surfels(&camera, &view.T_camera_local, load_surfels(&window, surfels, corner, first), lanes, image, shared);
      }
    }
  }
}

INLINE ulong sum_of_lanes(ulongv values) {
  ulong value[LANES], sum = 0;
  vstorev(values, 0, value);
  for (int m = 0; m < LANES; ++m) sum += value[m];
  return sum;
}
INLINE uint sum_of_marks(intv sums) {
  int value[LANES], sum = 0;
  vstorev(sums, 0, value);
  for (int m = 0; m < LANES; ++m) sum -= value[m];
  return (uint)sum;
}

// One work item counts a row of an image.
//   out areas[views][height][2]: frontier, occupied: of the surface that the pixels see, z^2 / slope, which is its area times fx fy, in
//       steps of 1 / VIEW_AREA_ONE;  counts[views][height][VIEW_COUNTS]
__kernel void count_views(const AskedCamera camera, __global const AskedView* views, const int count, __global const uint* images,
                          __global ulong* areas, __global uint* counts) {
  const int item = get_global_id(0), n = item / camera.height, v = item % camera.height;
  if (n >= count) return;
  const AskedView view = views[n];
  __global const uint* pixels = images + (ulong)n * camera.image + v * camera.row;
  ulongv frontier_area = 0, occupied_area = 0;
  intv frontier_pixels = 0, occupied_pixels = 0, empty_pixels = 0;
  for (int first = 0; first < camera.width; first += LANES) {
    const intv u = first + lane_numbers(), exist = MARK(u < camera.width);
    const uintv keys = vloadv(0, pixels + first);
    const intv empty = MARK(keys == VIEW_NOTHING);
    empty_pixels += empty & exist;
    const floatv z = depths_of_keys(keys);
    const Points p = {divided(convert_floatv(u) - camera.cx, camera.fx) * z, divided((float)v - camera.cy, camera.fy) * z, z};
    const Points at = transformed(&view.T_local_camera, p);
    const intv inside = MARK(at.x >= view.box_min[0]) & MARK(at.x <= view.box_max[0]) & MARK(at.y >= view.box_min[1]) &
                        MARK(at.y <= view.box_max[1]) & MARK(at.z >= view.box_min[2]) & MARK(at.z <= view.box_max[2]);
    const intv counted = exist & ~empty & inside & MARK((keys & BACK_PIXEL) == 0) & MARK(z >= camera.min_range);
    const intv frontier = counted & MARK((keys & FRONTIER_PIXEL) != 0), occupied = counted & ~frontier;
    if (!any_lane(counted)) continue;
    const floatv slope = fmax(convert_floatv(keys & (FRONTIER_PIXEL - 1)) * camera.slope_step, VIEW_LEAST_SLOPE);
    const floatv area = counted ? divided(z * z, slope) * VIEW_AREA_ONE : (floatv)(0.0f);
    frontier_area += convert_ulongv(frontier ? area : (floatv)(0.0f));
    occupied_area += convert_ulongv(occupied ? area : (floatv)(0.0f));
    frontier_pixels += frontier;
    occupied_pixels += occupied;
  }
  areas[2 * item] = sum_of_lanes(frontier_area);
  areas[2 * item + 1] = sum_of_lanes(occupied_area);
  counts[VIEW_COUNTS * item + VIEW_COUNT_FRONTIER] = sum_of_marks(frontier_pixels);
  counts[VIEW_COUNTS * item + VIEW_COUNT_OCCUPIED] = sum_of_marks(occupied_pixels);
  counts[VIEW_COUNTS * item + VIEW_COUNT_NOTHING] = sum_of_marks(empty_pixels);
}
