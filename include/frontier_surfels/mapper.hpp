/// Read this first: the whole library in one class.
///
/// A Mapper keeps a cloud of surfels that encloses all space its depth camera has seen (Monica & Aleotti, "Surfel-Based
/// Incremental Reconstruction of the Boundary between Known and Unknown Space", IEEE TVCG 2020).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/planner/state_grid.hpp"
#include "frontier_surfels/planner/states.hpp"
#include "frontier_surfels/planner/views.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

class Mapper {
 public:
  /// Chooses the device and builds the kernels that frames need.
  /// @throws Error        the configuration has problems; the message lists all of them
  /// @throws DeviceError  no device fits (the message lists all devices), or the kernels do not build
  /// @throws FileError    config.map_folder cannot be made, read or written, is in use by another mapper, has another block size, or
  ///                      has kept views that are too large for config.recent_views
  explicit Mapper(const Config& config = {});
  ~Mapper();
  Mapper(Mapper&&) noexcept;
  Mapper& operator=(Mapper&&) noexcept;

  /// Builds the kernels that questions need, so that the first one need not wait for it. On a graphics processor this may take seconds if
  /// they have never been built. @throws DeviceError  they do not build
  void prepare_questions();

  /// Updates the map with a frame, Psi_n -> Psi_(n+1): one pass of the paper's flow chart.
  /// With a map_folder, first loads blocks near the camera into memory and moves far blocks out of memory.
  /// @throws BadFrame     the frame is unusable; nothing has changed
  /// @throws FileError    the map folder cannot be read, or an earlier write to it has failed. The frame is refused, the map loses nothing,
  ///                      and later frames may succeed. Blocks may have entered or left memory all the same; changes() reports these
  /// @throws DeviceError  the device failed or is out of memory. The map is as it was before the frame. If the device fails again while the
  ///                      frame is undone, the next call undoes it first, and throws as long as it cannot
  Report integrate(const DepthFrame& frame);

  /// All surfels, ordered by id. With a map_folder: the surfels in memory, near the camera; none before the first frame. The whole map is
  /// whole_map().
  std::vector<Surfel> surfels() const;

  /// The surfels of surfels() whose centre lies in a box of the world frame [m].
  std::vector<Surfel> surfels(const Eigen::AlignedBox3f& box_world) const;

  /// What the map says of points of the world [m], in their order. What kept views and seen points know is free, except where it was taken
  /// back; points within a voxel of an occupied surfel are occupied, and all others unknown. With a map_folder: by what is in memory. If
  /// seen_points is false, only what kept views know is free.
  /// @throws Error  a point is not finite
  std::vector<SpaceState> states(const std::vector<Eigen::Vector3f>& points_world) const;

  /// Where rays end: at the first of their points that is occupied, or unknown if that is asked for. Both ends count. Points of a ray are
  /// `step` [m] apart, or a little less.
  /// @throws Error  an end is not finite, a ray has more than a million points, or the step is not from 0.0001 to 10 m
  std::vector<RayState> ray_states(const std::vector<Ray>& rays_world, bool stop_at_unknown, double step = 0.01) const;

  /// The nearest surfel of each point, of any label, whose centre is at most `reach` [m] away; of several, the one with the lowest id. New
  /// surfels have radii of 0.87 voxels, so that the distance to their discs is less by no more than that. With a map_folder: by what is in
  /// memory.
  /// @throws Error  a point is not finite, the reach is not from 0.001 to 5 m, or there are more than 100 million points
  std::vector<NearestBoundary> nearest_boundaries(const std::vector<Eigen::Vector3f>& points_world, double reach) const;

  /// How far free points are from the boundary of free space, which is the nearest surfel, measured or frontier [m]: at most `most` [m],
  /// and 0 for points that are not free. @throws Error  as nearest_boundaries(), whose reach is `most`
  std::vector<float> clearance(const std::vector<Eigen::Vector3f>& points_world, double most) const;

  /// What there is in boxes with edges along the world's axes [m]: occupied if any part is occupied, else unknown if any part is unknown,
  /// else free. Asked are points at most `step` [m] apart, on all faces and within; and for thin things between them the surfels whose
  /// centres lie within: a frontier surfel says that a part is unknown.
  /// @throws Error  a corner is not finite, an edge is not longer than 0 or is longer than 20 m, the step is not from 0.001 to 1 m, or the
  ///                boxes have more than 100 million points
  std::vector<SpaceState> box_states(const std::vector<Eigen::AlignedBox3f>& boxes_world, double step = 0.05) const;

  /// Where a box with edges along the world's axes, such as a robot's, must stop when its centre moves along paths: where the first part of
  /// it becomes occupied, or unknown if that is asked for. The distances are those of its centre. The box is asked for as by box_states()
  /// at the start, then at most every `step` [m] on the faces that look ahead; surfels stop it anywhere between.
  /// @throws Error  an end is not finite, a path has more than a million steps, or box_states() would refuse box, step or number of points
  std::vector<RayState> path_states(const std::vector<Ray>& paths_world, const Eigen::Vector3f& box_size, bool stop_at_unknown,
                                    double step = 0.05) const;

  /// The blocks of a grid of states that may have changed since the map had sequence number `since`; 0, or a number from before the map was
  /// replaced: the whole grid (StateChanges::since is 0 then). What is only forgotten, because kept views are replaced by seen points or
  /// blocks go to the map folder, counts as no change. StateGrid::take() tells what is different. Calls with the resolution of
  /// the call before take far less time: the mapper keeps the cells of the last resolution. @param resolution  edge of a cell [m]
  /// @throws Error  the resolution is not from 0.02 to 1 m
  StateChanges state_changes(std::uint64_t since, double resolution) const;

  /// What a camera would see of the map from poses that it has not been to, in the order of the poses. With a map_folder: of what is in
  /// memory. Where surfels are smaller than a pixel, merged ones stand for them.
  /// @throws Error  names the field of the question that makes no sense: views.hpp has the limits
  std::vector<ViewValue> evaluate_views(const ViewQuestion& question) const;

  /// The surfels in memory, ordered by id, and with a map_folder also those on disk, whose id is 0. @throws FileError
  std::vector<Surfel> whole_map() const;

  /// Changes since the map had sequence number `since`; 0 gives the whole map. The changes of the last frame are exact, and so are
  /// those since a reader's last question, be it many frames ago, as long as there are few readers: they contain what frames have touched,
  /// and no ids but those of surfels that were there. Else they may contain what earlier frames have touched, and ids that were free
  /// before. Surfels that move to the map folder are reported as removed, and as updated with new ids when they come back.
  ///
  /// Any number of readers may follow the map: each begins with since = 0, and then gives the sequence number of its last Changes. Until a
  /// reader has been told that a surfel is gone, its id is not given again, be it by frames, reset or load. A reader that has not asked for
  /// 1000 frames is forgotten. It gets the whole map when it asks again (Changes::since is 0), as its ids may belong to other surfels by
  /// then. So does a reader that begins with a number other than 0, or with one that the map has not reached.
  Changes changes(std::uint64_t since) const;

  /// The whole map as files keep it, with what has been seen; with a map_folder, also what is on disk. @throws FileError
  SavedMap saved_map() const;

  /// Writes the map as a PLY or PCD file, by the ending of the path (map_file.hpp): first to a temporary file, which is then renamed. A PCD
  /// file has the surfels alone, without what has been seen and the kept views. With a map_folder, the file has the whole map, which must
  /// fit into memory while it is written. @throws FileError
  void save(const std::string& path) const;

  /// With a map_folder, waits until the whole map is written to it; without one, does nothing. To be called before the mapper is destroyed:
  /// the destructor writes the map as well, but can tell nobody that it failed.
  /// @throws FileError  the folder cannot be written, or has been deleted. The map loses nothing, and flush() may be called again
  void flush();

  /// Why the map folder could not be written at the last try; empty if all is well. Later frames and flush() try again. From any thread.
  std::string map_folder_fault() const;

  /// What is odd about the device, or about the map that was opened or loaded, but no reason to refuse it, in sentences: a device that
  /// cannot give the same map as others, damaged kept views that were left out, and a seen_spacing that the map does not have. Each
  /// sentence is given once.
  std::vector<std::string> take_warnings();

  /// Replaces the map by a saved one; with a map_folder, also the map in the folder. With the same configuration, mapping goes on as with
  /// the map that was saved, except that the last frames, by which poses are corrected, are not saved. What has been seen is filled in from
  /// the surfels if the file does not have it; PCD files never do.
  /// @throws FileError  the file cannot be used; the map stays as it was
  void load(const std::string& path);

  /// Replaces the map by these surfels, which get new ids. Radii are limited to four blocks (2 m where z_max is at most 12 m), which is far
  /// more than this mapper makes.
  /// @throws DeviceError  the device failed or is out of memory. The map is as it was; or it is lost, and all calls say so until load() or
  ///                      reset() succeeds
  void load(const std::vector<Surfel>& surfels);

  /// Replaces the map by a whole saved one. Where it does not have what has been seen, or with blocks of another size, that is filled in
  /// from the surfels, on `threads` threads of the host. @throws FileError  what has been seen is damaged, or the kept views are too
  /// large for recent_views; the map stays as it was
  /// @throws Error  there is not enough memory to fill it in; the map stays as it was
  void load(const SavedMap& map);

  /// Empties the map, including the one in the map folder. Keeps the configuration; the sequence number goes on.
  void reset();

  /// Counts the surfels of surfels().
  Statistics statistics() const;
  std::size_t size() const;          ///< number of surfels in the map; with a map_folder, in memory
  std::size_t size_on_disk() const;  ///< number of further surfels, which are in the map folder only
  std::uint64_t sequence() const;
  const Config& config() const;

  /// Platform, name and compute units of the device in use, for display.
  std::string device() const;

  /// Why that device was taken, for display, for instance "fastest usable of 2: a graphics processor".
  std::string device_choice() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace frontier_surfels
