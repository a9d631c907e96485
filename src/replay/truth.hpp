/// Judges a map against what an ideal sensor would have seen.
#pragma once

#include <memory>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/scoring/exact_test.hpp"
#include "frontier_surfels/scoring/object_test.hpp"
#include "recordings/truth_folder.hpp"

namespace frontier_surfels::replay {

class Truth {
 public:
  /// @param config  says how the mapper reads depth images
  Truth(const Config& config, std::shared_ptr<TruthFolder> folder);

  /// Adds the ideal frame for a recorded one that the mapper has taken.
  /// @param index       of the frame in the recording
  /// @param surfels_in  the map after the frame; may be empty
  /// @throws Error      the folder has no such frame
  void add(std::size_t index, const DepthFrame& recorded, const scoring::ObjectTest::SurfelsIn& surfels_in);

  /// The exact test of the ideal frames, for the world as it is in the last of them.
  const scoring::ExactTest& exact() const { return exact_; }

  /// What there is to say of the objects; empty if the folder has none. @param surfels  the whole map at the end
  std::vector<scoring::ObjectScore> objects(const std::vector<Surfel>& surfels) const;

  const std::shared_ptr<TruthFolder>& folder() const { return folder_; }

 private:
  void tell_what_stands_now();

  std::shared_ptr<TruthFolder> folder_;
  scoring::ExactTest exact_;
  scoring::ObjectTest objects_;
  std::vector<std::size_t> frames_;  ///< indices of those that were added
};

}  // namespace frontier_surfels::replay
