/// Iteration over the set bits of a word.
#pragma once

#include <cstdint>

namespace frontier_surfels {

/// Calls visitor(bit number) for each set bit, lowest first.
template <typename Visitor>
void for_each_bit(std::uint64_t bits, Visitor visitor) {
  for (; bits != 0; bits &= bits - 1) visitor(static_cast<std::uint32_t>(__builtin_ctzll(bits)));
}

}  // namespace frontier_surfels
