#include "storage/stored_block.hpp"

#include <cstring>
#include <limits>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kBytesOfSurfel = 16;  // packed, see surfel_packing.hpp
constexpr std::int32_t kViews = std::numeric_limits<std::int32_t>::min();

}  // namespace

std::vector<std::uint8_t> join(const StoredParts& parts) {
  if (parts.surfels.empty() && parts.seen.empty()) return {};
  const std::uint32_t head[] = {static_cast<std::uint32_t>(parts.shift), static_cast<std::uint32_t>(parts.surfels.size())};
  std::vector<std::uint8_t> bytes(sizeof head);
  std::memcpy(bytes.data(), head, sizeof head);
  bytes.insert(bytes.end(), parts.surfels.begin(), parts.surfels.end());
  bytes.insert(bytes.end(), parts.seen.begin(), parts.seen.end());
  return bytes;
}

std::size_t surfels_of(const std::uint8_t* bytes, std::size_t count) {
  std::uint32_t head[2] = {0, 0};
  static_assert(sizeof head == kStoredHead);
  if (count >= sizeof head) std::memcpy(head, bytes, sizeof head);
  return head[1] / kBytesOfSurfel;
}

StoredParts parts_of(const std::vector<std::uint8_t>& bytes) {
  if (bytes.empty()) return {};
  std::uint32_t head[2] = {0, 0};
  if (bytes.size() >= sizeof head) std::memcpy(head, bytes.data(), sizeof head);
  if (bytes.size() < sizeof head || bytes.size() - sizeof head < head[1])
    throw FileError("A block in the map folder is incomplete: the folder is damaged; use a backup or another folder.");
  const auto surfels = bytes.begin() + sizeof head, seen = surfels + static_cast<std::ptrdiff_t>(head[1]);
  return {static_cast<int>(head[0]), {surfels, seen}, {seen, bytes.end()}};
}

BlockKey view_key(std::uint64_t number) {
  return {kViews, static_cast<std::int32_t>(number >> 31), static_cast<std::int32_t>(number & 0x7fffffff)};
}

bool is_view(const BlockKey& key) { return key.x == kViews; }

std::uint64_t number_of(const BlockKey& key) { return static_cast<std::uint64_t>(key.y) << 31 | static_cast<std::uint64_t>(key.z); }

}  // namespace frontier_surfels
