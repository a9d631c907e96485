/// Points of the exact boundary, and how well surfels cover them.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "frontier_surfels/scoring/exact_test.hpp"
#include "scoring/exact_test_view.hpp"

namespace frontier_surfels::scoring {

/// See ExactTest::boundary.
std::vector<BoundaryPoint> find_boundary(const std::vector<ExactView>& views, double z_max, std::size_t segments, std::uint64_t seed,
                                         int threads, const std::function<bool(double)>& progress);

/// Fills in the part of the score that is about boundary points.
void judge_completeness(const std::vector<BoundaryPoint>& boundary, const std::vector<Surfel>& surfels, ExactScore& score);

}  // namespace frontier_surfels::scoring
