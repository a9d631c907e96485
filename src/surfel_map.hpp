/// The map: surfels in slots of device buffers. A surfel's slot is its id.
#pragma once

#include <cstdint>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "opencl/commands.hpp"

namespace frontier_surfels {

/// Surfels of slots: those alive are updated, the others removed.
Changes to_changes(const std::vector<cl_uint>& slots, const std::vector<cl_float4>& positions, const std::vector<cl_float4>& normals);

class SurfelMap {
 public:
  explicit SurfelMap(Commands& commands);

  std::size_t slots() const { return slots_; }            ///< used or free
  std::size_t free_slots() const { return free_count_; }  ///< of them free
  std::size_t size() const { return slots_ - free_count_; }

  /// Makes room for `additional` more surfels and as many free slots.
  void reserve(std::size_t additional);

  /// Accounts for `count` surfels that a kernel has put into new_slot(0 ... count - 1).
  void added(std::size_t count);

  /// Accounts for `count` slots that a kernel has put behind the free ones.
  void removed(std::size_t count) { free_count_ += count; }

  /// All surfels by slot, those not alive left out.
  std::vector<Surfel> download() const;

  /// Surfels changed after frame `since`, and slots that were freed.
  Changes changes(std::uint64_t since) const;

  /// Replaces everything: surfel n goes to slot n, changed in `frame`; what was there is noted as changed as well.
  void replace(const std::vector<Surfel>& surfels, std::uint32_t frame);

  std::size_t bytes() const;

  const cl::Buffer& position_radius() const { return position_radius_(); }
  const cl::Buffer& normal_attributes() const { return normal_attributes_(); }
  const cl::Buffer& changed() const { return changed_(); }
  const cl::Buffer& free_list() const { return free_list_(); }

 private:
  std::size_t slots_ = 0;
  std::size_t free_count_ = 0;
  DeviceArray<cl_float4> position_radius_;
  DeviceArray<cl_float4> normal_attributes_;
  DeviceArray<cl_uint> changed_;
  DeviceArray<cl_uint> free_list_;
};

}  // namespace frontier_surfels
