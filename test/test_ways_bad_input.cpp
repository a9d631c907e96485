// Ways refuse what makes no sense, and say which field it is.
#include <gtest/gtest.h>

#include <string>

#include "ways_input.hpp"

namespace frontier_surfels {
namespace {

StateGrid free_grid() {
  CellBox box({-16, -16, 0}, {32, 32, 16});
  box.fill(SpaceState::kFree);
  return box.grid();
}

template <typename Change>
void expect_refused(const StateGrid& grid, const std::string& field, const Change& change) {
  WayOptions options;
  Eigen::Vector3f from(0, 0, 0.4F);
  change(options, from);
  try {
    Ways(grid, from, options);
    ADD_FAILURE() << field << " was taken";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(field), std::string::npos) << error.what();
  }
}

TEST(Ways, RefuseOptionsThatMakeNoSense) {
  const StateGrid grid = free_grid();
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  const auto refused = [&](const std::string& field, double WayOptions::*member, std::initializer_list<double> values) {
    for (const double value : values) expect_refused(grid, field, [&](WayOptions& options, auto&) { options.*member = value; });
  };
  refused("lattice", &WayOptions::lattice, {nan, inf, 0, -0.2, 0.019, 10.01, 1e300});
  refused("radius", &WayOptions::radius, {nan, inf, -0.01, 10.01, 1e300});
  refused("own_room", &WayOptions::own_room, {nan, inf, -0.01, 10.01});
  refused("lowest", &WayOptions::lowest, {nan});
  refused("highest", &WayOptions::highest, {nan});
  expect_refused(grid, "lowest", [](WayOptions& options, auto&) { options.lowest = 2, options.highest = 1; });
  for (int axis = 0; axis < 3; ++axis)
    for (const double bad : {nan, inf}) {
      expect_refused(grid, "from", [&](auto&, Eigen::Vector3f& from) { from[axis] = static_cast<float>(bad); });
      expect_refused(grid, "been", [&](WayOptions& options, auto&) {
        options.been = {Eigen::Vector3f::Zero(), Eigen::Vector3f::Zero()};
        options.been[1][axis] = static_cast<float>(bad);
      });
    }
  WayOptions widest;
  widest.lattice = widest.radius = widest.own_room = 10;
  EXPECT_NO_THROW(Ways(grid, {0, 0, 0.4F}, widest));
  widest.radius = widest.own_room = 0;
  EXPECT_NO_THROW(Ways(grid, {0, 0, 0.4F}, widest));
}

/// 1.6 km of cells of 1 m, with a place every 2 cm, would be 5e14 places.
TEST(Ways, RefuseLatticesThatFitNowhere) {
  StateGrid grid(1);
  const std::vector<std::uint8_t> free = {static_cast<std::uint8_t>(SpaceState::kFree)};
  ASSERT_TRUE(grid.apply({1, 0, 1, {{{-50, -50, -50}, free}, {{50, 50, 50}, free}}}));
  expect_refused(grid, "lattice", [](WayOptions& options, auto&) { options.lattice = 0.02; });
}

}  // namespace
}  // namespace frontier_surfels
