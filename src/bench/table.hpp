/// A table on standard output that grows row by row.
#pragma once

#include <string>
#include <vector>

namespace frontier_surfels::bench {

class Table {
 public:
  /// Prints the title and the heads. The first column has a fixed width for names, the others the width of their heads.
  Table(const std::string& title, const std::vector<std::string>& heads);

  /// @param cells  may be fewer than heads; the last one may be a sentence longer than its column
  void row(const std::vector<std::string>& cells) const;

 private:
  std::vector<int> widths_;
};

std::string fixed(double value, int digits);

}  // namespace frontier_surfels::bench
