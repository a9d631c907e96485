#include "surfel_map.hpp"

#include <algorithm>
#include <cstring>

#include "0_shared.h"

namespace frontier_surfels {
namespace {

std::uint32_t attributes_of(const cl_float4& normal_attributes) {
  std::uint32_t attributes;
  std::memcpy(&attributes, &normal_attributes.s[3], sizeof(attributes));
  return attributes;
}

Surfel to_surfel(const cl_float4& p, const cl_float4& n, std::size_t slot) {
  const std::uint32_t attributes = attributes_of(n);
  Surfel surfel;
  surfel.position = {p.s[0], p.s[1], p.s[2]};
  surfel.radius = p.s[3];
  surfel.normal = {n.s[0], n.s[1], n.s[2]};
  surfel.label = attributes & SURFEL_OCCUPIED ? Label::kOccupied : Label::kFrontier;
  for (int channel = 0; channel < 3; ++channel) surfel.rgb[channel] = static_cast<std::uint8_t>(attributes >> (8 * channel));
  surfel.id = static_cast<std::uint32_t>(slot);
  return surfel;
}

cl_float4 pack_normal(const Surfel& surfel) {
  std::uint32_t attributes = SURFEL_ALIVE;
  if (surfel.label == Label::kOccupied) attributes |= SURFEL_OCCUPIED;
  for (int channel = 0; channel < 3; ++channel) attributes |= static_cast<std::uint32_t>(surfel.rgb[channel]) << (8 * channel);
  if (attributes & 0xffffffu) attributes |= SURFEL_COLORED;
  cl_float4 packed = {{surfel.normal.x(), surfel.normal.y(), surfel.normal.z(), 0}};
  std::memcpy(&packed.s[3], &attributes, sizeof(attributes));
  return packed;
}

void add_to(Changes& changes, std::uint32_t slot, const cl_float4& position, const cl_float4& normal) {
  if (attributes_of(normal) & SURFEL_ALIVE)
    changes.updated.push_back(to_surfel(position, normal, slot));
  else
    changes.removed.push_back(slot);
}

}  // namespace

Changes to_changes(const std::vector<cl_uint>& slots, const std::vector<cl_float4>& positions, const std::vector<cl_float4>& normals) {
  Changes changes;
  for (std::size_t n = 0; n < slots.size(); ++n) add_to(changes, slots[n], positions[n], normals[n]);
  return changes;
}

SurfelMap::SurfelMap(Commands& commands)
    : position_radius_(commands), normal_attributes_(commands), changed_(commands), free_list_(commands) {
  reserve(1 << 16);
}

void SurfelMap::reserve(std::size_t additional) {
  position_radius_.grow(slots_ + additional, slots_);
  normal_attributes_.grow(slots_ + additional, slots_);
  changed_.grow(slots_ + additional, slots_);
  free_list_.grow(slots_ + additional, free_count_);
}

void SurfelMap::added(std::size_t count) {
  const std::size_t reused = std::min(count, free_count_);
  free_count_ -= reused;
  slots_ += count - reused;
}

std::vector<Surfel> SurfelMap::download() const {
  const auto positions = position_radius_.read(slots_), normals = normal_attributes_.read(slots_);
  std::vector<Surfel> surfels;
  surfels.reserve(size());
  for (std::size_t slot = 0; slot < slots_; ++slot)
    if (attributes_of(normals[slot]) & SURFEL_ALIVE) surfels.push_back(to_surfel(positions[slot], normals[slot], slot));
  return surfels;
}

Changes SurfelMap::changes(std::uint64_t since) const {
  const auto positions = position_radius_.read(slots_), normals = normal_attributes_.read(slots_);
  const auto changed = changed_.read(slots_);
  Changes changes;
  for (std::size_t slot = 0; slot < slots_; ++slot)
    if (changed[slot] > since) add_to(changes, static_cast<std::uint32_t>(slot), positions[slot], normals[slot]);
  return changes;
}

void SurfelMap::replace(const std::vector<Surfel>& surfels, std::uint32_t frame) {
  if (surfels.size() > slots_) reserve(surfels.size() - slots_);
  const std::size_t slots = std::max(slots_, surfels.size());
  std::vector<cl_float4> positions(slots), normals(slots);  // zero: not alive
  for (std::size_t slot = 0; slot < surfels.size(); ++slot) {
    const Surfel& surfel = surfels[slot];
    positions[slot] = {{surfel.position.x(), surfel.position.y(), surfel.position.z(), surfel.radius}};
    normals[slot] = pack_normal(surfel);
  }
  std::vector<cl_uint> free_list;  // taken from the end: the lowest slot first
  for (std::size_t slot = slots; slot > surfels.size(); --slot) free_list.push_back(static_cast<cl_uint>(slot - 1));
  position_radius_.write(positions);
  normal_attributes_.write(normals);
  changed_.write(std::vector<cl_uint>(slots, frame));
  free_list_.write(free_list);
  slots_ = slots;
  free_count_ = free_list.size();
}

std::size_t SurfelMap::bytes() const {
  return position_radius_.bytes() + normal_attributes_.bytes() + changed_.bytes() + free_list_.bytes();
}

}  // namespace frontier_surfels
