/// Rounding towards minus infinity, without a call of std::floor, which is a function on older processors.
#pragma once

namespace frontier_surfels {

inline int round_down(double value) {
  const int whole = static_cast<int>(value);
  return whole - (value < whole ? 1 : 0);
}

inline int divide_down(int number, int by) { return (number >= 0 ? number : number - by + 1) / by; }

}  // namespace frontier_surfels
