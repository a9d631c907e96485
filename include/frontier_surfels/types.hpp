/// Input and output of a Mapper. Needs only the standard library and Eigen, no ROS and no OpenCL.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace frontier_surfels {

/// Base of all errors that this library throws. what() is one sentence: what is wrong and what to do.
struct Error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The frame was refused; the map is as it was before the call.
struct BadFrame : Error {
  using Error::Error;
};

/// A file could not be read or written; the map is as it was before the call.
struct FileError : Error {
  using Error::Error;
};

/// The OpenCL device is missing, too small, or failed.
struct DeviceError : Error {
  using Error::Error;
};

/// Pinhole camera of an image of width x height pixels; pixel centres are at whole numbers.
struct Intrinsics {
  double fx = 0;  ///< [pixel]
  double fy = 0;  ///< [pixel]
  double cx = 0;  ///< [pixel]
  double cy = 0;  ///< [pixel]
  int width = 0;
  int height = 0;
};

/// A view of a depth image, depth[height][step / pixel size]: distance along the optical axis. Does not own the data.
struct DepthImage {
  enum class Encoding {
    kStepsU16,   ///< 16UC1, mono16, in steps of Config::depth_unit, by default [mm]: 0, 65535 = no measurement
    kMetresF32,  ///< 32FC1: 0, NaN = no measurement, +Inf = no surface within the sensor's range (REP 118)
  };
  int width = 0;
  int height = 0;
  std::size_t step = 0;  ///< [byte] from one row to the next
  Encoding encoding = Encoding::kStepsU16;
  const void* data = nullptr;
  bool swap_bytes = false;  ///< the data's endianness is not this machine's
};

/// A view of a colour image that is registered to the depth image: same size, 8 bits per channel. Does not own the data.
struct ColorImage {
  enum class Order { kRgb, kBgr };
  int width = 0;
  int height = 0;
  std::size_t step = 0;  ///< [byte] from one row to the next
  Order order = Order::kRgb;
  int channels = 3;  ///< bytes per pixel: 3, or 4 with an unused last one
  const std::uint8_t* data = nullptr;
};

/// Input of Mapper::integrate. Does not own the images; they must outlive the call.
struct DepthFrame {
  double stamp = 0;  ///< [s]
  DepthImage depth;
  Intrinsics intrinsics;                                                                          ///< of the rectified depth image
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d(Eigen::Matrix4d::Constant(std::nan("")));  ///< pose of the optical frame
  std::optional<ColorImage> color;
};

enum class Label : std::uint8_t {
  kFrontier = 0,  ///< empty space ends at the unknown
  kOccupied = 1,  ///< empty space ends at a measured surface
};

/// An oriented disc on the boundary of known space.
struct Surfel {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< centre, world frame [m]
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();   ///< unit, points INTO known space, world frame
  float radius = 0;                                    ///< [m]
  Label label = Label::kFrontier;
  std::array<std::uint8_t, 3> rgb = {0, 0, 0};  ///< (0, 0, 0) when no colour was seen
  std::uint32_t id = 0;                         ///< never changes; given to another surfel only after this one's removal was reported
};

/// Points that decide whether a surfel is right, as distances from its centre in radii: space should be unknown kBackProbe behind it,
/// against the normal, and known kFrontProbe in front of it. The mapper places new surfels so that this holds; the exact test of the scores
/// checks it.
constexpr double kBackProbe = 0.25;
constexpr double kFrontProbe = 1.75;

/// Radius of a new surfel, half the diagonal of its voxel [voxel]: sqrt(3) / 2.
constexpr double kNewRadius = 0.86602540378443865;

/// Difference between the map at an earlier sequence number and the map now: first remove, then update.
struct Changes {
  std::uint64_t sequence = 0;          ///< number of the map now
  std::vector<Surfel> updated;         ///< new or changed surfels
  std::vector<std::uint32_t> removed;  ///< ids of surfels that are gone; Mapper::changes() never updates one of them as well
  std::uint64_t since = 0;             ///< number of the earlier map; 0: this is the whole map, forget everything else
};

/// What has been seen of the world, as it is saved with a map: a lattice of points, with a bit for each. Blocks are cubes of block_size
/// [m], block (x, y, z) with its lowest corner at (x, y, z) block_size. A brick is a cube of 16^3 points.
struct SeenSpace {
  struct Block {
    std::array<std::int32_t, 3> block = {0, 0, 0};  ///< x, y, z
    /// A byte for each brick, x running fastest: 0 no point of it is seen, 1 some are, 2 all are. Then, for each brick of some, 64 words of
    /// 64 bits (little endian) for cubes of 4^3 points, again with x running fastest, also within a word. None: no point is seen.
    std::vector<std::uint8_t> bytes;
  };
  double block_size = 0;  ///< [m]
  int points = 0;         ///< along each edge of a block, a power of two from 16 to 256; 0: what has been seen is not known
  std::vector<Block> blocks;
};

/// A kept view, as it is saved with a map.
struct SavedView {
  Intrinsics intrinsics;                                             ///< of the working image
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();  ///< pose of the optical frame
  double depth_step = 0;                                             ///< [m]
  std::vector<std::uint16_t> depth;                                  ///< [height][width], in steps; 0: no measurement
};

/// A whole map, as files keep it.
struct SavedMap {
  std::vector<Surfel> surfels;
  SeenSpace seen;                ///< what forgotten views have seen: those that are not kept
  std::vector<SavedView> views;  ///< the kept ones, oldest first
};

/// Wall or device time of one stage of the pipeline.
struct StageTime {
  std::string name;
  double ms = 0;
};

/// Result of integrate().
struct Report {
  double stamp = 0;                                                  ///< of the frame [s]
  std::uint64_t sequence = 0;                                        ///< of the map after the frame; every frame, reset and load adds one
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();  ///< pose with which the frame was mapped: Config::correct_poses
  std::size_t surfels = 0;                                           ///< in the map after the frame
  std::size_t in_view = 0;                                           ///< surfels that touched the view's grid
  std::size_t measured_pixels = 0;                                   ///< of the working image: they measure a surface, or free space
  std::size_t taken_back = 0;  ///< of these pixels: their surface stood in known space, and space behind it became unknown again
  std::size_t created = 0;
  std::size_t removed = 0;
  std::size_t split = 0;      ///< surfels added by splitting; surfels = surfels before + split + created - removed
  std::size_t map_bytes = 0;  ///< memory of the surfels and of their index, with free pages, and with spare capacity on devices that have
                              ///< memory of their own
  std::size_t device_bytes = 0;   ///< all buffers on the device, with the map's; without memory that a CPU's system has not provided yet
  std::size_t seen_bytes = 0;     ///< seen points: memory of what forgotten views have seen [byte]
  bool view_kept = false;         ///< the frame entered the recent views
  double total_ms = 0;            ///< wall time of integrate()
  std::vector<StageTime> stages;  ///< device time of each stage, in running order; empty if they were not timed: stage_times_every
};

/// Size of the map and of the memory around it.
struct Statistics {
  std::size_t surfels = 0;
  std::size_t occupied = 0;
  std::size_t frontier = 0;
  std::size_t map_bytes = 0;     ///< see Report
  std::size_t seen_bytes = 0;    ///< see Report
  std::size_t device_bytes = 0;  ///< see Report
};

}  // namespace frontier_surfels
