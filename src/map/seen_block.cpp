#include "map/seen_block.hpp"

#include <algorithm>
#include <utility>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

void SeenBlockBytes::add_points(const std::function<bool(int)>& is_seen) {
  std::vector<std::uint8_t> words(kBrickBytes, 0);
  for (int point = 0; point < SEEN_BRICK * SEEN_BRICK * SEEN_BRICK; ++point) {
    if (!is_seen(point)) continue;
    const int bit = seen_bit(point);
    words[bit / 8] |= static_cast<std::uint8_t>(1 << bit % 8);
  }
  add_words(words);
}

void SeenBlockBytes::add_words(const std::vector<std::uint8_t>& words) {
  states_.push_back(SEEN_MIXED);
  words_.insert(words_.end(), words.begin(), words.end());
}

std::vector<std::uint8_t> SeenBlockBytes::take() {
  states_.insert(states_.end(), words_.begin(), words_.end());
  return std::move(states_);
}

void check_seen_block(const std::vector<std::uint8_t>& bytes, std::size_t bricks) {
  if (bytes.empty()) return;
  const auto states_end = bytes.begin() + static_cast<std::ptrdiff_t>(std::min(bricks, bytes.size()));
  const auto mixed = static_cast<std::size_t>(std::count(bytes.begin(), states_end, SEEN_MIXED));
  const bool known = std::all_of(bytes.begin(), states_end, [](std::uint8_t state) { return state <= SEEN_ALL; });
  if (!known || bytes.size() != bricks + mixed * kBrickBytes)
    throw FileError("What has been seen in a block is damaged, or was saved with another distance of its points: use another copy.");
}

std::vector<std::uint8_t> united_seen_blocks(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b, std::size_t bricks) {
  check_seen_block(a, bricks);
  check_seen_block(b, bricks);
  if (a.empty() || b.empty()) return a.empty() ? b : a;
  SeenBlockBytes all;
  auto next_a = a.begin() + static_cast<std::ptrdiff_t>(bricks), next_b = b.begin() + static_cast<std::ptrdiff_t>(bricks);
  for (std::size_t brick = 0; brick < bricks; ++brick) {
    std::vector<std::uint8_t> words(kBrickBytes, 0);
    const auto add = [&](std::uint8_t state, auto& next) {
      if (state != SEEN_MIXED) return;
      for (std::uint8_t& byte : words) byte |= *next++;
    };
    add(a[brick], next_a);
    add(b[brick], next_b);
    const bool mixed = a[brick] == SEEN_MIXED || b[brick] == SEEN_MIXED;
    if (a[brick] == SEEN_ALL || b[brick] == SEEN_ALL ||
        (mixed && std::all_of(words.begin(), words.end(), [](std::uint8_t byte) { return byte == 0xff; })))
      all.add_uniform(SEEN_ALL);
    else if (mixed)
      all.add_words(words);
    else
      all.add_uniform(SEEN_NONE);
  }
  return all.take();
}

}  // namespace frontier_surfels
