/// Open first: the whole library in one class.
///
/// A Mapper keeps a cloud of surfels that encloses all space its depth camera has seen (Monica & Aleotti, "Surfel-Based
/// Incremental Reconstruction of the Boundary between Known and Unknown Space", IEEE TVCG 2020).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

class Mapper {
 public:
  /// Chooses the device and builds all kernels.
  /// @throws Error        config.problems() is not empty: all of them
  /// @throws DeviceError  no device fits (with a list of those there are), or the kernels do not build
  explicit Mapper(const Config& config = {});
  ~Mapper();
  Mapper(Mapper&&) noexcept;
  Mapper& operator=(Mapper&&) noexcept;

  /// Psi_n -> Psi_(n+1): one pass of the paper's flow chart.
  /// @throws BadFrame     the frame is unusable; nothing has changed
  /// @throws DeviceError  the device failed or is out of memory
  Report integrate(const DepthFrame& frame);

  /// All surfels, ordered by id.
  std::vector<Surfel> surfels() const;

  /// The surfels whose centre lies in a box of the world frame [m].
  std::vector<Surfel> surfels(const Eigen::AlignedBox3f& box_world) const;

  /// What has changed since the map had sequence number `since` (0: everything): the last frame's changes exactly, earlier ones with some
  /// surfels around that have not changed, and ids that were free already.
  Changes changes(std::uint64_t since) const;

  /// Writes the map as a PLY file, to a temporary file first that is then renamed. @throws FileError
  void save(const std::string& path) const;

  /// Replaces the map by a saved one, and forgets what is not in the file: the recent views, and which surfels stand in thin space (the
  /// method then trusts those a little more). @throws FileError: the map stays as it was
  void load(const std::string& path);

  /// The same from memory; ids are given anew. Surfels far larger than any that this mapper makes (of 2 m, where z_max is up to 12 m)
  /// become so small.
  void load(const std::vector<Surfel>& surfels);

  /// Forgets everything but the configuration and the sequence number.
  void reset();

  Statistics statistics() const;
  std::size_t size() const;  ///< surfels in the map
  std::uint64_t sequence() const;
  const Config& config() const;

  /// Platform, name and compute units of the device in use, for people.
  std::string device() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace frontier_surfels
