// Structures that the host and the device share: read by C++ and by OpenCL C. 4-byte scalars only, so that both lay them out alike.
#ifndef FRONTIER_SURFELS_SHARED_H
#define FRONTIER_SURFELS_SHARED_H

#ifdef __OPENCL_VERSION__
#define SHARED_INT int
#define SHARED_UINT uint
#else
#include <cstdint>
namespace frontier_surfels {
#define SHARED_INT std::int32_t
#define SHARED_UINT std::uint32_t
#endif

// Tile of the grid whose sign field one work-group keeps in local memory. TILE_K is half a word of the bit fields.
#define TILE_I 8
#define TILE_J 8
#define TILE_K 32

// Tile of the grid that has one list of the recent views that may know something there. VIEW_TILE_K is a quarter of a word.
#define VIEW_TILE 8
#define VIEW_TILE_K 16

// So many views can be kept at most.
#define MOST_VIEWS 1024

// Side of the blocks of a view's image whose largest depth is known [pixel].
#define VIEW_BLOCK 8

// So many rows of the grid one work item observes.
#define SPACE_ROWS 8

// Images of views are kept in patches of PATCH_COLUMNS x PATCH_ROWS pixels, row by row, and so are the pixels of a patch: one is 64 bytes.
// Points near each other are asked for together, and a row of pixels would be of use for one of them.
#define PATCH_COLUMNS 8
#define PATCH_ROWS 4

// So many candidates, or views, one work item handles at once, as vectors of 16; and the numbers that a view then has.
#define LANES 16
#define VIEW_LANE_FIELDS 19

// Weights of the sign field are whole numbers: 1.0 is SIGN_FIELD_ONE. Integer sums do not depend on the order of the surfels.
#define SIGN_FIELD_ONE 256

// Numbers of surfels that kernels count as they go.
#define COUNT_IN_VIEW 0
#define COUNT_LARGE 1
#define COUNT_REMOVED 2
#define COUNTS 3

// Elements that one work item adds up in a prefix sum.
#define SCAN_CHUNK 64

// Words whose set bits one work item lists.
#define WORD_CHUNK 16

// Surfels of a page of the map: a bit each in the words that say something of a page.
#define PAGE_SLOTS 64

// Work items that go through a page's surfels, LANES each, and of groups of such: several pages.
#define PAGE_ITEMS (PAGE_SLOTS / LANES)
#define PAGE_GROUP 64

// Work items that sort new surfels by block, one after the other each its share.
#define SORT_CHUNKS 64

// Bit fields of the sign field's events: EVENT_PLANES for each family of paths (i, j, k), in this order.
#define EVENT_ENTER_FORWARD 0
#define EVENT_EXIT_FORWARD 1
#define EVENT_ENTER_BACKWARD 2
#define EVENT_EXIT_BACKWARD 3
#define EVENT_INVALID 4
#define EVENT_PLANES 5

// The six faces of the grid, in the order of the known state hull's images.
#define FACE_I_LOW 0
#define FACE_I_HIGH 1
#define FACE_J_LOW 2
#define FACE_J_HIGH 3
#define FACE_K_LOW 4
#define FACE_K_HIGH 5

// A surfel's attributes beside its geometry: red | green << 8 | blue << 16 | flags << 24.
#define SURFEL_OCCUPIED (1u << 24)
#define SURFEL_COLORED (1u << 25)
#define SURFEL_RAGGED (1u << 26)  // known space is thin here: the normal finds it, but says nothing of the paths around

// The non-uniform voxel grid of one view - paper 3.1, eq. (2)-(3).
typedef struct {
  SHARED_INT size_i, size_j, size_k;  // voxels
  SHARED_INT words_k;                 // 64-bit words that hold size_k bits
  SHARED_INT width, height;           // of the working image [pixel]
  SHARED_INT padding_i, padding_j, padding_k;
  SHARED_INT first_pyramid_layer;  // ceil(k_min)
  float fx, fy, f;                 // of the working image [pixel]; f: their mean
  float center_i, center_j;        // optical axis [voxel]
  float k_min;                     // grid coordinate of z_min
  float z_min, z_max, delta_min;   // [m]
} Grid;

// p_b = R p_a + t for T_b_a; R by rows.
typedef struct {
  float r00, r01, r02, r10, r11, r12, r20, r21, r22;
  float t0, t1, t2;
} Transform;

// The map's blocks around this frame's grid. The local frame is the world's, moved to the corner of the first block: its numbers stay small
// wherever the camera is. Block (x, y, z) from the corner is cell (z size_y + y) size_x + x.
typedef struct {
  SHARED_INT origin_x, origin_y, origin_z;  // first block, counted from the world's origin
  SHARED_INT size_x, size_y, size_z;        // blocks
  float block_size;                         // edge of a block, a power of two [m]
} Window;

// A kept view: what its camera sees of this frame's, and where its depths start in the pool; behind them the largest depths of its blocks.
// Depths are whole numbers of steps, 16 bits each, rounded down; the step is the same for all views.
typedef struct {
  Transform to_image;  // this frame's camera -> (x, y, z): in the view's camera at depth z, in column x / z and row y / z, rounded down
  SHARED_INT width, height;
  SHARED_UINT first_pixel;
  float depth_step;  // [m]
} View;

// A surfel as the view's grid sees it.
typedef struct {
  float i, j, k;           // grid coordinates of the centre
  float reach;             // rho = 2 r / delta(z) [voxel]
  float n_x, n_y, n_z;     // normal, camera frame
  float n_k;               // its cosine with the k paths: z axis in the cuboid, the ray in the pyramid
  float ray_x, ray_y;      // a step along k moves so many voxels in x and y
  SHARED_UINT slot;        // in the map
  SHARED_UINT ragged;      // 1: opens no path to known space, only closes it
} ViewSurfel;

// Limits of the method, from the configuration.
typedef struct {
  float th_d;
  float peak;               // in steps of 1 / SIGN_FIELD_ONE
  float thickness;          // [voxel]
  float hull_unknown_scale;
  float split_radius;       // surfels of this radius or more are split [voxel]
  float create_radius;      // of a new surfel [voxel]
  float normal_min;         // shorter sums of directions make no surfel
  float min_gap;            // frontier on a thinner sheet of unknown is left out [m]; 0: all is kept
  float surface_depth;      // so far behind a measured surface a surfel is occupied [m]
  SHARED_INT median_votes;
} Limits;

#ifndef __OPENCL_VERSION__
static_assert(sizeof(Grid) == 19 * 4, "Grid must have no padding");
static_assert(sizeof(Transform) == 12 * 4, "Transform must have no padding");
static_assert(sizeof(Window) == 7 * 4, "Window must have no padding");
static_assert(sizeof(View) == 16 * 4, "View must have no padding");
static_assert(sizeof(ViewSurfel) == 12 * 4, "ViewSurfel must have no padding");
static_assert(sizeof(Limits) == 10 * 4, "Limits must have no padding");
}  // namespace frontier_surfels
#endif

#endif
