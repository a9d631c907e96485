#include "replay/bag_live_replay.hpp"

#include <ros/init.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <vector>

#include "replay/progress.hpp"

namespace frontier_surfels::replay {

using messages::strip_slash;

namespace {

const ros::Duration kTransformsAhead(1);  // sent ahead of a frame, whose pose is interpolated between one before and one after it
constexpr double kFirstTimeout = 60;      // [s] for the first frame: kernels may have to be compiled
constexpr double kTimeout = 20;           // [s] for each other frame
constexpr double kHeadStart = 0.5;        // [s] for the messages that the first frame needs
constexpr double kRetryAfter = 0.2;       // [s] for messages that a dropped frame needs

/// Without ROS' own handler of Ctrl-C, which would close the connections before the last frame is scored.
void init_ros(const std::vector<std::string>& arguments) {
  std::vector<std::string> all = {"replay_score"};
  all.insert(all.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& argument : all) pointers.push_back(argument.data());
  int count = static_cast<int>(pointers.size());
  try {
    ros::init(count, pointers.data(), "replay_score", ros::init_options::NoSigintHandler | ros::init_options::AnonymousName);
  } catch (const ros::Exception& fault) {
    throw Error("ROS cannot be started (" + std::string(fault.what()) + "): check the arguments with ':=' and the environment.");
  }
}

/// time + ahead, or the largest time.
ros::Time later(const ros::Time& time, const ros::Duration& ahead) { return ros::TIME_MAX - ahead < time ? ros::TIME_MAX : time + ahead; }

Report to_report(const FrameReport& message) {
  Report report;
  report.stamp = message.header.stamp.toSec();
  report.sequence = message.sequence;
  report.T_world_camera = messages::to_isometry(message.pose);
  report.surfels = message.surfels;
  report.in_view = message.in_view;
  report.measured_pixels = message.measured_pixels;
  report.taken_back = message.taken_back;
  report.created = message.created;
  report.removed = message.removed;
  report.split = message.split;
  report.map_bytes = message.map_bytes;
  report.seen_bytes = message.seen_bytes;
  report.device_bytes = message.device_bytes;
  report.view_kept = message.view_kept;
  report.total_ms = message.total_ms;
  const std::size_t stages = std::min(message.stage_names.size(), message.stage_ms.size());
  for (std::size_t i = 0; i < stages; ++i) report.stages.push_back({message.stage_names[i], message.stage_ms[i]});
  return report;
}

Statistics statistics_of(const std::vector<Surfel>& surfels, const Report& last) {
  Statistics statistics;
  statistics.surfels = surfels.size();
  statistics.occupied = static_cast<std::size_t>(
      std::count_if(surfels.begin(), surfels.end(), [](const Surfel& surfel) { return surfel.label == Label::kOccupied; }));
  statistics.frontier = statistics.surfels - statistics.occupied;
  statistics.map_bytes = last.map_bytes;
  statistics.seen_bytes = last.seen_bytes;
  statistics.device_bytes = last.device_bytes;
  return statistics;
}

void add(Run& run, const RecordedFrame& frame, const FrameReport& report, Yardsticks* yardsticks) {
  if (report.result != FrameReport::INTEGRATED) {
    run.skipped.push_back(report.reason);
    return;
  }
  FrameRecord record{to_report(report), frame.T_world_camera, std::nullopt};
  record.depths = count_depths(frame.view().depth, run.config, record.report.measured_pixels);
  record.index = frame.index;
  if (yardsticks != nullptr) record.octomap = yardsticks->add(frame.view(), record.report.T_world_camera, frame.index);
  run.frames.push_back(std::move(record));
}

}  // namespace

BagLiveReplay::BagLiveReplay(const Recording& recording, const LiveOptions& options, const std::function<bool()>& stop)
    : recording_(recording) {
  std::error_code ignored;  // a name may be too long to be asked for
  if (std::filesystem::is_directory(recording.path, ignored)) {
    throw Error("'" + recording.path + "' is a folder, but --live plays bags: make a bag of it with sequence_to_bag.");
  }
  if (!std::filesystem::exists(recording.path, ignored)) throw Error("There is no bag '" + recording.path + "'.");
  init_ros(options.ros_arguments);
  mapper_ = std::make_unique<RunningMapper>(options.mapper, stop);
  refuse_map_folder();
  open_bag();
  player_ = std::make_unique<BagPlayer>(*source_, *mapper_);
  tell_what_is_not_heard();
}

/// The map is taken from topics, which have only what is in memory, and it is reset before, which would empty the folder.
void BagLiveReplay::refuse_map_folder() const {
  const std::string& folder = mapper_->config().map_folder;
  if (folder.empty()) return;
  throw Error("The mapper " + mapper_->name() + " keeps its map in the folder '" + folder +
              "', which a replay would empty: start a mapper without map_folder, or leave --live out.");
}

/// Opens the bag with the world frame of the mapper, so that both use the same poses.
void BagLiveReplay::open_bag() {
  std::string& world = recording_.options.world_frame;
  if (!world.empty() && strip_slash(world) != mapper_->world_frame()) {
    throw Error("The mapper " + mapper_->name() + " maps in the frame '" + mapper_->world_frame() + "', not in '" + world +
                "': start it with that ~world_frame, or leave --world-frame out.");
  }
  world = mapper_->world_frame();
  auto source = open_source(recording_.path, recording_.options);
  source_.reset(dynamic_cast<BagSource*>(source.get()));
  if (!source_) throw Error("'" + recording_.path + "' is no bag: --live plays bags only.");
  source.release();
}

void BagLiveReplay::tell_what_is_not_heard() {
  mapper_->wait_until([this] { return player_->clock_is_heard() && player_->color_is_heard(); }, 2);
  const std::string mapper = "The mapper " + mapper_->name();
  if (!player_->clock_is_heard()) {
    std::cerr << mapper + " does not follow the recording's clock: set the parameter /use_sim_time to true before you start it.\n";
  }
  if (!player_->color_is_heard()) {
    std::cerr << mapper + " does not listen to " + player_->color_topic() + ", the bag's colour images: the map gets no colour.\n";
  }
}

std::unique_ptr<BagLiveReplay::Played> BagLiveReplay::next() {
  auto frame = source_->next();
  if (!frame) return nullptr;
  const ros::Time stamp = to_image_message(source_->message()).header().stamp;
  return std::make_unique<Played>(Played{std::move(*frame), source_->message(), stamp});
}

/// Sends the clock first: if it jumps back, tf listeners clear their buffers, and transforms sent before would be lost.
void BagLiveReplay::begin(const Played& first) {
  player_->begin(first.stamp);
  mapper_->wait(kHeadStart);
  mapper_->reset();
  player_->send_static_transforms();
  player_->send_transforms(later(first.message.getTime(), kTransformsAhead));
  player_->send_camera_and_color(first.stamp);
  mapper_->wait(kHeadStart);
}

void BagLiveReplay::send(const Played& played, const ros::Duration& transforms_ahead) {
  player_->send_transforms(later(played.message.getTime(), transforms_ahead));
  player_->send_depth(played.message, played.stamp);
}

/// The report on a frame. Sends the frame once more if its pose or camera_info came too late: the second time they are there.
FrameReport BagLiveReplay::answer_to(const Played& played, double timeout) {
  const FrameReport report = mapper_->report_on(played.stamp, timeout);
  if (report.result != FrameReport::DROPPED_NO_POSE && report.result != FrameReport::DROPPED_NO_CAMERA) return report;
  mapper_->wait(kRetryAfter);
  send(played, kTransformsAhead + kTransformsAhead);
  return mapper_->report_on(played.stamp, kTimeout);
}

Run BagLiveReplay::map(Yardsticks* yardsticks, const std::function<bool()>& stop) {
  Run run = new_run(*source_, config(), mapper_->device());
  FrameReport report;
  Progress progress("Mapping", static_cast<double>(source_->size()), "frames");
  std::unique_ptr<Played> played = next();
  if (played) begin(*played);
  for (double timeout = kFirstTimeout; played && !run.stopped; timeout = kTimeout) {
    send(*played, kTransformsAhead);
    std::unique_ptr<Played> following = next();  // is read while the mapper is busy
    if (following) player_->send_camera_and_color(following->stamp);
    report = answer_to(*played, timeout);
    add(run, played->frame, report, yardsticks);
    progress.update(static_cast<double>(run.frames.size() + run.skipped.size() + source_->skipped().size()));
    run.stopped = stop();
    played = std::move(following);
  }
  finish_run(*source_, run);
  if (run.frames.empty()) throw nothing_usable(recording_, run.skipped);

  run.surfels = mapper_->surfels(report.sequence);
  run.statistics = statistics_of(run.surfels, run.frames.back().report);
  run.peak_rss_mb = peak_rss_mb();
  return run;
}

}  // namespace frontier_surfels::replay
