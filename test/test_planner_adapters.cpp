// The maps of gbplanner and mav_active_3d_planning on a MapClient, against slow, obvious loops over cells.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "../doc/planners/active_3d_planning_map.hpp"
#include "../doc/planners/gbplanner_map.hpp"

namespace frontier_surfels::adapters {
namespace {

constexpr double kResolution = 0.05;
constexpr int kEdge = StateBlock::kEdge;
using Point = Eigen::Vector3d;
using Cell = std::array<int, 3>;

/// Like MapManager::VoxelStatus: an enum within a class.
struct MapManager {
  enum VoxelStatus { kUnknown = 0, kOccupied, kFree };
};
using VoxelStatus = MapManager::VoxelStatus;
using Map = GbplannerMap<VoxelStatus>;

/// What a planner derives from its own interface compiles.
struct SurfelMapManager : MapManager {
  explicit SurfelMapManager(const MapClient& client) : map(client) {}
  VoxelStatus getVoxelStatus(const Point& position) const { return map.getVoxelStatus(position); }
  GbplannerMap<MapManager::VoxelStatus> map;
};

/// Blocks around the origin, with holes, that are mostly free.
StateChanges random_changes(std::mt19937& random, std::uint64_t sequence) {
  StateChanges changes = {sequence, 0, kResolution, {}};
  for (int n = 0; n < 4 * 3 * 2; ++n) {
    StateBlock block = {{n % 4 - 2, n / 4 % 3 - 1, n / 12 - 1}, {static_cast<std::uint8_t>(random() % 3)}};
    if (random() % 3 != 0) {
      block.cells.assign(StateBlock::kBytes, 0);
      for (int cell = 0; cell < StateBlock::kCells; ++cell) {
        const unsigned kind = random() % 20;
        const auto bit = static_cast<std::uint8_t>(1 << cell % 8);
        if (kind > 1) block.cells[cell / 8] |= bit;
        if (kind == 1) block.cells[StateBlock::kBytes / 2 + cell / 8] |= bit;
      }
    }
    if (random() % 6 != 0) changes.blocks.push_back(block);
  }
  return changes;
}

int cell_of(double x) { return static_cast<int>(std::floor(static_cast<double>(static_cast<float>(x)) * (1 / kResolution))); }
Cell cell_of(const Point& p) { return {cell_of(p.x()), cell_of(p.y()), cell_of(p.z())}; }
Point center_of(const Cell& cell) { return (Eigen::Array3d(cell[0], cell[1], cell[2]) + 0.5) * kResolution; }

/// The same grid as a map of cells.
struct Slow {
  std::map<Cell, SpaceState> cells;
  std::set<Cell> added;

  explicit Slow(const StateChanges& changes) {
    for (const StateBlock& block : changes.blocks)
      for (int n = 0; n < StateBlock::kCells; ++n)
        cells[{kEdge * block.block[0] + n % kEdge, kEdge * block.block[1] + n / kEdge % kEdge, kEdge * block.block[2] + n / 256}] =
            block.state(n);
  }
  VoxelStatus at(const Cell& cell) const {
    const auto found = cells.find(cell);
    const SpaceState state = found == cells.end() ? SpaceState::kUnknown : found->second;
    if (state == SpaceState::kUnknown) return added.count(cell) != 0 ? MapManager::kFree : MapManager::kUnknown;
    return state == SpaceState::kFree ? MapManager::kFree : MapManager::kOccupied;
  }
  VoxelStatus at(const Point& p) const { return at(cell_of(p)); }

  static std::vector<Cell> touched(const Point& center, const Point& size) {
    std::vector<Cell> touched;
    const Cell low = cell_of(center - size / 2), high = cell_of(center + size / 2);
    for (int x = low[0]; x <= high[0]; ++x)
      for (int y = low[1]; y <= high[1]; ++y)
        for (int z = low[2]; z <= high[2]; ++z) touched.push_back({x, y, z});
    return touched;
  }
  void add(const Point& center, const Point& size) {
    for (const Cell& cell : touched(center, size)) added.insert(cell);
  }
  VoxelStatus box(const Point& center, const Point& size) const {
    bool unknown = false;
    for (const Cell& cell : touched(center, size)) {
      if (at(cell) == MapManager::kOccupied) return MapManager::kOccupied;
      unknown = unknown || at(cell) == MapManager::kUnknown;
    }
    return unknown ? MapManager::kUnknown : MapManager::kFree;
  }

  /// The cells of a ray, in their order: those in which at least a 10000th of it lies. `grazed` gets all that it comes close to.
  static std::vector<Cell> along(const Point& from, const Point& to, std::set<Cell>& grazed) {
    constexpr int kPoints = 20000;
    std::vector<Cell> along;
    std::map<Cell, int> points;
    for (int n = 0; n <= kPoints; ++n) {
      const Point p = from + (to - from) * n / kPoints;
      if (++points[cell_of(p)] == 1) along.push_back(cell_of(p));
      for (const Cell& near : touched(p, Point::Constant(4e-4))) grazed.insert(near);
    }
    along.erase(std::remove_if(along.begin(), along.end(), [&](const Cell& cell) { return points[cell] < 2; }), along.end());
    return along;
  }
};

struct PlannerAdapters : testing::Test {
  PlannerAdapters() {
    EXPECT_TRUE(client.apply(changes));
    for (int n = 0; n < 30; ++n) {
      const Point center = random_point(), size = Point(0.3, 0.5, 0.4);
      EXPECT_TRUE(map.augmentFreeBox(center, size));
      slow.add(center, size);
    }
  }
  Point random_point() {
    std::uniform_real_distribution<double> x(-1.9, 1.9), y(-1.1, 1.9), z(-1.1, 1.1);
    const double a = x(random), b = y(random), c = z(random);
    return {a, b, c};
  }
  std::mt19937 random{7};
  StateChanges changes = random_changes(random, 4);
  MapClient client;
  Map map{client};
  Slow slow{changes};
};

TEST_F(PlannerAdapters, GbplannersVoxels) {
  std::map<VoxelStatus, int> count;
  for (int n = 0; n < 20000; ++n) {
    const Point p = random_point();
    ASSERT_EQ(map.getVoxelStatus(p), slow.at(p)) << p.transpose();
    ++count[slow.at(p)];
  }
  for (const VoxelStatus status : {MapManager::kUnknown, MapManager::kOccupied, MapManager::kFree}) EXPECT_GT(count[status], 500);
  EXPECT_EQ(map.getResolution(), kResolution);
  EXPECT_TRUE(map.getStatus());
  EXPECT_EQ(SurfelMapManager(client).getVoxelStatus(Point::Constant(50)), MapManager::kUnknown);
  const MapClient empty;
  EXPECT_FALSE(GbplannerMap<>(empty).getStatus());
  EXPECT_FALSE(GbplannerMap<>(empty).augmentFreeBox(Point::Zero(), Point::Ones()));
}

TEST_F(PlannerAdapters, GbplannersFreeBoxesCountWhereTheGridIsUnknown) {
  const Point center(5, 5, 5), size(0.6, 0.6, 0.3);  // beyond the grid
  EXPECT_EQ(map.getBoxStatus(center, size, true), MapManager::kUnknown);
  ASSERT_TRUE(map.augmentFreeBox(center, size));
  EXPECT_EQ(map.getBoxStatus(center, size, true), MapManager::kFree);
  EXPECT_EQ(map.getBoxStatus(center, 1.5 * size, true), MapManager::kUnknown);
  EXPECT_EQ(map.getPathStatus(center, center + Point(0.1, 0, 0), 0.5 * size, true), MapManager::kFree);
  EXPECT_EQ(map.getPathStatus(center, center + Point(1, 0, 0), 0.5 * size, true), MapManager::kUnknown);
  EXPECT_EQ(map.getPathStatus(center, center + Point(1, 0, 0), 0.5 * size, false), MapManager::kFree);
  EXPECT_EQ(map.getRayStatus(center, center + Point(0.2, 0.2, 0), true), MapManager::kFree);
  ASSERT_TRUE(client.apply(StateChanges{9, 0, 0.1, {}}));  // voxels of another grid are others
  EXPECT_EQ(map.getVoxelStatus(2 * center), MapManager::kUnknown);
  EXPECT_EQ(map.getBoxStatus(center, size, true), MapManager::kUnknown);
  ASSERT_TRUE(map.augmentFreeBox(center, size));
  EXPECT_EQ(map.getBoxStatus(center, size, true), MapManager::kFree);
  ASSERT_TRUE(client.apply(StateChanges{10, 0, kResolution, changes.blocks}));
  EXPECT_EQ(map.getBoxStatus(center, size, true), MapManager::kUnknown);
  ASSERT_TRUE(map.augmentFreeBox(center, size));
  EXPECT_EQ(map.getVoxelStatus(center), MapManager::kFree);
  slow.added.clear();
  map.augmentFreeFrustum();
  map.resetMap();
  EXPECT_EQ(map.getVoxelStatus(center), MapManager::kUnknown);
  for (int n = 0; n < 5000; ++n) {
    const Point p = random_point();
    ASSERT_EQ(map.getVoxelStatus(p), slow.at(p));
  }
}

TEST_F(PlannerAdapters, GbplannersRays) {
  std::map<VoxelStatus, int> count;
  for (int n = 0; n < 300; ++n) {
    const Point from = random_point(), to = random_point();
    const bool stop_at_unknown = n % 2 == 0;
    std::set<Cell> grazed;
    const std::vector<Cell> along = Slow::along(from, to, grazed);
    const auto stops = [&](const Cell& cell) {
      return slow.at(cell) == MapManager::kOccupied || (stop_at_unknown && slow.at(cell) == MapManager::kUnknown);
    };
    const auto first = std::find_if(along.begin(), along.end(), stops);
    Point end;
    double distance = 0;
    const VoxelStatus found = map.getRayStatus(from, to, stop_at_unknown, end, distance);
    ASSERT_EQ(map.getRayStatus(from, to, stop_at_unknown), found);
    ++count[found];
    if (found == MapManager::kFree) {
      ASSERT_TRUE(first == along.end()) << n;
      ASSERT_EQ(end, to);
    } else {
      ASSERT_EQ(slow.at(end), found);
      ASSERT_TRUE(stops(cell_of(end)));
      ASSERT_EQ(grazed.count(cell_of(end)), 1U) << n;
      const auto stopped = std::find(along.begin(), along.end(), cell_of(end));
      if (stopped != along.end()) {
        ASSERT_TRUE(stopped == first) << n;  // else it stopped at a corner
      } else if (first != along.end()) {
        ASSERT_LT((center_of(cell_of(end)) - from).norm(), (center_of(*first) - from).norm() + 2 * kResolution);
      }
    }
    const VoxelStatus there = slow.at(end);
    ASSERT_EQ(distance == -0.5, there == MapManager::kUnknown);
    ASSERT_TRUE(there == MapManager::kUnknown || (distance >= 0 && distance <= 0.5));
    ASSERT_TRUE(there != MapManager::kOccupied || distance == 0);
  }
  for (const VoxelStatus status : {MapManager::kUnknown, MapManager::kOccupied, MapManager::kFree}) EXPECT_GT(count[status], 10);
}

TEST_F(PlannerAdapters, GbplannersBoxesAndPaths) {
  std::map<VoxelStatus, int> count;
  const Point size(0.12, 0.07, 0.09);
  for (int n = 0; n < 2000; ++n) {
    const Point at = random_point(), end = at + 0.2 * random_point();
    ASSERT_EQ(map.getBoxStatus(at, size, n % 2 == 0), slow.box(at, size));
    ++count[slow.box(at, size)];
    const bool stop_at_unknown = n % 2 == 0;
    const int steps = 1 + static_cast<int>(2 * (end - at).norm() / kResolution);
    VoxelStatus path = MapManager::kFree;
    for (int m = 0; m <= steps && path == MapManager::kFree; ++m) {
      const VoxelStatus here = slow.box(at + (end - at) * m / steps, size);
      if (here == MapManager::kOccupied || (stop_at_unknown && here == MapManager::kUnknown)) path = here;
    }
    ASSERT_EQ(map.getPathStatus(at, end, size, stop_at_unknown), path) << n;
  }
  for (const VoxelStatus status : {MapManager::kUnknown, MapManager::kOccupied, MapManager::kFree}) EXPECT_GT(count[status], 50);
}

TEST_F(PlannerAdapters, GbplannersScansCountEachVoxelOnce) {
  int sensor = 0;  // gbplanner's SensorParamsBase
  std::size_t all_certain = 0, all_blocked = 0;
  for (int n = 0; n < 40; ++n) {
    Point pos = random_point();
    Map::Points ends;
    for (int m = 0; m < 30; ++m) ends.push_back(pos + Point(1, 0.02 * m, 0.01 * m));
    std::set<Cell> certain, possible;
    for (const Point& end : ends) {
      std::set<Cell> grazed;
      const std::vector<Cell> along = Slow::along(pos, end, grazed);
      bool open = true;  // no occupied voxel yet
      for (const Cell& cell : grazed) open = open && slow.at(cell) != MapManager::kOccupied;
      possible.insert(grazed.begin(), grazed.end());
      if (open) certain.insert(along.begin(), along.end());
    }
    std::tuple<int, int, int> gain;
    std::vector<std::pair<Point, VoxelStatus>> log;
    map.getScanStatus(pos, ends, gain, log, sensor);
    std::set<Cell> logged;
    std::map<VoxelStatus, int> count;
    for (const auto& [center, status] : log) {
      ASSERT_TRUE(logged.insert(cell_of(center)).second);
      ASSERT_LT((center - center_of(cell_of(center))).norm(), 1e-9);
      ASSERT_EQ(status, slow.at(center));
      ++count[status];
    }
    ASSERT_EQ(gain, std::make_tuple(count[MapManager::kUnknown], count[MapManager::kFree], count[MapManager::kOccupied]));
    all_certain += certain.size();
    all_blocked += static_cast<std::size_t>(count[MapManager::kOccupied]);
    ASSERT_TRUE(std::includes(possible.begin(), possible.end(), logged.begin(), logged.end()));
    ASSERT_TRUE(std::includes(logged.begin(), logged.end(), certain.begin(), certain.end()));
    for (const Point& end : ends) {  // nothing behind what is occupied, if no other ray sees it
      log.clear();
      map.getScanStatus(pos, {end}, gain, log, sensor);
      for (std::size_t m = 0; m + 1 < log.size(); ++m) ASSERT_NE(log[m].second, MapManager::kOccupied);
      ASSERT_EQ(cell_of(log.front().first), cell_of(pos));
      ASSERT_TRUE(log.back().second == MapManager::kOccupied || cell_of(log.back().first) == cell_of(end));
    }
  }
  EXPECT_GT(all_certain, 500U);
  EXPECT_GT(all_blocked, 50U);
}

TEST_F(PlannerAdapters, GbplannersLocalMaps) {
  for (int n = 0; n < 40; ++n) {
    const Point center = random_point(), size(0.5, 0.3, 0.4), axis = n % 2 == 0 ? Point::UnitX() : random_point();
    const Eigen::Matrix3d turn = Eigen::Quaterniond::FromTwoVectors(Point::UnitX(), axis).toRotationMatrix();
    std::set<Cell> occupied, free;
    for (const Cell& cell : Slow::touched(center, Point::Constant(size.norm() + kResolution))) {
      const Point p = turn.transpose() * (center_of(cell) - center);
      if ((p.array().abs() > size.array() / 2).any() || slow.at(cell) == MapManager::kUnknown) continue;
      (slow.at(cell) == MapManager::kFree ? free : occupied).insert(cell);
    }
    Map::Points found_occupied(3), found_free(3);
    if (n % 2 == 0)
      map.extractLocalMap(center, size, found_occupied, found_free);
    else
      map.extractLocalMapAlongAxis(center, axis, size, found_occupied, found_free);
    const auto cells = [](const Map::Points& points) {
      std::set<Cell> cells;
      for (const Point& p : points) cells.insert(cell_of(p));
      EXPECT_EQ(cells.size(), points.size());
      return cells;
    };
    ASSERT_EQ(cells(found_occupied), occupied);
    ASSERT_EQ(cells(found_free), free);
  }
}

TEST_F(PlannerAdapters, WhatIsNoPlaceIsUnknown) {
  for (const Point& p : {Point(std::nan(""), 0, 0), Point(0, HUGE_VAL, 0), Point(0, 0, -1e30)}) {
    const Point here = Point::Zero(), size = Point::Ones();
    std::tuple<int, int, int> gain;
    std::vector<std::pair<Point, VoxelStatus>> log;
    Map::Points occupied, free;
    EXPECT_EQ(map.getVoxelStatus(p), MapManager::kUnknown);
    EXPECT_EQ(map.getRayStatus(here, p, false), MapManager::kUnknown);
    EXPECT_EQ(map.getBoxStatus(p, size, true), MapManager::kUnknown);
    EXPECT_EQ(map.getPathStatus(here, p, size, true), MapManager::kUnknown);
    EXPECT_FALSE(map.augmentFreeBox(p, size));
    EXPECT_FALSE(map.augmentFreeBox(here, p));
    map.getScanStatus(here, {p}, gain, log, 0);
    EXPECT_TRUE(log.empty());
    map.extractLocalMap(p, size, occupied, free);
    EXPECT_TRUE(occupied.empty() && free.empty());
    const Active3dPlanningMap other(client, 0.1);
    Point center = here;
    EXPECT_FALSE(other.isTraversable(p));
    EXPECT_FALSE(other.isObserved(p));
    EXPECT_EQ(other.getVoxelCenter(&center, p), p.allFinite());
    EXPECT_EQ(center == here, !p.allFinite());
  }
}

TEST_F(PlannerAdapters, Active3dPlanning) {
  slow.added.clear();
  const double radius = 0.06;
  const Active3dPlanningMap other(client, radius);
  EXPECT_EQ(other.getVoxelSize(), kResolution);
  int traversable = 0;
  for (int n = 0; n < 3000; ++n) {
    const Point p = random_point();
    const VoxelStatus status = slow.at(p);
    ASSERT_EQ(other.getVoxelState(p), status == MapManager::kOccupied ? 0 : status == MapManager::kFree ? 1 : 2);
    ASSERT_EQ(other.isObserved(p), status != MapManager::kUnknown);
    Point center;
    ASSERT_TRUE(other.getVoxelCenter(&center, p));
    ASSERT_EQ(center, center_of(cell_of(p)));
    double distance = HUGE_VAL;  // to the nearest voxel that is not free
    for (const Cell& cell : Slow::touched(p, Point::Constant(4 * radius)))
      if (slow.at(cell) != MapManager::kFree)
        distance = std::min(distance, ((center_of(cell) - p).array().abs() - kResolution / 2).max(0).matrix().norm());
    if (std::abs(distance - radius) < 1e-5) continue;
    ASSERT_EQ(other.isTraversable(p), distance > radius) << p.transpose();
    ASSERT_EQ(other.isTraversable(p, Eigen::Quaterniond(Eigen::AngleAxisd(1, Point::UnitZ()))), distance > radius);
    traversable += distance > radius;
  }
  EXPECT_GT(traversable, 50);
  EXPECT_LT(traversable, 2900);
}

}  // namespace
}  // namespace frontier_surfels::adapters
