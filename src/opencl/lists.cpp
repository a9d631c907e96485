#include "opencl/lists.hpp"

#include <string>

#include "common/shared.h"

namespace frontier_surfels {
namespace {

constexpr std::size_t kGroup = 64;
constexpr std::size_t kInitialRoom = 1 << 14;  // elements of a list

}  // namespace

Lists::Lists(Commands& commands)
    : commands_(commands),
      counts_(commands),
      levels_{DeviceArray<cl_uint>(commands), DeviceArray<cl_uint>(commands), DeviceArray<cl_uint>(commands),
              DeviceArray<cl_uint>(commands), DeviceArray<cl_uint>(commands)} {}

std::uint32_t Lists::scan(const char* stage, DeviceArray<cl_uint>& values, std::size_t count) {
  if (count == 0) return 0;
  prefix_sums(stage, values, count);
  const std::uint32_t total = values.read_one(count);
  if (total > kMaxTotal)
    throw BadFrame(std::string("The stage ") + stage + " would make a list of more than " + std::to_string(kMaxTotal) +
                   " entries for this frame, because its voxels are too small for the surfels of the map; raise decimation.");
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
  if (count == 0) return 0;
  const auto words = static_cast<cl_uint>(count), size = static_cast<cl_uint>(commands_.shape().list_chunk);
  const std::size_t chunks = (count + size - 1) / size;
  if (count <= commands_.shape().list_alone) return list_few_bits(stage, bits, words, list);
  counts_.resize(chunks + 1);
  commands_.run(stage, "count_bits", chunks, kGroup, bits(), words, size, counts_());
  const std::uint32_t total = scan(stage, counts_, chunks);
  list.resize(total);
  if (total > 0) commands_.run(stage, "list_bits", chunks, kGroup, bits(), words, size, counts_(), list());
  return total;
}

/// Lists into the room that the list has from earlier calls. If that is too small, enlarges it and lists again.
std::uint32_t Lists::list_few_bits(const char* stage, const DeviceArray<cl_ulong>& bits, cl_uint words, DeviceArray<cl_uint>& list) {
  list.resize(kInitialRoom);
  counts_.resize(1);
  for (;;) {
    const std::size_t room = list.bytes() / sizeof(cl_uint);
    commands_.run(stage, "list_few_bits", 1, 1, bits(), words, list(), static_cast<cl_uint>(room), counts_());
    const std::uint32_t total = counts_.read_one(0);
    if (total <= room) return total;
    list.resize(total);
  }
}

}  // namespace frontier_surfels
