/// The inside of a Mapper: its memory, and the stages of a frame in the order in which they run.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/checked.hpp"
#include "frame/camera.hpp"
#include "frame/limits.hpp"
#include "frame/pose_correction.hpp"
#include "frame/recent_views.hpp"
#include "frame/working_image.hpp"
#include "frontier_surfels/mapper.hpp"
#include "map/change_readers.hpp"
#include "map/seen_points.hpp"
#include "map/surfel_map.hpp"
#include "opencl/commands.hpp"
#include "planner/boundaries.hpp"
#include "planner/point_states.hpp"
#include "planner/state_blocks.hpp"
#include "planner/view_values.hpp"
#include "stages/arithmetic_check.hpp"
#include "stages/candidates.hpp"
#include "stages/creation.hpp"
#include "stages/known_space.hpp"
#include "stages/observed_space.hpp"
#include "stages/remembering.hpp"
#include "stages/surfel_split.hpp"
#include "stages/surfel_visit.hpp"
#include "stages/taking_back.hpp"
#include "stages/view_settling.hpp"
#include "storage/map_archive.hpp"

namespace frontier_surfels {

/// Runs work on the device. An exception of OpenCL's becomes one of this library's errors.
template <typename Work>
auto on_device(Work work) -> decltype(work()) {
  try {
    return work();
  } catch (const std::exception& error) {
    throw_device_error(error);
  }
}

/// As on_device(work); errors for want of memory also tell what `commands` uses of it.
template <typename Work>
auto on_device(const Commands& commands, Work work) -> decltype(work()) {
  try {
    return work();
  } catch (const std::exception& error) {
    throw_device_error(error, commands.memory_text());
  }
}

struct Mapper::Impl {
  explicit Impl(const Config& wanted)
      : config(checked(wanted)),
        limits(make_limits(config)),
        sampling_room(config),
        commands(choose_device(config)),
        lists(commands),
        map(commands, lists, config),
        seen(commands, map.block_size()),
        views(commands, config),
        cameras(commands, config),
        pose_correction(config),
        observed(commands),
        taking_back(commands, config, map.block_size()),
        candidates(commands),
        visit(commands),
        splitting(commands, lists),
        settling(commands),
        list(commands, lists),
        creation(commands, lists),
        remembering(commands),
        point_states(commands),
        boundaries(commands, lists),
        state_blocks(commands),
        view_values(commands) {
    if (const std::string fault = arithmetic_fault(commands); !fault.empty()) warnings.push_back(fault);
    if (!config.seen_points) commands.build(kKnownSpaceProgram);
    if (config.map_folder.empty()) return;
    archive = std::make_unique<MapArchive>(config, map, seen, views,
                                           [this] { return remembering.remember_forgotten(views, map.block_size(), seen); });
    views.clear(archive->empty());
    if (!config.seen_points) return;  // the folder's views are of no use then, and stay there
    const std::vector<SavedView> stored = archive->stored_views(&warnings);
    views.make_room(stored);
    load_views(stored);
    archive->store_views();
  }

  void begin_call();
  void remember_forgotten();
  void note_changed(const std::vector<BlockKey>& blocks);
  Report integrate(const DepthFrame& input);
  Report update(const DepthFrame& input);
  std::uint64_t stage_times_every() const;
  Frame begin_frame(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera, Camera& camera, std::uint32_t number);
  double seen_spacing(const Camera& camera) const;
  void prepare_end(const WorkingImage& image, const Report& report);
  bool find_changes(const WorkingImage& image, Camera& camera, Frame& frame, Report& report);
  void carry_out(const Frame& frame, const Camera& camera, std::size_t removed);
  void fetch_blocks(const Camera& camera, const Eigen::Isometry3d& T_world_camera, std::uint32_t number);
  void finish_frame(std::uint32_t number, const WorkingImage& image, const Camera& camera, const CorrectedPose& pose, Report& report);
  Changes changes(std::uint64_t since);
  std::vector<SpaceState> states(const std::vector<Eigen::Vector3f>& points_world);
  StateChanges state_changes(std::uint64_t since, double resolution);
  std::vector<BlockKey> known_blocks() const;
  std::vector<BlockKey> surfels_changed_since(std::uint64_t since) const;
  std::vector<FirstSurfel> first_within(const std::vector<MovingBox>& boxes, bool frontier_counts);
  std::vector<ViewValue> evaluate_views(const ViewQuestion& question);
  SavedMap saved_map();
  void begin_map(const std::vector<Surfel>& surfels, const SeenSpace& saved_seen, const std::vector<SavedView>& saved_views);
  void load_views(const std::vector<SavedView>& saved);
  std::size_t device_bytes() const { return commands.allocated_bytes() - map.untouched_bytes(); }

  const Config config;
  const Limits limits;
  SamplingRoom sampling_room;
  Commands commands;
  Lists lists;
  SurfelMap map;
  SeenPoints seen;
  RecentViews views;
  Cameras cameras;

  // The stages, in the order in which they run
  PoseCorrection pose_correction;
  ObservedSpace observed;
  TakingBack taking_back;
  Candidates candidates;
  SurfelVisit visit;
  SurfelSplit splitting;
  ViewSettling settling;
  CandidateList list;
  std::optional<KnownSpace> known_space;  ///< made by the first frame that needs it
  Creation creation;
  Remembering remembering;

  // Planners' questions
  PointStates point_states;
  Boundaries boundaries;
  ChangedBlocks looked_at;   ///< a frame's view reached them
  ChangedBlocks taken_from;  ///< points were taken back, or given back
  ChangedBlocks lost_page;   ///< all surfels of a page were removed
  StateBlocks state_blocks;
  ViewValues view_values;

  std::unique_ptr<MapArchive> archive;  ///< with a map_folder
  std::vector<std::string> warnings;    ///< that have not been taken
  ChangeReaders readers;
  std::vector<BlockKey> blocks_in_view;  ///< of this frame
  std::uint64_t sequence = 0;
};

}  // namespace frontier_surfels
