/// What is left of an exploration: a table of its views, maps for a film strip, and a page.
#pragma once

#include <frontier_surfels/Coverage.h>

#include <Eigen/Core>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

namespace frontier_surfels {

/// The strategies in a text with spaces between them. @throws Error  one is none: frontiers, octomap, nearest or random
std::vector<std::string> strategies_in(const std::string& text);

class ExplorationLog {
 public:
  /// @param folder  gets exploration.csv, a line for each view; is made if it is missing, and loses the pictures of an earlier
  ///                exploration; empty: nothing is written
  /// @throws FileError  it cannot be written
  explicit ExplorationLog(const std::string& folder);

  /// @param decision_ms  that it took to choose this view [ms]
  void add(const std::string& strategy, const Coverage& coverage, double decision_ms, const Eigen::Vector3f& position_world);

  /// Where a map of now belongs, if the film strip needs one: after each fifth of what can be seen, and at the end.
  std::optional<std::string> picture(const std::string& strategy, const Coverage& coverage, bool at_end);

  /// Makes explore.html. @throws Error  it could not be made
  void finish();

 private:
  std::string folder_;
  std::ofstream table_;
  std::string strategy_;     ///< of the last picture
  double next_picture_ = 0;  ///< share from which on it is due
};

}  // namespace frontier_surfels
