#include "bench/table.hpp"

#include <algorithm>
#include <cstdio>

#include "frontier_surfels/number_text.hpp"

namespace frontier_surfels::bench {
namespace {

constexpr int kNameWidth = 22;
constexpr int kNumberWidth = 8;

}  // namespace

Table::Table(const std::string& title, const std::vector<std::string>& heads) {
  for (const std::string& head : heads) widths_.push_back(std::max(static_cast<int>(head.size()), kNumberWidth));
  widths_.front() = kNameWidth;
  std::printf("\n%s\n", title.c_str());
  row(heads);
}

void Table::row(const std::vector<std::string>& cells) const {
  std::string line;
  for (std::size_t n = 0; n < cells.size(); ++n) {
    const std::string gap(std::max(widths_[n] - static_cast<int>(cells[n].size()), 0), ' ');
    line += n == 0 ? cells[n] + gap : "  " + gap + cells[n];
  }
  std::printf("%s\n", line.c_str());
  std::fflush(stdout);
}

std::string fixed(double value, int digits) { return fixed_text(value, digits); }

}  // namespace frontier_surfels::bench
