#include "replay/run.hpp"

#include <algorithm>
#include <ctime>
#include <fstream>
#include <iostream>

#include "replay/progress.hpp"
#include "scoring/cpu_clock.hpp"
#include "scoring/decimated_depth.hpp"

namespace frontier_surfels::replay {
namespace {

constexpr std::size_t kSegments = 40000;  // of the exact test: the standard error of any share is below 0.25 %

}  // namespace

Yardsticks::Yardsticks(const Config& config, const OctomapResolution& octomap_resolution, bool exact, std::shared_ptr<TruthFolder> truth)
    : config_(config), octomap_resolution_(octomap_resolution) {
  if (exact) exact_.emplace(config);
  if (truth) truth_.emplace(config, std::move(truth));
}

std::optional<scoring::InsertionTime> Yardsticks::add(const DepthFrame& frame, const Eigen::Isometry3d& T_world_camera, std::size_t index,
                                                      const scoring::ObjectTest::SurfelsIn& surfels_in) {
  DepthFrame mapped = frame;
  mapped.T_world_camera = T_world_camera;
  if (pixel_spacing_ == 0) pixel_spacing_ = config_.decimation * config_.z_max / std::min(frame.intrinsics.fx, frame.intrinsics.fy);
  if (exact_) exact_->add(mapped);
  if (truth_) truth_->add(index, frame, surfels_in);
  if (octomap_resolution() == 0) return std::nullopt;
  if (!octomap_) octomap_.emplace(octomap_resolution(), config_);
  return octomap_->add(mapped);
}

const std::vector<Surfel>& Yardsticks::octomap_boundary() const {
  if (!octomap_boundary_) octomap_boundary_ = octomap_->boundary();
  return *octomap_boundary_;
}

/// Corrected poses follow from the working images, and from the sensor's noise.
bool Yardsticks::fit(const Config& config) const {
  return scoring::DepthReading(config) == scoring::DepthReading(config_) && config.correct_poses == config_.correct_poses;
}

Run new_run(const FrameSource& source, const Config& config, const std::string& device) {
  Run run;
  run.config = config;
  run.device = device;
  run.world_frame = source.world_frame();
  run.if_still = source.if_still();
  const std::time_t now = std::time(nullptr);
  std::tm utc = {};
  gmtime_r(&now, &utc);
  char text[40];
  std::strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%SZ", &utc);
  run.date = text;
  return run;
}

void finish_run(const FrameSource& source, Run& run) {
  run.skipped.insert(run.skipped.end(), source.skipped().begin(), source.skipped().end());
  run.notes = source.notes();
  run.remarks = source.warnings();
}

Run map_frames(Mapper& mapper, FrameSource& source, const std::function<void(const DepthFrame&, FrameRecord&)>& after_frame,
               const std::function<bool()>& stop) {
  Run run = new_run(source, mapper.config(), mapper.device());
  Progress progress("Mapping", static_cast<double>(source.size()), "frames");
  while (const auto frame = source.next()) {
    const DepthFrame view = frame->view();
    try {
      const double cpu_before_ms = scoring::cpu_ms(CLOCK_PROCESS_CPUTIME_ID);
      FrameRecord record{mapper.integrate(view), view.T_world_camera, std::nullopt};
      record.cpu_ms = scoring::cpu_ms(CLOCK_PROCESS_CPUTIME_ID) - cpu_before_ms;
      record.depths = count_depths(view.depth, run.config, record.report.measured_pixels);
      record.index = frame->index;
      after_frame(view, record);
      run.frames.push_back(std::move(record));
    } catch (const BadFrame& refused) {
      run.skipped.push_back(refused.what());
    } catch (const FileError& fault) {  // what has been mapped before is worth having all the same
      run.unsaved =
          "The map ends after " + std::to_string(run.frames.size()) + " frames, and the map folder may lack a part of it. " + fault.what();
      break;
    }
    progress.update(static_cast<double>(run.frames.size() + run.skipped.size() + source.skipped().size()));
    if (stop()) {
      run.stopped = true;
      break;
    }
  }
  finish_run(source, run);
  for (std::string& warning : mapper.take_warnings()) run.remarks.push_back(std::move(warning));
  return run;
}

Run map_recording(const Recording& recording, const Config& config, Yardsticks* yardsticks, const std::function<bool()>& stop) {
  const auto source = open_source(recording.path, recording.options);
  Mapper mapper(config);
  std::cout << "Device: " << mapper.device() << " (" << mapper.device_choice() << ")" << std::endl;
  if (!config.map_folder.empty() && !mapper.whole_map().empty()) {
    throw Error("The map folder '" + config.map_folder +
                "' already has a map, which would be scored as if it were made of this recording: delete the folder, or choose another.");
  }
  const auto surfels_in = [&mapper](const Eigen::AlignedBox3d& box) { return mapper.surfels(box.cast<float>()); };
  const auto measure = [&](const DepthFrame& view, FrameRecord& record) {
    if (yardsticks != nullptr) record.octomap = yardsticks->add(view, record.report.T_world_camera, record.index, surfels_in);
  };
  Run run = map_frames(mapper, *source, measure, stop);
  if (run.frames.empty() && !run.unsaved.empty()) throw FileError(run.unsaved);
  if (run.frames.empty()) throw nothing_usable(recording, run.skipped);

  run.surfels = mapper.whole_map();
  run.statistics = mapper.statistics();
  run.statistics.surfels = run.surfels.size();  // on disk, too
  run.statistics.occupied = static_cast<std::size_t>(
      std::count_if(run.surfels.begin(), run.surfels.end(), [](const Surfel& surfel) { return surfel.label == Label::kOccupied; }));
  run.statistics.frontier = run.statistics.surfels - run.statistics.occupied;
  run.peak_rss_mb = peak_rss_mb();
  try {
    mapper.flush();
  } catch (const FileError& fault) {  // the scores are worth having all the same
    if (run.unsaved.empty()) run.unsaved = std::string("The map folder lacks a part of the map. ") + fault.what();
  }
  return run;
}

double peak_rss_mb() {
  // getrusage() does not do: its figure includes the memory of the parent process, of which this one was a copy before exec.
  std::ifstream status("/proc/self/status");
  double kib = 0;
  for (std::string word; status >> word;)
    if (word == "VmHWM:") status >> kib;
  return kib * 1024.0 / 1e6;
}

Error nothing_usable(const Recording& recording, const std::vector<std::string>& skipped) {
  if (skipped.empty()) return Error("'" + recording.path + "' has no frame in the chosen part: check --first, --last and --stride.");
  return Error("No frame of '" + recording.path + "' could be used; " + std::to_string(skipped.size()) +
               " skipped, the first because: " + skipped.front());
}

namespace {

scoring::ExactScore exact_score(const std::string& title, const scoring::ExactTest& test, const std::vector<Surfel>& surfels, int threads,
                                std::vector<scoring::Verdict>* verdicts = nullptr) {
  Progress progress(title, 1);
  const auto show = [&progress](double share) {
    progress.update(share);
    return true;
  };
  return test.score(surfels, kSegments, threads, show, verdicts);
}

}  // namespace

Scores score_map(const std::vector<Surfel>& surfels, const Yardsticks& yardsticks, int threads) {
  Scores scores;
  if (yardsticks.octomap()) scores.octomap = yardsticks.octomap()->score(surfels, yardsticks.octomap_boundary());
  if (yardsticks.exact()) scores.exact = exact_score("Scoring", *yardsticks.exact(), surfels, threads, &scores.verdicts);
  if (yardsticks.truth()) scores.truth = exact_score("Scoring by the truth", yardsticks.truth()->exact(), surfels, threads);
  return scores;
}

Scores score(const std::vector<Surfel>& surfels, const Yardsticks& yardsticks, int threads) {
  Scores scores = score_map(surfels, yardsticks, threads);
  if (!yardsticks.truth()) return scores;
  scores.objects = yardsticks.truth()->objects(surfels);
  if (!yardsticks.octomap()) return scores;
  const std::vector<Surfel>& boundary = yardsticks.octomap_boundary();
  if (yardsticks.exact()) scores.octomap_exact = exact_score("Scoring OctoMap", *yardsticks.exact(), boundary, threads);
  scores.octomap_truth = exact_score("Scoring OctoMap by the truth", yardsticks.truth()->exact(), boundary, threads);
  return scores;
}

}  // namespace frontier_surfels::replay
