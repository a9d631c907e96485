#include "frontier_surfels/map_checksum.hpp"

#include <cstring>

namespace frontier_surfels {
namespace {

/// The finalizer of MurmurHash3: every bit of the number changes half of the others.
std::uint64_t mixed(std::uint64_t bits) {
  bits = (bits ^ bits >> 33) * 0xff51afd7ed558ccdU;
  bits = (bits ^ bits >> 33) * 0xc4ceb9fe1a85ec53U;
  return bits ^ bits >> 33;
}

std::uint64_t bits_of(float value) {
  value += 0.0F;  // -0 becomes 0
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}

std::uint64_t checksum_of(const Surfel& surfel) {
  std::uint64_t sum = 0x9e3779b97f4a7c15U;
  const auto add = [&sum](std::uint64_t high, std::uint64_t low) { sum = mixed(sum ^ (high << 32 | low)) + 0x9e3779b97f4a7c15U; };
  add(bits_of(surfel.position.x()), bits_of(surfel.position.y()));
  add(bits_of(surfel.position.z()), bits_of(surfel.radius));
  add(bits_of(surfel.normal.x()), bits_of(surfel.normal.y()));
  const std::uint64_t color =
      static_cast<std::uint64_t>(surfel.rgb[0]) << 16 | static_cast<std::uint64_t>(surfel.rgb[1]) << 8 | surfel.rgb[2];
  add(bits_of(surfel.normal.z()), static_cast<std::uint64_t>(surfel.label) << 24 | color);
  return sum;
}

}  // namespace

std::uint64_t map_checksum(const std::vector<Surfel>& surfels) {
  std::uint64_t sum = 0;
  for (const Surfel& surfel : surfels) sum += checksum_of(surfel);
  return sum;
}

std::string checksum_text(std::uint64_t checksum) {
  std::string text(16, '0');
  for (std::size_t n = 16; n-- > 0; checksum >>= 4) text[n] = "0123456789abcdef"[checksum & 15];
  return text;
}

}  // namespace frontier_surfels
