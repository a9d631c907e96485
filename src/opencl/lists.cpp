#include "opencl/lists.hpp"

#include <string>

#include "common/shared.h"

namespace frontier_surfels {
namespace {

constexpr std::size_t kGroup = 64;
constexpr std::size_t kInitialRoom = 1 << 14;  // elements of a list
constexpr std::size_t kLeastRoom = 1 << 14;    // elements of a list for which kernels are launched unseen

/// @throws BadFrame  a list would be longer than Lists::kMaxTotal
void refuse_too_many(const char* stage, std::uint32_t total) {
  if (total > Lists::kMaxTotal)
    throw BadFrame(std::string("The stage ") + stage + " would make a list of more than " + std::to_string(Lists::kMaxTotal) +
                   " entries for this frame, because its voxels are too small for the surfels of the map; raise decimation.");
}

}  // namespace

Lists::Lists(Commands& commands)
    : commands_(commands),
      counts_(commands),
      length_(commands),
      levels_{DeviceArray<cl_uint>(commands), DeviceArray<cl_uint>(commands), DeviceArray<cl_uint>(commands),
              DeviceArray<cl_uint>(commands), DeviceArray<cl_uint>(commands)} {}

std::uint32_t Lists::scan(const char* stage, DeviceArray<cl_uint>& values, std::size_t count) {
  if (count == 0) return 0;
  prefix_sums(stage, values, count);
  const std::uint32_t total = values.read_one(count);
  refuse_too_many(stage, total);
  return total;
}

void Lists::scan_level(const char* stage, DeviceArray<cl_uint>& values, std::size_t count, std::size_t level) {
  const auto n = static_cast<cl_uint>(count);
  const WorkShape& shape = commands_.shape();
  if (count <= shape.scan_alone) return commands_.run(stage, "scan_few", 1, 1, values(), n);
  if (count <= shape.scan_by_group) return commands_.run(stage, "scan_by_group", shape.scan_group, shape.scan_group, values(), n);
  DeviceArray<cl_uint>& sums = levels_[level];
  const std::size_t chunks = (count + SCAN_CHUNK - 1) / SCAN_CHUNK;
  sums.resize(chunks + 1);
  commands_.run(stage, "sum_chunks", chunks, kGroup, values(), n, sums());
  scan_level(stage, sums, chunks, level + 1);
  commands_.run(stage, "scan_chunks", chunks, kGroup, values(), n, sums());
}

std::uint32_t Lists::list_bits(const char* stage, const DeviceArray<cl_ulong>& bits, std::size_t count, DeviceArray<cl_uint>& list) {
  return list_all(stage, bits, count, list, length_);
}

void Lists::list_bits(const char* stage, const DeviceArray<cl_ulong>& bits, std::size_t count, DeviceList& list) {
  list.told_ = nullptr;
  if (commands_.shape().is_near) {
    const std::uint32_t total = list_all(stage, bits, count, list.entries_, list.length_);
    list.room_ = total;
    list.told_ = std::make_shared<const std::vector<cl_uint>>(2, total);
    return;
  }
  list.room_ = std::max(list.next_room_, kLeastRoom);
  list.entries_.resize(list.room_);
  list.length_.resize(2);
  if (count > 0) return list_into(stage, bits, count, list.entries_, list.room_, list.length_);
  list.length_.fill(stage, 0, 2);
}

/// Lists into the room that the list has from earlier calls. If that is too small, enlarges it and lists again.
std::uint32_t Lists::list_all(const char* stage, const DeviceArray<cl_ulong>& bits, std::size_t count, DeviceArray<cl_uint>& list,
                              DeviceArray<cl_uint>& length) {
  list.resize(kInitialRoom);
  length.resize(2);
  if (count == 0) {
    length.fill(stage, 0, 2);
    return 0;
  }
  for (;;) {
    list_into(stage, bits, count, list, list.size(), length);
    const std::uint32_t total = length.read_one(1);
    if (total <= list.size()) return total;
    refuse_too_many(stage, total);
    list.resize(total);
  }
}

void Lists::list_into(const char* stage, const DeviceArray<cl_ulong>& bits, std::size_t count, const DeviceArray<cl_uint>& list,
                      std::size_t room, const DeviceArray<cl_uint>& length) {
  const auto words = static_cast<cl_uint>(count), size = static_cast<cl_uint>(commands_.shape().list_chunk),
             most = static_cast<cl_uint>(room);
  if (count <= commands_.shape().list_alone) return commands_.run(stage, "list_few_bits", 1, 1, bits(), words, list(), most, length());
  const std::size_t chunks = (count + size - 1) / size;
  counts_.resize(chunks + 1);
  commands_.run(stage, "count_bits", chunks, kGroup, bits(), words, size, counts_());
  prefix_sums(stage, counts_, chunks);
  commands_.run(stage, "list_bits", chunks, kGroup, bits(), words, size, counts_(), list(), most, length());
}

}  // namespace frontier_surfels
