#include "planner/point_states.hpp"

#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "stages/frame.hpp"

namespace frontier_surfels {
namespace {

constexpr const char* kStage = "states";
constexpr int kRegion = 8;                        // blocks along the edge of what is asked for at once
constexpr int kCubes = STATE_CELLS / STATE_CUBE;  // along a block's edge
constexpr int kCubesOfRegion = kRegion * kCubes;  // along an edge
constexpr int kCellsOfCube = STATE_CUBE * STATE_CUBE * STATE_CUBE;
constexpr int kCellCount = kCubesOfRegion * kCubesOfRegion * kCubesOfRegion * kCellsOfCube;
constexpr float kFarthest = 1e6F;  // [m] nothing is mapped beyond

/// Number of a region's cell, as state_cell() in kernels/planner/states.cl counts them. @param cell  from the region's corner
int cell_number(const Eigen::Array3i& cell) {
  const Eigen::Array3i cube = cell / STATE_CUBE, in_cube = cell - STATE_CUBE * cube;
  const int number = (cube.z() * kCubesOfRegion + cube.y()) * kCubesOfRegion + cube.x();
  return ((number * STATE_CUBE + in_cube.z()) * STATE_CUBE + in_cube.y()) * STATE_CUBE + in_cube.x();
}

/// Numbers of the points in each region. Points far beyond the map are left out.
std::map<BlockKey, std::vector<std::uint32_t>> by_region(const std::vector<Eigen::Vector3f>& points, double edge) {
  std::map<BlockKey, std::vector<std::uint32_t>> regions;
  BlockKey last = {};
  std::vector<std::uint32_t>* numbers = nullptr;
  for (std::uint32_t n = 0; n < points.size(); ++n) {
    const Eigen::Vector3f& p = points[n];
    if (!p.allFinite()) throw Error("Point " + std::to_string(n) + " is not finite, so that it has no state.");
    if (p.cwiseAbs().maxCoeff() > kFarthest) continue;
    const Eigen::Array3i at = (p.cast<double>() / edge).array().floor().cast<int>();
    const BlockKey region = {at.x(), at.y(), at.z()};
    if (numbers == nullptr || region != last) numbers = &regions[region];
    last = region;
    numbers->push_back(n);
  }
  return regions;
}

Frame frame_of(const MapWindow& window, const KnownWorld& world) {
  Frame frame = {};
  frame.window = window.window();
  frame.T_local_camera = to_transform(Eigen::Isometry3d::Identity());
  frame.has_seen = world.use_seen && !world.seen.empty() ? 1 : 0;
  frame.has_taken = world.use_seen && !world.taking_back.taken().empty() ? 1 : 0;
  frame.seen_shift = world.seen.shift();
  return frame;
}

}  // namespace

/// The points of a region by cells.
struct PointStates::Sorted {
  std::vector<std::uint32_t> numbers;  ///< of the points, in this order
  std::vector<cl_int> cell_begin;      ///< [cells + 1]
  std::vector<cl_int4> chunks;

  /// Of the coordinates' three rows: whole vectors are read at their ends.
  std::size_t stride() const { return numbers.size() + STATE_CHUNK; }

  Sorted(const std::vector<Eigen::Vector3f>& points, const std::vector<std::uint32_t>& asked, const Eigen::Vector3d& corner,
         double cell_size)
      : numbers(asked.size()), cell_begin(kCellCount + 1, 0) {
    std::vector<int> cells;
    cells.reserve(asked.size());
    for (const std::uint32_t n : asked) {
      const Eigen::Array3i cell = ((points[n].cast<double>() - corner) / cell_size).array().cast<int>();
      cells.push_back(cell_number(cell.max(0).min(kRegion * STATE_CELLS - 1)));
      ++cell_begin[cells.back() + 1];
    }
    for (int cell = 0; cell < kCellCount; ++cell) cell_begin[cell + 1] += cell_begin[cell];
    std::vector<cl_int> next(cell_begin.begin(), cell_begin.end() - 1);
    for (std::size_t n = 0; n < asked.size(); ++n) numbers[next[cells[n]]++] = asked[n];
    add_chunks();
  }

  void add_chunks() {
    for (int cube = 0; cube < kCellCount / kCellsOfCube; ++cube) {
      const int x = cube % kCubesOfRegion, y = cube / kCubesOfRegion % kCubesOfRegion, z = cube / (kCubesOfRegion * kCubesOfRegion);
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
  for (const auto& [region, asked] : by_region(points_world, kRegion * world.map.block_size()))
    find_in_region(region, points_world, asked, world, states);
  return states;
}

void PointStates::find_in_region(const BlockKey& region, const std::vector<Eigen::Vector3f>& points,
                                 const std::vector<std::uint32_t>& asked, const KnownWorld& world, std::vector<SpaceState>& states) {
  const double block_size = world.map.block_size();
  const MapWindow window({kRegion * region.x, kRegion * region.y, kRegion * region.z}, kRegion, block_size);
  const Eigen::Vector3d corner = kRegion * block_size * Eigen::Vector3d(region.x, region.y, region.z);
  const Sorted sorted(points, asked, corner, block_size / STATE_CELLS);

  const std::size_t stride = sorted.stride();
  std::vector<float> coordinates(3 * stride, 0.0F);
  for (std::size_t n = 0; n < asked.size(); ++n)
    for (int axis = 0; axis < 3; ++axis)
      coordinates[axis * stride + n] = static_cast<float>(points[sorted.numbers[n]][axis] - corner[axis]);
  points_.send(std::move(coordinates));
  chunks_.send(sorted.chunks);
  states_.resize(asked.size());
  const int view_count = world.views.prepare(Eigen::Isometry3d(Eigen::Translation3d(corner)));
  world.taking_back.open_window(window, world.seen);
  world.seen.open_window(window);
  const SeenPoints &seen = world.seen, &taken = world.taking_back.taken();
  commands_.run(kStage, "find_states", sorted.chunks.size(), commands_.device().heavy_group(), frame_of(window, world), world.views.views(),
                world.views.view_lanes(), static_cast<cl_int>(view_count), world.views.depths(), seen.slots(), seen.tables(),
                seen.brick_words(), taken.slots(), taken.tables(), taken.brick_words(), points_(), static_cast<cl_int>(stride), chunks_(),
                static_cast<cl_int>(sorted.chunks.size()), states_());
  mark_occupied(window, sorted, world.map);
  const std::vector<cl_uchar> found = states_.read(asked.size());
  for (std::size_t n = 0; n < asked.size(); ++n) states[sorted.numbers[n]] = static_cast<SpaceState>(found[n]);
}

/// Surfels of the blocks around the region reach into it as well.
void PointStates::mark_occupied(const MapWindow& window, const Sorted& sorted, const SurfelMap& map) {
  std::vector<cl_uint> pages;
  for (const BlockKey& block : window.blocks_near(0, std::size_t{1} << 20))
    if (const BlockIndex::Pages* own = map.index().find(block)) pages.insert(pages.end(), own->begin(), own->end());
  const auto count = static_cast<cl_int>(pages.size());
  pages_.send(std::move(pages));
  cell_begin_.send(sorted.cell_begin);
  const std::size_t items = count * (PAGE_SLOTS / commands_.lanes());
  commands_.run(kStage, "mark_occupied", items, kGroup, window.window(), static_cast<cl_float>(1 / kNewRadius), map.surfels(), map.alive(),
                map.page_block(), pages_(), count, points_(), static_cast<cl_int>(sorted.stride()), cell_begin_(), states_());
}

}  // namespace frontier_surfels
