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
  /// @throws FileError    config.map_folder cannot be made, read or written, is in use by another mapper, or is of another block size
  explicit Mapper(const Config& config = {});
  ~Mapper();
  Mapper(Mapper&&) noexcept;
  Mapper& operator=(Mapper&&) noexcept;

  /// Psi_n -> Psi_(n+1): one pass of the paper's flow chart.
  /// With a map_folder, the map near the camera is brought into memory first, and what is far leaves it.
  /// @throws BadFrame     the frame is unusable; nothing has changed
  /// @throws FileError    the map folder cannot be read here, or could not be written lately: the frame is refused, nothing is lost, and
  ///                      the next one may come; changes() tells of parts of the map that have come into memory, or left it, nevertheless
  /// @throws DeviceError  the device failed or is out of memory
  Report integrate(const DepthFrame& frame);

  /// All surfels, ordered by id. With a map_folder: those in memory, near the camera; none before the first frame.
  std::vector<Surfel> surfels() const;

  /// The surfels whose centre lies in a box of the world frame [m].
  std::vector<Surfel> surfels(const Eigen::AlignedBox3f& box_world) const;

  /// What has changed since the map had sequence number `since` (0: everything): the last frame's changes exactly, earlier ones with some
  /// surfels around that have not changed, and ids that were free already. Surfels that go to the map folder are removed, and updated with
  /// new ids when they come back.
  Changes changes(std::uint64_t since) const;

  /// Writes the map as a PLY or PCD file, whichever the path ends in (map_file.hpp), to a temporary file first that is then renamed. With a
  /// map_folder all of it, which must fit into memory for that moment. @throws FileError
  void save(const std::string& path) const;

  /// Replaces the map by a saved one, and forgets what is not in the file: the recent views, and which surfels stand in thin space (the
  /// method then trusts those a little more). With a map_folder, the map in it is replaced, too. @throws FileError: the map stays as it was
  void load(const std::string& path);

  /// The same from memory; ids are given anew. Surfels far larger than any that this mapper makes (of 2 m, where z_max is up to 12 m)
  /// become so small.
  void load(const std::vector<Surfel>& surfels);

  /// Forgets everything but the configuration and the sequence number, the map in the map folder included.
  void reset();

  Statistics statistics() const;
  std::size_t size() const;  ///< surfels in the map; with a map_folder, in memory
  std::uint64_t sequence() const;
  const Config& config() const;

  /// Platform, name and compute units of the device in use, for people.
  std::string device() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace frontier_surfels
