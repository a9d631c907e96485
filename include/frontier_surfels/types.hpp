/// The data that goes into a Mapper and comes out of it. No ROS, no OpenCL: std and Eigen only.
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

/// Base of everything this library throws. what() is one sentence: what is wrong and what to do.
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

/// A view of somebody's depth image, depth[height][step / size]: distance along the optical axis. Not owned.
struct DepthImage {
  enum class Encoding {
    kMillimetresU16,  ///< 16UC1, mono16: 0 = no measurement
    kMetresF32,       ///< 32FC1: 0, NaN = no measurement, +Inf = nothing up to the maximum range (REP 118)
  };
  int width = 0;
  int height = 0;
  std::size_t step = 0;  ///< [byte] from one row to the next
  Encoding encoding = Encoding::kMillimetresU16;
  const void* data = nullptr;
  bool swap_bytes = false;  ///< the data's endianness is not this machine's
};

/// A view of somebody's colour image, registered to the depth image: same size, 8 bits a channel. Not owned.
struct ColorImage {
  enum class Order { kRgb, kBgr };
  int width = 0;
  int height = 0;
  std::size_t step = 0;  ///< [byte] from one row to the next
  Order order = Order::kRgb;
  int channels = 3;  ///< [byte] a pixel: 3, or 4 with an unused last one
  const std::uint8_t* data = nullptr;
};

/// All that Mapper::integrate needs to know of a frame. Only viewed: the images must outlive the call.
struct DepthFrame {
  double stamp = 0;  ///< [s]
  DepthImage depth;
  Intrinsics intrinsics;                                                                          ///< of `depth`, rectified
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d(Eigen::Matrix4d::Constant(std::nan("")));  ///< optical frame
  std::optional<ColorImage> color;
};

enum class Label : std::uint8_t {
  kFrontier = 0,  ///< empty space ends at the unknown
  kOccupied = 1,  ///< empty space ends at a measured surface
};

/// An oriented disc of the boundary of known space.
struct Surfel {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< centre, world frame [m]
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();   ///< unit, points INTO known space, world frame
  float radius = 0;                                    ///< [m]
  Label label = Label::kFrontier;
  std::array<std::uint8_t, 3> rgb = {0, 0, 0};  ///< (0, 0, 0) when no colour was seen
  std::uint32_t id = 0;                         ///< stays with the surfel; used again only after its removal was told
};

/// Where a surfel is asked whether it is right, in radii from its centre: space should be unknown kBackProbe behind it, against the normal,
/// and known kFrontProbe before it. The mapper makes new surfels so that they are; the exact test of the scores asks.
constexpr double kBackProbe = 0.25;
constexpr double kFrontProbe = 1.75;

/// Difference between the map after frame `since` and now.
struct Changes {
  std::uint64_t sequence = 0;          ///< number of the last frame (or reset, load) contained
  std::vector<Surfel> updated;         ///< new or changed surfels
  std::vector<std::uint32_t> removed;  ///< ids that are no longer in the map
};

/// Wall or device time of one stage of the pipeline.
struct StageTime {
  std::string name;
  double ms = 0;
};

/// What integrate() did.
struct Report {
  double stamp = 0;            ///< [s] of the frame
  std::uint64_t sequence = 0;  ///< of the map after the frame; every frame, reset and load counts one up
  std::size_t surfels = 0;     ///< in the map after the frame
  std::size_t in_view = 0;     ///< surfels that touched the view's grid
  std::size_t created = 0;
  std::size_t removed = 0;
  std::size_t split = 0;      ///< surfels that splitting has added: surfels = those before + split + created - removed
  std::size_t map_bytes = 0;  ///< of all that holds surfels or says where they are; pages that are free again included, and on devices with
                              ///< memory of their own the spare capacity
  std::size_t device_bytes = 0;   ///< all buffers on the device, the map's included; without what a CPU's system has not given yet
  bool view_kept = false;         ///< the frame entered the recent views
  double total_ms = 0;            ///< wall time of integrate()
  std::vector<StageTime> stages;  ///< in the order in which they run; device time by OpenCL events
};

/// Size of the map and of the memory around it.
struct Statistics {
  std::size_t surfels = 0;
  std::size_t occupied = 0;
  std::size_t frontier = 0;
  std::size_t map_bytes = 0;  ///< of all that holds surfels or says where they are; pages that are free again included, and on devices with
                              ///< memory of their own the spare capacity
  std::size_t device_bytes = 0;  ///< all buffers on the device, the map's included; without what a CPU's system has not given yet
};

}  // namespace frontier_surfels
