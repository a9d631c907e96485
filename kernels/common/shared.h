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

// Sizes ---------------------------------------------------------------------------------------------------------------------------------

// Tile of the grid whose sign field one work-group keeps in local memory. TILE_K is half a word of the bit fields.
#define TILE_I 8
#define TILE_J 8
#define TILE_K 32

// Tile of the grid that has one list of the kept views that may know something there. A word of columns has WORD_TILES tiles.
#define VIEW_TILE 8
#define VIEW_TILE_K 16
#define WORD_TILES (64 / VIEW_TILE_K)

// Rows of the grid that one work item observes. At width 1 a work-group has one row.
#define SPACE_ROWS 8

// The tables of a camera have rows of voxels that are filled up to whole chunks of this size.
#define TABLE_CHUNK 16

// Words behind the bit field of observed space: vectors are read beyond the end of its last row.
#define SPARE_WORDS 16

// Elements that one work item adds up in a prefix sum.
#define SCAN_CHUNK 64

// Elements that a work item of a group that makes a prefix sum has in each round, and the most work items of such a group.
#define SCAN_STRIP 4
#define MOST_SCAN_ITEMS 256

// Number of surfels in a page of the map. Words about a page have one bit for each of them.
#define PAGE_SLOTS 64

// Number of work items in the groups that go through the pages in view. A group has one or several pages.
#define PAGE_GROUP 64

// Number of work items in the groups that sort new surfels.
#define SORT_GROUP 64

// Kept views ----------------------------------------------------------------------------------------------------------------------------

// Maximum number of kept views.
#define MOST_VIEWS 1024

// Side of the blocks of a view's image whose largest depth is known [pixel].
#define VIEW_BLOCK 8

// Images of views are kept in patches of PATCH_COLUMNS x PATCH_ROWS pixels, which are 64 bytes. Patches lie row by row, and so do the
// pixels of a patch. Neighbouring points are looked up together, and their pixels are likelier to be in one patch than in one row of the
// image.
#define PATCH_COLUMNS 8
#define PATCH_ROWS 4

// Views come in groups: a bit each in a word of 16 bits. Their numbers lie by fields: [groups][VIEW_LANE_FIELDS][VIEW_GROUP].
#define VIEW_GROUP 16

// Fields of a view there. R, t: this frame's camera -> the view's camera; the rest: intrinsics of its image, and where that starts.
#define VIEW_LANE_R00 0
#define VIEW_LANE_R01 1
#define VIEW_LANE_R02 2
#define VIEW_LANE_R10 3
#define VIEW_LANE_R11 4
#define VIEW_LANE_R12 5
#define VIEW_LANE_R20 6
#define VIEW_LANE_R21 7
#define VIEW_LANE_R22 8
#define VIEW_LANE_T0 9
#define VIEW_LANE_T1 10
#define VIEW_LANE_T2 11
#define VIEW_LANE_FX 12
#define VIEW_LANE_FY 13
#define VIEW_LANE_CX 14
#define VIEW_LANE_CY 15
#define VIEW_LANE_WIDTH 16
#define VIEW_LANE_HEIGHT 17
#define VIEW_LANE_FIRST_PIXEL 18  // bits of a uint
#define VIEW_LANE_FIELDS 19

// Seen points (common/seen_points.cl) ----------------------------------------------------------------------------------------------------

// Points of a brick along an edge, a power of two, and the words of its points.
#define SEEN_BRICK 16
#define SEEN_BRICK_SHIFT 4
#define SEEN_WORDS 64

// Bricks that stand for those without any seen point, and for those where all points are seen.
#define SEEN_BRICK_EMPTY 0
#define SEEN_BRICK_FULL 1

// How many points of a brick, or of a box, are seen.
#define SEEN_NONE 0
#define SEEN_MIXED 1
#define SEEN_ALL 2

// Frames that are asked whether they support a surface. - Ours
#define LAST_FRAMES 8

// More bricks around the candidates of a tile are not looked at to find out whether all are alike.
#define SEEN_MOST_BRICKS 64

// Numbers of the method ------------------------------------------------------------------------------------------------------------------
// Those that depend on parameters, or that the host needs as well, are in Limits below.

// Weights of the sign field are whole numbers, 1.0 is SIGN_FIELD_ONE: integer sums do not depend on the order of surfels. - Supplement B
#define SIGN_FIELD_ONE 256

// Surfels in view are those whose ellipsoid comes so near to the grid; generous, as more of them change nothing [voxel]. - Paper 3.4
#define REACH_MARGIN 1.5f

// Maximum number of times that a surfel is split in four within a frame. - Paper 3.4
#define SPLIT_LEVELS 6

// Section 3.2 of the paper must walk paths up to this distance from a candidate, along each axis: the median looks one voxel around, and
// the hull looks at the cells beside a path [voxel].
#define LINE_MARGIN 2

// New surfels slide along their normals by at most SLIDE_STEPS steps of SLIDE_STEP, a step being left in hand; a candidate is therefore
// asked for within VIEW_BOX_MARGIN of its voxel's centre [voxel]. - Ours
#define SLIDE_STEP 0.1f
#define SLIDE_STEPS 4
#define VIEW_BOX_MARGIN 0.55f

// A point was seen before if more than this share of the lattice points around it was, weighted trilinearly. - Ours
#define SEEN_SHARE 0.25f

// PROBES candidates of a tile show which kept views should be asked first. Then FIRST_VIEWS are asked before the candidates left are listed
// anew, then twice as many and so on. Both decide only how long it takes. - Ours
#define PROBES 2
#define FIRST_VIEWS 6

// Taking back - ours: all pixels of a square of TAKE_SQUARE x TAKE_SQUARE must have strong evidence, and pixels within TAKE_GROWTH of its
// middle need weak evidence only [pixel].
#define TAKE_SQUARE 7
#define TAKE_GROWTH 5

// States of points, for planners - ours: a block has STATE_CELLS cells along an edge, and cells come in cubes of STATE_CUBE; a work item
// handles up to STATE_CHUNK points of a cube.
#define STATE_CELLS 8
#define STATE_CUBE 4
#define STATE_CHUNK 64

// The grid of states - ours: a block of 16^3 cells has STATE_BLOCK_CUBES cubes of 4^3 cells, with a word of 64 bits each.
#define STATE_BLOCK_CUBES 64

// Values of views, for planners - ours. Far surfels are merged by cells of the map's blocks: on level 1 of MERGE_LEVELS by MERGE_CELLS
// along a block's edge, and on each further level by half as many.
#define MERGE_LEVELS 3
#define MERGE_CELLS 32
#define MERGE_SUM_WORDS 12  // of a cell's sums

// A pixel of such a view: depth | back | frontier | slope, see planner/view_values.cl. Nothing nearer than VIEW_NEAR is seen [m].
#define VIEW_NEAR 0.0078125f
#define VIEW_NOTHING 0xffffffffu

// Edge of the tiles of its image that hide what is behind them [pixel], and spare tiles behind the end of a row.
#define HIDING_TILE 4
#define HIDING_SPARE 5

// Areas are summed in steps of 1 / VIEW_AREA_ONE, which makes them the same in any order; a surface that is seen at a smaller slope than
// VIEW_LEAST_SLOPE counts as if it had this one.
#define VIEW_AREA_ONE 16777216.0f
#define VIEW_LEAST_SLOPE 0.05f

// Numbers of pixels of a row.
#define VIEW_COUNT_FRONTIER 0
#define VIEW_COUNT_OCCUPIED 1
#define VIEW_COUNT_NOTHING 2
#define VIEW_COUNTS 3

// Names of numbers -----------------------------------------------------------------------------------------------------------------------

// Evidence that a measured surface stands in known space.
#define NO_EVIDENCE 0
#define WEAK_EVIDENCE 1
#define STRONG_EVIDENCE 2

// States of points: SpaceState.
#define SPACE_UNKNOWN 0
#define SPACE_FREE 1
#define SPACE_OCCUPIED 2

// What the surfel nearest to a point is like.
#define BOUNDARY_IN_FRONT 1  // the point is on its known side
#define BOUNDARY_OCCUPIED 2

// Numbers of surfels that kernels count as they go.
#define COUNT_IN_VIEW 0
#define COUNT_LARGE 1
#define COUNT_REMOVED 2
#define COUNT_LABELLED 3
#define COUNT_GOES_ON 4  // not a number: 1 if the frame goes on before the host knows them
#define COUNTS 5

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

// Structures -----------------------------------------------------------------------------------------------------------------------------

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
  float i, j, k;        // grid coordinates of the centre
  float reach;          // rho = 2 r / delta(z) [voxel]
  float n_x, n_y, n_z;  // normal, camera frame
  float n_k;            // its cosine with the k paths: z axis in the cuboid, the ray in the pyramid
  float ray_x, ray_y;   // a step along k moves so many voxels in x and y
  SHARED_UINT slot;     // in the map
  SHARED_UINT ragged;   // 1: opens no path to known space, only closes it
} ViewSurfel;

// Limits of the method: from the configuration, or numbers of the paper (in brackets).
typedef struct {
  float th_d;                // smallest cosine between normal and path that counts - supplement B
  float peak;                // smallest extreme of the sign field that counts, in steps of 1 / SIGN_FIELD_ONE - 3.2
  float thickness;           // half an ellipsoid's length along the normal [voxel] - supplement B
  float hull_unknown_scale;  // the hull's ellipses of surfels that say "unknown" are larger by this (1.5) - supplement C
  float split_radius;        // surfels of this radius or more are split (2 sqrt 3) [voxel] - 3.4
  float create_radius;       // of a new surfel (sqrt 3 / 2) [voxel] - 3.5
  float normal_min;          // shorter sums of directions make no surfel (0.01) - 3.5, eq. (15)
  float back_probe;          // so far behind a surfel space should be unknown [radii] - ours: kBackProbe
  float front_probe;         // so far before a new surfel space should be known [voxel] - ours: kFrontProbe radii
  float min_gap;             // frontier on a thinner sheet of unknown is left out; 0: all is kept [m] - ours
  float surface_depth;       // a surfel so little behind a measured surface is occupied [m] - ours
  SHARED_INT median_votes;   // - 3.2, eq. (8)
  SHARED_INT remove_buried;  // surfels whose back this frame sees are removed, too - ours
  SHARED_INT refine;         // new surfels leave the centre and the mean direction of their voxel - ours
} Limits;

// Limits of taking back (stages/2_evidence.cl) - ours.
typedef struct {
  float noise, noise_growth, quantisation;    // the sensor: parameters of the same names
  float support_margin;                       // another frame supports a surface that it measures within this of it [voxel]
  float weak_margin, strong_margin;           // a view contradicts a surface if it sees farther by this [voxel]
  float reach;                                // so far behind a surface space is taken back [voxel]
  SHARED_INT weak_supports, strong_supports;  // of the last frames; of LAST_FRAMES that look there
  SHARED_INT contradictions;                  // so many kept views must contradict a surface
  SHARED_INT opinions, newer_opinions;        // that count from the newest contradiction on, and of views that agree before it
} TakeBackLimits;

// What every stage of a frame is told.
typedef struct {
  Grid grid;
  Limits limits;
  Window window;
  Transform T_camera_local, T_local_camera;  // local: the window's frame
  View own_view;                             // of this frame, as its own camera sees it
  SHARED_INT has_color;
  SHARED_INT has_seen, has_taken;  // is any point of the lattice seen?  may any be taken back?
  SHARED_INT takes_back;           // does this frame take space back?
  SHARED_INT seen_shift;           // log2 of the bricks along a block's edge
} Frame;

// The camera of views that are evaluated. Images have a few columns and rows more than are counted: squares of pixels reach into them.
typedef struct {
  float fx, fy, cx, cy;
  SHARED_INT width, height;
  SHARED_INT row, image;   // pixels from one row to the next, and from one image to the next
  float min_range, range;  // [m]
  float slope_step;        // of the slope in a pixel
  float inverse_fx, inverse_fy, inverse_step;
  float left, right, top, bottom;  // edges of the image, as tangents: half a pixel from the outermost rays
  float side_x, side_y;            // a point's distance from an edge's plane, times this or less, is x - z * tangent
} AskedCamera;

// A view that is evaluated. Its local frame is the world's, moved to the lowest corner of block `origin`, in which the camera is.
typedef struct {
  Transform T_camera_local, T_local_camera;
  float box_min[3], box_max[3];  // what counts lies in it, local frame [m]
  SHARED_INT origin_x, origin_y, origin_z;
  SHARED_INT first_block, end_block;  // in the list of blocks
} AskedView;

#ifndef __OPENCL_VERSION__
static_assert(sizeof(AskedCamera) == 20 * 4, "AskedCamera must have no padding");
static_assert(sizeof(AskedView) == (2 * 12 + 11) * 4, "AskedView must have no padding");
static_assert(sizeof(Grid) == 19 * 4, "Grid must have no padding");
static_assert(sizeof(Transform) == 12 * 4, "Transform must have no padding");
static_assert(sizeof(Window) == 7 * 4, "Window must have no padding");
static_assert(sizeof(View) == 16 * 4, "View must have no padding");
static_assert(sizeof(ViewSurfel) == 12 * 4, "ViewSurfel must have no padding");
static_assert(sizeof(Limits) == 14 * 4, "Limits must have no padding");
static_assert(sizeof(TakeBackLimits) == 12 * 4, "TakeBackLimits must have no padding");
static_assert(sizeof(Frame) == (19 + 14 + 7 + 2 * 12 + 16 + 5) * 4, "Frame must have no padding");
}  // namespace frontier_surfels
#endif

#endif
