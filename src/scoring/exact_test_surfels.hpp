/// The exact test of each surfel.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "frontier_surfels/scoring/exact_test.hpp"
#include "scoring/exact_test_view.hpp"

namespace frontier_surfels::scoring {

/// How many surfels are what; see ExactScore.
struct SurfelTally {
  std::array<std::size_t, 4> verdicts{};  ///< by Verdict
  std::size_t within_1v = 0, within_2v = 0;
  std::size_t beyond_2cm = 0, beyond_5cm = 0;
};

/// Judges every surfel against the views. The result is that of ExactView::sees on every view and depends on nothing else.
/// @param verdicts  if not null: one per surfel
SurfelTally judge_surfels(const std::vector<ExactView>& views, const std::vector<Surfel>& surfels, int threads,
                          const std::function<bool(double)>& progress, std::vector<Verdict>* verdicts);

}  // namespace frontier_surfels::scoring
