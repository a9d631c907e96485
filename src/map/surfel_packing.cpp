#include "map/surfel_packing.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "common/shared.h"

namespace frontier_surfels {
namespace {

constexpr double kSteps = 65536;  // steps of a coordinate across a block
constexpr float kNormal = 32767;  // steps of a normal's octahedral coordinate from 0 to 1

std::uint32_t pack_coordinate(float position, std::int32_t block, double block_size) {
  return static_cast<std::uint32_t>(std::clamp((position / block_size - block) * kSteps, 0.0, kSteps - 1));
}

float unpack_coordinate(std::uint32_t steps, std::int32_t block, double block_size) {
  return static_cast<float>((block + (steps + 0.5) / kSteps) * block_size);
}

/// Octahedral coordinate p of a normal in the lower half space, folded outwards.
float fold(float p, float q) { return p < 0 ? std::abs(q) - 1 : 1 - std::abs(q); }

std::uint32_t pack_normal(const Eigen::Vector3f& normal) {
  const Eigen::Vector2f p = normal.head<2>() / normal.lpNorm<1>();
  const Eigen::Vector2f folded = normal.z() < 0 ? Eigen::Vector2f(fold(p.x(), p.y()), fold(p.y(), p.x())) : p;
  const auto steps = [](float x) { return static_cast<std::uint16_t>(static_cast<std::int16_t>(std::lround(kNormal * x))); };
  return steps(folded.x()) | static_cast<std::uint32_t>(steps(folded.y())) << 16;
}

Eigen::Vector3f unpack_normal(std::uint32_t bits) {
  const auto coordinate = [](std::uint32_t steps) { return static_cast<float>(static_cast<std::int16_t>(steps & 0xffff)); };
  Eigen::Vector3f n(coordinate(bits), coordinate(bits >> 16), 0);  // whole numbers, exact until normalized()
  n.z() = kNormal - std::abs(n.x()) - std::abs(n.y());
  const float over = std::max(-n.z(), 0.0F);
  n.x() -= std::copysign(over, n.x());  // a branch on the sign would be guessed wrongly every other time
  n.y() -= std::copysign(over, n.y());
  const Eigen::Array4f padded(n.x(), n.y(), n.z(), 0);  // divided all at once
  return (padded / n.norm()).head<3>();
}

/// Calls of public functions within a shared library go through a table; this one is inlined.
inline Surfel unpack_inline(const cl_uint4& packed, const BlockKey& block, double block_size) {
  const auto& [x, y, normal, attributes] = packed.s;
  Surfel surfel;
  surfel.position = {unpack_coordinate(x & 0xffff, block.x, block_size), unpack_coordinate(x >> 16, block.y, block_size),
                     unpack_coordinate(y & 0xffff, block.z, block_size)};
  surfel.radius = static_cast<float>(Eigen::numext::bit_cast<Eigen::half>(static_cast<std::uint16_t>(y >> 16)));
  surfel.normal = unpack_normal(normal);
  surfel.label = attributes & SURFEL_OCCUPIED ? Label::kOccupied : Label::kFrontier;
  for (int channel = 0; channel < 3; ++channel) surfel.rgb[channel] = static_cast<std::uint8_t>(attributes >> (8 * channel));
  return surfel;
}

inline void unpack_entry(const cl_uint4& packed, const ListedPages& pages, cl_uint entry, double block_size, std::vector<Surfel>& to) {
  const auto& block = pages.blocks[entry / PAGE_SLOTS].s;
  to.push_back(unpack_inline(packed, {block[0], block[1], block[2]}, block_size));
  to.back().id = pages.slot(entry);
}

}  // namespace

BlockKey block_of(const Eigen::Vector3f& position, double block_size) {
  const Eigen::Vector3d blocks = (position.cast<double>() / block_size).array().floor();
  return {static_cast<std::int32_t>(blocks.x()), static_cast<std::int32_t>(blocks.y()), static_cast<std::int32_t>(blocks.z())};
}

cl_uint4 pack(const Surfel& surfel, const BlockKey& block, double block_size) {
  const Eigen::half radius(std::clamp(surfel.radius, 6.2e-5F, 65000.0F));
  std::uint32_t attributes = surfel.label == Label::kOccupied ? SURFEL_OCCUPIED : 0;
  for (int channel = 0; channel < 3; ++channel) attributes |= static_cast<std::uint32_t>(surfel.rgb[channel]) << (8 * channel);
  if (attributes & 0xffffffu) attributes |= SURFEL_COLORED;
  return {{pack_coordinate(surfel.position.x(), block.x, block_size) | pack_coordinate(surfel.position.y(), block.y, block_size) << 16,
           pack_coordinate(surfel.position.z(), block.z, block_size) | static_cast<std::uint32_t>(radius.x) << 16,
           pack_normal(surfel.normal), attributes}};
}

Surfel unpack(const cl_uint4& packed, const BlockKey& block, double block_size) { return unpack_inline(packed, block, block_size); }

void unpack_gathered(const std::vector<cl_uint4>& packed, const ListedPages& pages, const cl_uint* entries, double block_size,
                     std::vector<Surfel>& to) {
  for (std::size_t n = 0; n < packed.size(); ++n) unpack_entry(packed[n], pages, entries[n], block_size, to);
}

void unpack_entries(const cl_uint4* surfels, const ListedPages& pages, const std::vector<cl_uint>& entries, double block_size,
                    std::vector<Surfel>& to) {
  for (const cl_uint entry : entries) unpack_entry(surfels[pages.slot(entry)], pages, entry, block_size, to);
}

std::vector<cl_uint4> to_surfels(const std::vector<std::uint8_t>& bytes) {
  if (bytes.size() % sizeof(cl_uint4) != 0)
    throw FileError("A block in the map folder is incomplete: the folder is damaged; use a backup or another folder.");
  std::vector<cl_uint4> surfels(bytes.size() / sizeof(cl_uint4));
  if (!bytes.empty()) std::memcpy(surfels.data(), bytes.data(), bytes.size());
  return surfels;
}

std::vector<Surfel> unpack_block(const std::vector<std::uint8_t>& bytes, const BlockKey& block, double block_size) {
  std::vector<Surfel> surfels;
  for (const cl_uint4& packed : to_surfels(bytes)) surfels.push_back(unpack(packed, block, block_size));
  return surfels;
}

}  // namespace frontier_surfels
