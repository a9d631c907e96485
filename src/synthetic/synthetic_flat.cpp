#include "synthetic/synthetic_flat.hpp"

#include <cmath>
#include <utility>

namespace frontier_surfels::replay {
namespace {

using Eigen::Vector3d;

constexpr double kLength = 10, kDepth = 8, kHeight = 2.5;  // [m] along x, y and z
constexpr double kWall = 0.1;                              // [m] thickness
constexpr double kDoor = 2.05;                             // [m] height
constexpr Rgb kWood = {176, 120, 66}, kDark = {110, 80, 55}, kWhite = {225, 225, 215}, kMetal = {90, 90, 100}, kGreen = {70, 110, 85},
              kRed = {170, 50, 45}, kBlue = {60, 90, 150}, kYellow = {200, 200, 60};

using Doors = std::vector<std::pair<double, double>>;  ///< where each begins and ends along its wall [m]

/// A wall inside the flat with doors in it, from `begin` to `end` along an axis (0: x, 1: y); `side` is its lower face on the other axis.
Solids wall(int axis, double side, double begin, double end, const Doors& doors, const Rgb& rgb) {
  Solids pieces;
  const auto add = [&](double from, double to, double z_from) {
    const Vector3d low = axis == 0 ? Vector3d(from, side, z_from) : Vector3d(side, from, z_from);
    const Vector3d high = axis == 0 ? Vector3d(to, side + kWall, kHeight) : Vector3d(side + kWall, to, kHeight);
    pieces.push_back(box(low, high, rgb));
  };
  for (const auto& [from, to] : doors) {
    add(begin, from, 0);
    add(from, to, kDoor);
    begin = to;
  }
  add(begin, end, 0);
  return pieces;
}

Solids shell() {
  const Rgb floor = {150, 111, 72}, plaster = {222, 216, 200}, inner = {196, 190, 160}, blue = {140, 165, 190};
  const double w = kWall;
  Solids solids = {box({-w, -w, -w}, {kLength + w, kDepth + w, 0}, floor, 0.25),
                   box({-w, -w, kHeight}, {kLength + w, kDepth + w, kHeight + w}, {240, 240, 240}),
                   box({-w, -w, 0}, {0, kDepth + w, kHeight}, plaster),
                   box({kLength, -w, 0}, {kLength + w, kDepth + w, kHeight}, plaster),
                   box({0, -w, 0}, {kLength, 0, kHeight}, blue),
                   box({0, kDepth, 0}, {kLength, kDepth + w, kHeight}, blue)};
  append(solids, wall(0, 3.2, 0, kLength, {{2.4, 3.4}, {8.0, 8.95}}, inner));               // the corridor's south side
  append(solids, wall(0, 4.6, 0, kLength, {{1.5, 2.4}, {4.5, 5.4}, {8.5, 9.4}}, plaster));  // its north side
  append(solids, wall(1, 5.9, 0, 3.2, {{1.1, 2.3}}, inner));                                // living room and kitchen
  append(solids, wall(1, 3.9, 4.7, kDepth, {}, inner));                                     // bedroom and bathroom
  append(solids, wall(1, 6.0, 4.7, kDepth, {}, inner));                                     // bathroom and study
  return solids;
}

Solids table(double x, double y, double length, double width, double height) {
  const Vector3d low(x, y, height - 0.03), high(x + length, y + width, height);
  Solids solids = legs(low, high, 0.06, kWood);
  solids.push_back(box(low, high, kWood));
  return solids;
}

/// A chair of 0.42 x 0.42 m with its corner at (x, y) and its back at the side that (dx, dy) points to.
Solids chair(double x, double y, int dx, int dy) {
  constexpr double kSize = 0.42, kBack = 0.04;
  const Vector3d low(x, y, 0.43), high(x + kSize, y + kSize, 0.47);
  Vector3d back_low(x, y, 0.47), back_high(x + kSize, y + kSize, 0.92);
  if (dx != 0) (dx > 0 ? back_low : back_high).x() = dx > 0 ? x + kSize - kBack : x + kBack;
  if (dy != 0) (dy > 0 ? back_low : back_high).y() = dy > 0 ? y + kSize - kBack : y + kBack;
  Solids solids = legs(low, high, 0.04, {60, 60, 60});
  solids.push_back(box(low, high, kRed));
  solids.push_back(box(back_low, back_high, kRed));
  return solids;
}

/// A shelf without a back, from `low` on the floor to `high`, with sides across its longer edge and four boards.
Solids shelf(const Vector3d& low, const Vector3d& high) {
  constexpr double kBoard = 0.03;
  const int along = high.x() - low.x() > high.y() - low.y() ? 0 : 1;
  Vector3d first = high, second = low, inner_low = low, inner_high = high;
  first[along] = inner_low[along] = low[along] + kBoard;
  second[along] = inner_high[along] = high[along] - kBoard;
  Solids solids = {box(low, first, kDark), box(second, high, kDark)};
  for (int board = 0; board < 4; ++board) {
    inner_low.z() = low.z() + board * (high.z() - low.z() - kBoard) / 3;
    inner_high.z() = inner_low.z() + kBoard;
    solids.push_back(box(inner_low, inner_high, kDark));
  }
  return solids;
}

Solids lamp(double x, double y, double z, double height) {
  return {cylinder({x, y, z}, 0.03, height, kMetal), sphere({x, y, z + height + 0.12}, 0.13, {250, 240, 190})};
}

Solids living_room() {
  Solids solids = {box({1.2, 0, 0}, {3.2, 0.5, 0.42}, kGreen),
                   box({1.2, 0, 0.42}, {3.2, 0.22, 0.82}, kGreen),  // a sofa with arms
                   box({1.0, 0, 0}, {1.2, 0.85, 0.6}, kGreen),
                   box({3.2, 0, 0}, {3.4, 0.85, 0.6}, kGreen),
                   box({1.2, 0.5, 0}, {3.2, 0.85, 0.42}, kGreen),
                   box({0.06, 1.3, 0.97}, {0.1, 2.3, 1.6}, {30, 30, 35}),
                   box({0, 1.1, 0}, {0.4, 2.5, 0.45}, kWhite),  // a screen, a board
                   box({0, 1.7, 0.45}, {0.06, 1.9, 1.3}, {30, 30, 35}),
                   cylinder({0.4, 0.4, 0}, 0.18, 0.4, kRed),
                   sphere({0.4, 0.4, 0.72}, 0.35, kGreen),  // a plant in a pot
                   cylinder({4.6, 1.5, 0.74}, 0.12, 0.1, kYellow)};
  append(solids, table(1.6, 1.25, 1.1, 0.6, 0.42));
  append(solids, table(4.1, 1.1, 0.9, 1.4, 0.74));
  append(solids, chair(3.55, 1.2, -1, 0));
  append(solids, chair(3.55, 1.95, -1, 0));
  append(solids, chair(4.35, 0.55, 0, -1));
  append(solids, shelf({4.2, 0, 0}, {5.6, 0.3, 1.9}));
  append(solids, {box({4.4, 0, 0.66}, {4.8, 0.2, 0.95}, kBlue), box({5.0, 0, 1.27}, {5.4, 0.22, 1.5}, kYellow)});
  append(solids, lamp(5.6, 2.9, 0, 1.5));
  return solids;
}

Solids kitchen() {
  Solids solids = {box({9.4, 0.6, 0}, {kLength, 2.6, 0.9}, kWhite),  box({7.2, 0, 0}, {9.4, 0.6, 0.9}, kWhite),             // counters
                   box({9.4, 0, 0}, {kLength, 0.6, 0.9}, kWhite),    box({6.3, 0, 0}, {7.0, 0.65, 1.85}, {235, 235, 240}),  // a fridge
                   box({7.2, 0, 1.45}, {8.6, 0.35, 2.1}, kWood),     box({9.65, 1.0, 1.45}, {kLength, 2.4, 2.1}, kWood),    // cupboards
                   box({7.5, 0.15, 0.9}, {7.9, 0.45, 1.15}, kMetal), cylinder({9.7, 1.5, 0.9}, 0.14, 0.2, kRed),
                   sphere({7.5, 2.2, 0.85}, 0.11, {230, 120, 30})};
  append(solids, table(7.1, 1.8, 0.8, 0.8, 0.74));
  append(solids, chair(7.3, 2.68, 0, 1));
  append(solids, chair(6.62, 2.0, -1, 0));
  return solids;
}

Solids bedroom() {
  Solids solids = {box({0, 5.7, 0.1}, {2.0, 7.3, 0.5}, kBlue),    box({0, 5.7, 0.5}, {0.5, 7.3, 0.62}, kWhite),  // a bed, its pillow
                   box({0, 5.65, 0}, {0.06, 7.35, 1.0}, kDark),   box({1.7, 5.75, 0}, {1.8, 7.25, 0.1}, kDark),
                   box({2.4, 7.4, 0}, {3.9, kDepth, 2.2}, kWood),  // a wardrobe
                   box({0, 7.5, 0}, {0.4, 7.9, 0.5}, kWood),      box({0, 5.1, 0}, {0.4, 5.5, 0.5}, kWood),
                   box({3.5, 5.0, 0}, {3.9, 6.2, 0.8}, kWood),    box({3.87, 5.2, 1.0}, {3.9, 6.0, 1.9}, {180, 200, 220}),  // chest, mirror
                   cylinder({2.9, 6.6, 0}, 0.22, 0.45, kYellow)};
  append(solids, lamp(0.2, 7.7, 0.5, 0.2));
  append(solids, lamp(0.2, 5.3, 0.5, 0.2));
  return solids;
}

Solids bathroom() {
  return {
      box({4.0, 7.25, 0}, {5.7, 7.33, 0.55}, kWhite),       box({4.0, 7.92, 0}, {5.7, kDepth, 0.55}, kWhite),  // a tub: sides, ends, bottom
      box({4.0, 7.33, 0}, {4.08, 7.92, 0.55}, kWhite),      box({5.62, 7.33, 0}, {5.7, 7.92, 0.55}, kWhite),
      box({4.08, 7.33, 0}, {5.62, 7.92, 0.12}, kWhite),     box({4.0, 5.6, 0.72}, {4.45, 6.2, 0.86}, kWhite),
      cylinder({4.22, 5.9, 0}, 0.09, 0.72, kWhite),                                                         // a basin on its foot
      cylinder({5.6, 6.3, 0}, 0.19, 0.42, kWhite),          box({5.78, 6.1, 0}, {6.0, 6.5, 0.85}, kWhite),  // a toilet
      box({5.6, 4.7, 0}, {6.0, 5.1, 1.0}, {200, 210, 230}), cylinder({4.2, 4.95, 0}, 0.14, 0.5, kMetal)};
}

Solids study() {
  Solids solids = {box({8.5, 7.5, 0.98}, {9.1, 7.54, 1.35}, {30, 30, 35}),
                   cylinder({8.8, 7.6, 0.74}, 0.05, 0.24, kMetal),  // a screen
                   box({9.5, 5.4, 0}, {kLength, 6.6, 1.2}, kWhite),
                   box({6.2, 4.9, 0}, {6.7, 5.3, 0.35}, {190, 150, 100}),
                   box({6.25, 4.95, 0.35}, {6.6, 5.25, 0.6}, {190, 150, 100}),
                   sphere({7.6, 5.6, 0.18}, 0.18, {230, 120, 30}),
                   cylinder({9.75, 6.0, 1.2}, 0.1, 0.3, kBlue),
                   cylinder({9.7, 7.7, 0}, 0.16, 0.4, kMetal),
                   box({6.1, 6.2, 0.66}, {6.3, 6.8, 0.95}, kYellow),
                   box({6.1, 6.7, 1.27}, {6.32, 7.2, 1.55}, kRed)};
  append(solids, table(8.0, 7.2, 1.5, 0.75, 0.74));
  append(solids, chair(8.55, 6.75, 0, -1));
  append(solids, shelf({6.1, 5.8, 0}, {6.4, 7.6, 1.9}));
  return solids;
}

Solids corridor() {
  return {box({3.9, 3.3, 0}, {5.3, 3.6, 0.85}, kWood),     cylinder({4.3, 3.45, 0.85}, 0.08, 0.25, kBlue),  // a sideboard
          box({9.7, 3.4, 0}, {kLength, 4.4, 0.45}, kDark), box({9.9, 3.5, 1.3}, {kLength, 4.3, 1.75}, kGreen),
          cylinder({6.4, 4.4, 0}, 0.13, 0.5, kMetal),      box({0.6, 4.57, 1.2}, {1.2, 4.6, 1.8}, kRed)};
}

}  // namespace

World synthetic_flat() {
  Solids solids = shell();
  for (const auto& room : {living_room(), kitchen(), bedroom(), bathroom(), study(), corridor()}) append(solids, room);
  return World(std::move(solids));
}

Eigen::AlignedBox3d flat_bounds() { return {Vector3d::Zero(), Vector3d(kLength, kDepth, kHeight)}; }

std::vector<Eigen::Isometry3d> flat_starts() {
  std::vector<Eigen::Isometry3d> starts;
  const auto add = [&](double x, double y, double yaw) {
    starts.push_back(Eigen::Translation3d(x, y, 1.2) * Eigen::Isometry3d(Eigen::AngleAxisd(yaw, Vector3d::UnitZ())));
  };
  add(0.8, 3.95, 0);
  add(3.0, 2.6, -M_PI / 2);
  add(8.6, 1.5, M_PI);
  add(2.8, 5.6, M_PI / 2);
  add(7.6, 6.4, -M_PI / 4);
  return starts;
}

Eigen::Isometry3d flat_start() { return flat_starts().front(); }

}  // namespace frontier_surfels::replay
