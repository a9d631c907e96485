#include "planner/point_states.hpp"

#include <algorithm>
#include <set>
#include <string>
#include <utility>

#include "planner/regions.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {
namespace {

constexpr const char* kStage = "states";
constexpr std::size_t kFewPoints = 1000;          // most blocks of their window have none of them
constexpr int kCubes = STATE_CELLS / STATE_CUBE;  // along a block's edge
constexpr int kCellsOfCube = STATE_CUBE * STATE_CUBE * STATE_CUBE;

/// The blocks in which some points lie.
MapWindow window_around(const std::vector<Eigen::Vector3f>& points, const std::vector<std::uint32_t>& asked, double block_size) {
  Eigen::AlignedBox3f box;
  for (const std::uint32_t n : asked) box.extend(points[n]);
  return {block_at(box.min().cast<double>(), block_size), block_at(box.max().cast<double>(), block_size), block_size};
}

/// The blocks that a surfel within `reach` of some point may be in, each once.
std::vector<BlockKey> blocks_around(const std::vector<Eigen::Vector3f>& points, const std::vector<std::uint32_t>& asked, double reach,
                                    double block_size) {
  const Eigen::Vector3d around = Eigen::Vector3d::Constant(1.001 * reach + 1e-4);  // more than rounding loses
  std::set<BlockKey> blocks;
  for (const std::uint32_t n : asked) {
    const Eigen::Vector3d p = points[n].cast<double>();
    const BlockKey low = block_at(p - around, block_size), high = block_at(p + around, block_size);
    for (int z = low.z; z <= high.z; ++z)
      for (int y = low.y; y <= high.y; ++y)
        for (int x = low.x; x <= high.x; ++x) blocks.insert({x, y, z});
  }
  return {blocks.begin(), blocks.end()};
}

}  // namespace

Frame open_window(const MapWindow& window, const KnownWorld& world) {
  world.taking_back.open_window(window, world.seen);
  world.seen.open_window(window);
  Frame frame = make_frame(window, world.use_seen ? &world.seen : nullptr);
  frame.has_taken = world.use_seen && !world.taking_back.taken().empty() ? 1 : 0;
  return frame;
}

/// The points of a window by cells.
struct PointStates::Sorted {
  Eigen::Array3i cubes;                ///< of the window, along each axis
  std::vector<std::uint32_t> numbers;  ///< of the points, in this order
  std::vector<cl_int> cell_begin;      ///< [cells + 1]
  std::vector<cl_int4> chunks;

  /// Of the coordinates' three rows: whole vectors are read at their ends.
  std::size_t stride() const { return numbers.size() + STATE_CHUNK; }

  /// @param corner  of the window [m]. @param cell_size  [m]
  Sorted(const std::vector<Eigen::Vector3f>& points, const std::vector<std::uint32_t>& asked, const Window& window,
         const Eigen::Vector3d& corner, double cell_size)
      : cubes(kCubes * Eigen::Array3i(window.size_x, window.size_y, window.size_z)), numbers(asked.size()) {
    std::vector<int> cells;
    cells.reserve(asked.size());
    cell_begin.assign(static_cast<std::size_t>(cubes.prod()) * kCellsOfCube + 1, 0);
    for (const std::uint32_t n : asked) {
      const Eigen::Array3i cell = ((points[n].cast<double>() - corner) / cell_size).array().cast<int>();
      cells.push_back(cell_number(cell.max(0).min(STATE_CUBE * cubes - 1)));
      ++cell_begin[cells.back() + 1];
    }
    for (std::size_t cell = 1; cell < cell_begin.size(); ++cell) cell_begin[cell] += cell_begin[cell - 1];
    std::vector<cl_int> next(cell_begin.begin(), cell_begin.end() - 1);
    for (std::size_t n = 0; n < asked.size(); ++n) numbers[next[cells[n]]++] = asked[n];
    add_chunks();
  }

  /// Number of a cell, as state_cell() in kernels/planner/states.cl counts them. @param cell  from the window's corner
  int cell_number(const Eigen::Array3i& cell) const {
    const Eigen::Array3i cube = cell / STATE_CUBE, in_cube = cell - STATE_CUBE * cube;
    const int number = (cube.z() * cubes.y() + cube.y()) * cubes.x() + cube.x();
    return ((number * STATE_CUBE + in_cube.z()) * STATE_CUBE + in_cube.y()) * STATE_CUBE + in_cube.x();
  }

  void add_chunks() {
    for (int cube = 0; cube < cubes.prod(); ++cube) {
      const int x = cube % cubes.x(), y = cube / cubes.x() % cubes.y(), z = cube / (cubes.x() * cubes.y());
      const int begin = cell_begin[cube * kCellsOfCube], end = cell_begin[(cube + 1) * kCellsOfCube];
      for (int first = begin; first < end; first += STATE_CHUNK)
        chunks.push_back({{first, std::min(STATE_CHUNK, end - first), x | y << 16, z}});
    }
  }
};

PointStates::PointStates(Commands& commands)
    : commands_(commands), points_(commands), chunks_(commands), cell_begin_(commands), pages_(commands), states_(commands) {}

std::vector<SpaceState> PointStates::find(const std::vector<Eigen::Vector3f>& points_world, const KnownWorld& world) {
  std::vector<SpaceState> states(points_world.size(), SpaceState::kUnknown);
  for (const auto& [region, asked] : by_region(points_world, world.map.block_size(), "it has no state."))
    find_some(points_world, asked, world, states);
  return states;
}

void PointStates::find_some(const std::vector<Eigen::Vector3f>& points, const std::vector<std::uint32_t>& asked, const KnownWorld& world,
                            std::vector<SpaceState>& states) {
  const double block_size = world.map.block_size();
  const MapWindow window = window_around(points, asked, block_size);
  const Eigen::Vector3d corner = window.corner_world();
  const Sorted sorted(points, asked, window.window(), corner, block_size / STATE_CELLS);

  const std::size_t stride = sorted.stride();
  std::vector<float> coordinates(3 * stride, 0.0F);
  for (std::size_t n = 0; n < asked.size(); ++n)
    for (int axis = 0; axis < 3; ++axis)
      coordinates[axis * stride + n] = static_cast<float>(points[sorted.numbers[n]][axis] - corner[axis]);
  points_.send(std::move(coordinates));
  chunks_.send(sorted.chunks);
  states_.resize(asked.size());
  const int view_count = world.views.prepare(Eigen::Isometry3d(Eigen::Translation3d(corner)));
  const Frame frame = open_window(window, world);
  const SeenPoints &seen = world.seen, &taken = world.taking_back.taken();
  commands_.run(kStage, "find_states", sorted.chunks.size(), commands_.shape().heavy_group, frame, world.views.views(),
                world.views.view_lanes(), static_cast<cl_int>(view_count), world.views.depths(), seen.slots(), seen.tables(),
                seen.brick_words(), taken.slots(), taken.tables(), taken.brick_words(), points_(), static_cast<cl_int>(stride), chunks_(),
                static_cast<cl_int>(sorted.chunks.size()), states_());
  mark_occupied(window, points, asked, sorted, world.map);
  const std::vector<cl_uchar> found = states_.read(asked.size());
  for (std::size_t n = 0; n < asked.size(); ++n) states[sorted.numbers[n]] = static_cast<SpaceState>(found[n]);
}

/// Surfels of the blocks around the window reach into it as well, by a voxel.
void PointStates::mark_occupied(const MapWindow& window, const std::vector<Eigen::Vector3f>& points,
                                const std::vector<std::uint32_t>& asked, const Sorted& sorted, const SurfelMap& map) {
  const double reach = map.largest_radius() / kNewRadius;
  std::vector<cl_uint> pages;
  for (const BlockKey& block :
       asked.size() <= kFewPoints ? blocks_around(points, asked, reach, map.block_size()) : window.blocks_near(reach, std::size_t{1} << 20))
    if (const BlockIndex::Pages* own = map.index().find(block)) pages.insert(pages.end(), own->begin(), own->end());
  const auto count = static_cast<cl_int>(pages.size());
  pages_.send(std::move(pages));
  cell_begin_.send(sorted.cell_begin);
  const std::size_t items = count * (PAGE_SLOTS / commands_.lanes());
  commands_.run(kStage, "mark_occupied", items, kGroup, window.window(), static_cast<cl_float>(1 / kNewRadius), map.surfels(), map.alive(),
                map.page_block(), pages_(), count, points_(), static_cast<cl_int>(sorted.stride()), cell_begin_(), states_());
}

}  // namespace frontier_surfels
