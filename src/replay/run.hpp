/// One run over a recording: source -> Mapper -> scores.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/depth_census.hpp"
#include "frontier_surfels/mapper.hpp"
#include "frontier_surfels/scoring/exact_test.hpp"
#include "frontier_surfels/scoring/octomap_truth.hpp"
#include "frontier_surfels/types.hpp"
#include "recordings/frame_source.hpp"
#include "replay/truth.hpp"

namespace frontier_surfels::replay {

/// A recording, and which part of it is used.
struct Recording {
  std::string path;
  SourceOptions options;
};

/// Side of OctoMap's voxels [m]; 0: no OctoMap; empty: automatic, as far apart as the pixels that are used at z_max, so that OctoMap has no
/// gaps between rays.
using OctomapResolution = std::optional<double>;

/// What a map is scored against: the exact test, OctoMap and the truth. They must get the same frames as the map.
class Yardsticks {
 public:
  /// @param truth  null: none
  Yardsticks(const Config& config, const OctomapResolution& octomap_resolution, bool exact, std::shared_ptr<TruthFolder> truth = nullptr);

  /// @param T_world_camera  the pose with which the mapper has mapped the frame
  /// @param index           of the frame in the recording
  /// @param surfels_in      the map after the frame, for the truth's objects; may be empty
  /// @return the time of OctoMap for this frame, if there is an OctoMap
  /// @throws Error  the truth has no such frame
  std::optional<scoring::InsertionTime> add(const DepthFrame& frame, const Eigen::Isometry3d& T_world_camera, std::size_t index = 0,
                                            const scoring::ObjectTest::SurfelsIn& surfels_in = {});

  const std::optional<scoring::ExactTest>& exact() const { return exact_; }
  const std::optional<scoring::OctomapTruth>& octomap() const { return octomap_; }  ///< empty before the first frame as well
  const std::optional<Truth>& truth() const { return truth_; }

  double octomap_resolution() const { return octomap_resolution_.value_or(pixel_spacing_); }  ///< [m]; 0: none
  /// Largest distance between neighbouring pixels at z_max, of the first frame [m].
  double pixel_spacing() const { return pixel_spacing_; }

  /// OctoMap's boundary surfels M; computed once, after the last frame.
  const std::vector<Surfel>& octomap_boundary() const;

  /// Whether a map made with `config` can be scored with these yardsticks: they must read depth images alike.
  bool fit(const Config& config) const;

 private:
  Config config_;
  OctomapResolution octomap_resolution_;
  double pixel_spacing_ = 0;
  std::optional<scoring::ExactTest> exact_;
  std::optional<scoring::OctomapTruth> octomap_;
  std::optional<Truth> truth_;
  mutable std::optional<std::vector<Surfel>> octomap_boundary_;
};

struct FrameRecord {
  Report report;
  Eigen::Isometry3d T_world_camera;  ///< as it was recorded
  std::optional<scoring::InsertionTime> octomap;
  DepthCensus depths = {};
  double cpu_ms = 0;      ///< CPU time of the whole process during integrate(), a CPU device's threads included; 0: not measured
  std::size_t index = 0;  ///< of the frame in the recording
};

/// The result of mapping a recording.
struct Run {
  Config config;
  std::string date;         ///< of the start, UTC, as 2020-12-31T23:59:59Z
  std::string world_frame;  ///< of the poses
  std::string if_still;     ///< see FrameSource
  std::string device;
  std::vector<FrameRecord> frames;
  std::vector<std::string> skipped;  ///< a sentence for each frame that was not used
  std::vector<std::string> notes;    ///< see FrameSource
  std::vector<std::string> remarks;  ///< the warnings of a FrameSource, and of the mapper
  std::vector<Surfel> surfels;
  Statistics statistics;
  double peak_rss_mb = 0;  ///< [10^6 byte] of the process up to the last frame
  bool stopped = false;    ///< before the end of the recording
  std::string unsaved;     ///< why the map folder lacks a part of the map, and whether the run has ended there; empty: it lacks none
};

/// A run that has not begun: its date is now, and it knows where the poses come from.
Run new_run(const FrameSource& source, const Config& config, const std::string& device);

/// Adds the notes and warnings of the source, and its skipped frames to those of the mapper.
void finish_run(const FrameSource& source, Run& run);

/// Maps the remaining frames of `source`, up to one that is refused because the map folder cannot be read or written. Does not set the
/// surfels, the statistics and the peak memory of the result.
/// @param after_frame  called with every frame that the mapper took, and its record
/// @param stop         asked after every frame whether to leave the rest
Run map_frames(Mapper& mapper, FrameSource& source, const std::function<void(const DepthFrame&, FrameRecord&)>& after_frame,
               const std::function<bool()>& stop);

/// Maps a recording.
/// @param yardsticks  if not null: filled with the frames that the mapper took
/// @param stop        asked after every frame whether to leave the rest
/// @throws Error      also if no frame could be used
Run map_recording(const Recording& recording, const Config& config, Yardsticks* yardsticks, const std::function<bool()>& stop);

/// The error for a recording of which no frame could be used.
Error nothing_usable(const Recording& recording, const std::vector<std::string>& skipped);

/// Largest resident memory of this process so far [10^6 byte].
double peak_rss_mb();

/// Scores of a map; those without a yardstick are empty.
struct Scores {
  std::optional<scoring::OctomapScore> octomap;
  std::optional<scoring::ExactScore> exact;
  std::vector<scoring::Verdict> verdicts;  ///< of the exact test, one for each surfel

  // Only with a truth:
  std::optional<scoring::ExactScore> truth;                         ///< of the map, by the ideal frames
  std::optional<scoring::ExactScore> octomap_exact, octomap_truth;  ///< of OctoMap's boundary, by the recorded and the ideal frames
  std::vector<scoring::ObjectScore> objects;
};

/// Scores of a map alone: octomap, exact, truth.
Scores score_map(const std::vector<Surfel>& surfels, const Yardsticks& yardsticks, int threads);

/// All scores. @param surfels  the map after the last frame that the yardsticks have got
Scores score(const std::vector<Surfel>& surfels, const Yardsticks& yardsticks, int threads);

}  // namespace frontier_surfels::replay
