/// Comparison of surfels, bit for bit.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Are all fields equal bit by bit?
inline bool same(const Surfel& a, const Surfel& b) {
  return std::memcmp(a.position.data(), b.position.data(), 3 * sizeof(float)) == 0 &&
         std::memcmp(a.normal.data(), b.normal.data(), 3 * sizeof(float)) == 0 && std::memcmp(&a.radius, &b.radius, sizeof(float)) == 0 &&
         a.label == b.label && a.rgb == b.rgb && a.id == b.id;
}

inline testing::AssertionResult same(const std::vector<Surfel>& a, const std::vector<Surfel>& b) {
  if (a.size() != b.size()) return testing::AssertionFailure() << a.size() << " surfels against " << b.size();
  for (std::size_t n = 0; n < a.size(); ++n)
    if (!same(a[n], b[n])) return testing::AssertionFailure() << "surfel " << n << " of " << a.size() << " differs";
  return testing::AssertionSuccess();
}

}  // namespace frontier_surfels
