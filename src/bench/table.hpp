/// A table on standard output that grows while it is measured.
#pragma once

#include <string>
#include <vector>

namespace frontier_surfels::bench {

class Table {
 public:
  /// Prints title and head. The first column is as wide as an input's name may be, the others as their heads.
  Table(const std::string& title, const std::vector<std::string>& heads);

  /// @param cells  those that are missing stay empty; a last one that is longer than its column may be a sentence
  void row(const std::vector<std::string>& cells) const;

 private:
  std::vector<int> widths_;
};

std::string fixed(double value, int digits);

}  // namespace frontier_surfels::bench
