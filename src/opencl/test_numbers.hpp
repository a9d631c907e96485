/// Pseudo-random numbers with which a device's arithmetic is tested.
#pragma once

#include <cmath>
#include <cstdint>

namespace frontier_surfels {

/// By whole numbers alone, for input that is the same on every machine.
class TestNumbers {
 public:
  std::uint32_t next() {
    state_ = state_ * 6364136223846793005U + 1442695040888963407U;
    return static_cast<std::uint32_t>(state_ >> 33);
  }

  /// Of either sign, with all digits of a float, between 2^-8 and 2^8.
  float any() {
    const float digits = static_cast<float>(0x800000 + (next() & 0x7fffff));
    return std::ldexp(next() & 1 ? digits : -digits, static_cast<int>(next() % 16) - 31);
  }

 private:
  std::uint64_t state_ = 18;
};

}  // namespace frontier_surfels
