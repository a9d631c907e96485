/// What is remembered of whole blocks, as bytes: for files, and for the archive.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "frontier_surfels/types.hpp"
#include "map/seen_block.hpp"
#include "map/seen_points.hpp"

namespace frontier_surfels {

void SeenPoints::check(const SeenSpace& seen) {
  int shift = 0;
  while (shift < kMostShift && SEEN_BRICK << shift < seen.points) ++shift;
  if (seen.points != SEEN_BRICK << shift)
    throw FileError("What has been seen has " + std::to_string(seen.points) +
                    " points along a block's edge, which is no power of two from 16 to 256: use another copy of the map.");
  for (const SeenSpace::Block& block : seen.blocks) check_seen_block(block.bytes, std::size_t{1} << (3 * shift));
}

void SeenPoints::load(const SeenSpace& seen) {
  check(seen);
  choose_shift(static_cast<int>(std::lround(std::log2(seen.points / SEEN_BRICK))));
  fixed_ = false;  // if nothing was seen, the next frame may choose another one
  std::vector<SeenBlock> blocks;
  for (const SeenSpace::Block& block : seen.blocks) blocks.push_back({{block.block[0], block.block[1], block.block[2]}, block.bytes});
  add_blocks(blocks);
}

SeenSpace SeenPoints::saved() {
  SeenSpace seen;
  seen.block_size = block_size_;
  seen.points = SEEN_BRICK << shift_;
  const std::vector<BlockKey> blocks = blocks_with_points();
  std::vector<std::vector<std::uint8_t>> bytes = read_blocks(blocks);
  for (std::size_t n = 0; n < blocks.size(); ++n) seen.blocks.push_back({{blocks[n].x, blocks[n].y, blocks[n].z}, std::move(bytes[n])});
  return seen;
}

std::vector<BlockKey> SeenPoints::blocks() const {
  std::vector<BlockKey> blocks;
  for (const auto& [block, table] : table_of_.table()) blocks.push_back(block);
  std::sort(blocks.begin(), blocks.end());
  return blocks;
}

std::vector<BlockKey> SeenPoints::blocks_with_points() const {
  std::vector<BlockKey> blocks;
  for (const auto& [block, table] : table_of_.table())
    if (has_points(table)) blocks.push_back(block);
  std::sort(blocks.begin(), blocks.end());
  return blocks;
}

std::vector<std::vector<std::uint8_t>> SeenPoints::read_blocks(const std::vector<BlockKey>& blocks) {
  send_entries("changes");
  const int bricks = bricks_of_block();
  std::vector<std::vector<std::uint8_t>> stored(blocks.size());
  std::vector<cl_int> mixed;
  for (std::size_t n = 0; n < blocks.size(); ++n) {
    const int* table = table_of_.find(blocks[n]);
    if (table == nullptr) continue;
    bool any = false;
    for (int brick = 0; brick < bricks; ++brick) {
      const cl_int number = entry(*table, brick);
      any = any || number != SEEN_BRICK_EMPTY;
      stored[n].push_back(number == SEEN_BRICK_EMPTY ? SEEN_NONE : number == SEEN_BRICK_FULL ? SEEN_ALL : SEEN_MIXED);
      if (number > SEEN_BRICK_FULL) mixed.push_back(number);
    }
    if (!any) stored[n].clear();
  }
  if (mixed.empty()) return stored;
  const std::size_t words = SEEN_WORDS * mixed.size();
  const auto count = static_cast<cl_int>(mixed.size());
  gathered_.resize(words);
  gathered_list_.send(std::move(mixed));
  commands_.run("changes", "gather_bricks", words, kGroup, gathered_list_(), count, bricks_(), gathered_());
  const std::vector<cl_ulong> gathered = gathered_.read(words);
  const auto* next = reinterpret_cast<const std::uint8_t*>(gathered.data());
  for (std::vector<std::uint8_t>& bytes : stored) {
    const std::size_t own = kBrickBytes * static_cast<std::size_t>(std::count(bytes.begin(), bytes.end(), SEEN_MIXED));
    bytes.insert(bytes.end(), next, next + own);
    next += own;
  }
  return stored;
}

void SeenPoints::add_blocks(const std::vector<SeenBlock>& blocks) {
  const auto bricks = static_cast<std::size_t>(bricks_of_block());
  std::vector<cl_ulong> words;
  for (const auto& [block, bytes] : blocks) {
    check_seen_block(bytes, bricks);
    if (bytes.size() <= bricks) continue;
    const std::size_t before = words.size();
    words.resize(before + (bytes.size() - bricks) / sizeof(cl_ulong));
    std::memcpy(&words[before], &bytes[bricks], bytes.size() - bricks);
  }
  send_entries("changes");
  const std::vector<cl_int> numbers = take_bricks(words.size() / SEEN_WORDS);
  try {
    scatter(numbers, words);
  } catch (...) {
    give_back(numbers);
    throw;
  }
  auto next = numbers.begin();  // nothing can fail from here on
  for (const auto& [block, bytes] : blocks) {
    drop_block(block);
    if (bytes.empty()) continue;
    const int own = table(block);
    for (std::size_t brick = 0; brick < bricks; ++brick) {
      if (bytes[brick] == SEEN_ALL) set_uniform(own, static_cast<int>(brick), true);
      if (bytes[brick] == SEEN_MIXED) set_entry(own, static_cast<int>(brick), *next++);
    }
  }
}

/// Writes the words of bricks that no entry has yet.
void SeenPoints::scatter(std::vector<cl_int> numbers, const std::vector<cl_ulong>& words) {
  if (numbers.empty()) return;
  const auto count = static_cast<cl_int>(numbers.size());
  bricks_.grow(SEEN_WORDS * used_, bricks_.size());
  gathered_.write(words);
  gathered_list_.send(std::move(numbers));
  commands_.run("changes", "scatter_bricks", words.size(), kGroup, gathered_list_(), count, gathered_(), bricks_());
}

/// The change of the tables waits for the next send_entries(): until then no table sent by open_window() has the block.
void SeenPoints::drop_block(const BlockKey& block) {
  const int* found = table_of_.find(block);
  if (found == nullptr) return;
  const int table = *found;
  for (int brick = 0; brick < bricks_of_block(); ++brick) {
    const cl_int number = entry(table, brick);
    if (number == SEEN_BRICK_EMPTY) continue;
    if (number > SEEN_BRICK_FULL) free_.push_back(number);
    set_entry(table, brick, SEEN_BRICK_EMPTY);
  }
  free_tables_.push_back(table);
  table_of_.erase(block);
}

}  // namespace frontier_surfels
