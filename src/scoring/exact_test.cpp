#include "frontier_surfels/scoring/exact_test.hpp"

#include <algorithm>

#include "scoring/exact_test_boundary.hpp"
#include "scoring/exact_test_surfels.hpp"
#include "scoring/exact_test_view.hpp"

namespace frontier_surfels::scoring {

namespace {

/// About the share of the time that the surfels take, the rest is the boundary's.
constexpr double kSurfelsShare = 0.8;

}  // namespace

ExactTest::ExactTest(const Config& config) : config_(config) { (void)DepthReading(config); }  // throws if they make no sense

ExactTest::~ExactTest() = default;
ExactTest::ExactTest(ExactTest&&) noexcept = default;
ExactTest& ExactTest::operator=(ExactTest&&) noexcept = default;

void ExactTest::add(const DepthFrame& frame) { views_.emplace_back(frame, DepthReading(config_)); }

void ExactTest::set_placed(const std::vector<PlacedBox>& placed) {
  for (std::size_t i = 0; i < views_.size(); ++i) {
    std::vector<OrientedBox> voids;
    for (const PlacedBox& box : placed)
      if (i < box.frames_before) voids.push_back(box.box_world);
    views_[i].set_voids(std::move(voids));
  }
}

std::size_t ExactTest::size() const { return views_.size(); }

bool ExactTest::known(const Eigen::Vector3d& p_world) const {
  return std::any_of(views_.begin(), views_.end(), [&](const ExactView& view) { return view.sees(p_world); });
}

std::vector<BoundaryPoint> ExactTest::boundary(std::size_t segments, std::uint64_t seed, int threads) const {
  return find_boundary(views_, config_.z_max, segments, seed, threads, {});
}

ExactScore ExactTest::score(const std::vector<Surfel>& surfels, std::size_t segments, int threads,
                            const std::function<bool(double)>& progress, std::vector<Verdict>* verdicts) const {
  const auto part_of_progress = [&](double begin, double end) -> std::function<bool(double)> {
    if (!progress) return {};
    return [&progress, begin, end](double share) { return progress(begin + (end - begin) * share); };
  };

  const SurfelTally tally = judge_surfels(views_, surfels, threads, part_of_progress(0, kSurfelsShare), verdicts);
  const auto share = [&](std::size_t count) { return surfels.empty() ? 0.0 : static_cast<double>(count) / surfels.size(); };
  const auto share_of = [&](Verdict verdict) { return share(tally.verdicts[static_cast<std::size_t>(verdict)]); };
  ExactScore score;
  score.right = share_of(Verdict::kRight);
  score.buried = share_of(Verdict::kBuried);
  score.floating = share_of(Verdict::kFloating);
  score.flipped = share_of(Verdict::kFlipped);
  score.within_1v = share(tally.within_1v);
  score.within_2v = share(tally.within_2v);
  score.fdr_2cm = share(tally.beyond_2cm);
  score.fdr_5cm = share(tally.beyond_5cm);

  const auto boundary = find_boundary(views_, config_.z_max, segments, kSeed, threads, part_of_progress(kSurfelsShare, 1));
  judge_completeness(boundary, surfels, score);
  return score;
}

}  // namespace frontier_surfels::scoring
