#include "replay/summary.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numeric>

#include "config/c_locale.hpp"
#include "frontier_surfels/map_checksum.hpp"
#include "replay/objects_summary.hpp"
#include "replay/warnings.hpp"

namespace frontier_surfels::replay {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t kWarmUpFrames = 5;
constexpr std::size_t kFewFrames = 10;

/// The shortest text that reads back as the same number, whatever the locale.
std::string exact_text(double value) { return ordered_json(value).dump(); }

double median(std::vector<double> values) {
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return (*middle + *std::max_element(values.begin(), middle)) / 2;
}

double mean(const std::vector<double>& values) { return std::accumulate(values.begin(), values.end(), 0.0) / values.size(); }

ordered_json mean_and_median(const std::vector<double>& values) { return {{"mean", mean(values)}, {"median", median(values)}}; }

template <typename Getter>
std::vector<double> column(const std::vector<FrameRecord>& frames, Getter get) {
  std::vector<double> values(frames.size());
  std::transform(frames.begin(), frames.end(), values.begin(), get);
  return values;
}

/// Time of a stage; 0 if it did not run in this frame.
double stage_ms(const FrameRecord& frame, const std::string& name) {
  double ms = 0;
  for (const StageTime& stage : frame.report.stages) {
    if (stage.name == name) ms += stage.ms;
  }
  return ms;
}

double total_ms(const FrameRecord& frame) { return frame.report.total_ms; }

double cpu_ms(const FrameRecord& frame) { return frame.cpu_ms; }

std::size_t taken_back(const std::vector<FrameRecord>& frames) {
  std::size_t pixels = 0;
  for (const FrameRecord& frame : frames) pixels += frame.report.taken_back;
  return pixels;
}

double shift_mm(const FrameRecord& frame) {
  return 1000 * (frame.report.T_world_camera.translation() - frame.T_world_camera.translation()).norm();
}

double turn_deg(const FrameRecord& frame) {
  const Eigen::Quaterniond recorded(frame.T_world_camera.linear()), mapped(frame.report.T_world_camera.linear());
  return recorded.angularDistance(mapped) * 180 / M_PI;
}

/// How far the poses of the map are from the recorded ones.
ordered_json corrections_json(const std::vector<FrameRecord>& frames) {
  const TimeStatistics shift = time_statistics(column(frames, shift_mm)), turn = time_statistics(column(frames, turn_deg));
  return {{"shift_mm", {{"median", shift.median}, {"p95", shift.p95}}}, {"turn_deg", {{"median", turn.median}, {"p95", turn.p95}}}};
}

bool cpu_is_measured(const std::vector<FrameRecord>& frames) {
  return std::all_of(frames.begin(), frames.end(), [](const FrameRecord& frame) { return frame.cpu_ms > 0; });
}

double octomap_ms(const FrameRecord& frame) { return frame.octomap ? frame.octomap->wall_ms : 0; }

double octomap_cpu_ms(const FrameRecord& frame) { return frame.octomap ? frame.octomap->cpu_ms : 0; }

std::string formatted(const char* format, double a, double b = 0, double c = 0, double d = 0) {
  const CLocale c_locale;
  char text[200];
  std::snprintf(text, sizeof(text), format, a, b, c, d);
  return text;
}

}  // namespace

TimeStatistics time_statistics(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  TimeStatistics result;
  result.mean = mean(values);
  result.median = median(values);
  result.p95 = values[(95 * n + 99) / 100 - 1];
  result.max = values.back();
  double squares = 0;
  for (const double value : values) squares += (value - result.mean) * (value - result.mean);
  if (n > 1 && result.mean > 0) result.rsd_percent = 100 * std::sqrt(squares / (n - 1)) / result.mean;
  return result;
}

std::vector<FrameRecord> warm_frames(const std::vector<FrameRecord>& frames) {
  return {frames.begin() + (frames.size() > kFewFrames ? kWarmUpFrames : 0), frames.end()};
}

std::vector<std::string> stage_names(const std::vector<FrameRecord>& frames) {
  std::vector<std::string> names;
  for (const FrameRecord& frame : frames) {
    auto next = names.begin();  // place for a new stage: behind the one that runs before it in this frame
    for (const StageTime& stage : frame.report.stages) {
      const auto found = std::find(names.begin(), names.end(), stage.name);
      next = (found != names.end() ? found : names.insert(next, stage.name)) + 1;
    }
  }
  return names;
}

/// The frames in which the stages were timed: Config::stage_times_every.
std::vector<FrameRecord> timed_frames(const std::vector<FrameRecord>& frames) {
  std::vector<FrameRecord> timed;
  std::copy_if(frames.begin(), frames.end(), std::back_inserter(timed),
               [](const FrameRecord& frame) { return !frame.report.stages.empty(); });
  return timed;
}

ordered_json time_json(const std::vector<FrameRecord>& frames, const std::vector<std::string>& names) {
  const TimeStatistics total = time_statistics(column(frames, total_ms));
  const std::vector<FrameRecord> timed = timed_frames(frames);
  ordered_json stages = ordered_json::object();
  for (const std::string& name : timed.empty() ? std::vector<std::string>() : names) {
    stages[name] = mean_and_median(column(timed, [&name](const FrameRecord& frame) { return stage_ms(frame, name); }));
  }
  return {{"mean", total.mean}, {"median", total.median},           {"p95", total.p95},
          {"max", total.max},   {"rsd_percent", total.rsd_percent}, {"stages", stages}};
}

ordered_json config_json(const Config& config) {
  ordered_json json;
  for_each_field(config, [&json](const FieldInfo& info, const auto& value) { json[info.name] = value; });
  return json;
}

ordered_json octomap_json(const scoring::OctomapScore& score) {
  return {{"surfels", score.surfels}, {"fp", score.fp}, {"fn", score.fn}, {"fdr", score.fdr}, {"for", score.for_}};
}

ordered_json exact_json(const scoring::ExactScore& score) {
  return {{"right", score.right},         {"buried", score.buried},       {"floating", score.floating}, {"flipped", score.flipped},
          {"within_1v", score.within_1v}, {"within_2v", score.within_2v}, {"fdr_2cm", score.fdr_2cm},   {"fdr_5cm", score.fdr_5cm},
          {"miss_1cm", score.miss_1cm},   {"miss_2cm", score.miss_2cm},   {"miss_5cm", score.miss_5cm}, {"label_ok", score.label_ok}};
}

ordered_json reasons_json(const std::vector<FrameRecord>& frames) {
  const bool still = is_still(frames);
  ordered_json counts = ordered_json::object();
  for (const FrameRecord& frame : frames) {
    const std::string why = reason(frame, still);
    if (!why.empty()) counts[why] = counts.value(why, 0) + 1;
  }
  return counts;
}

ordered_json summary_json(const Recording& recording, const Run& run, const Yardsticks& yardsticks, const Scores& scores) {
  const std::vector<FrameRecord> warm = warm_frames(run.frames);
  ordered_json json;
  json["input"] = {{"path", recording.path}, {"frames", run.frames.size()}, {"skipped", run.skipped.size()}};
  if (yardsticks.truth()) json["input"]["truth"] = yardsticks.truth()->folder()->path();
  json["version"] = FRONTIER_SURFELS_VERSION;
  json["date"] = run.date;
  json["world_frame"] = run.world_frame;
  json["warnings"] = warnings(run);
  json["reasons"] = reasons_json(run.frames);
  json["notes"] = run.notes;
  json["skipped"] = run.skipped;
  json["config"] = config_json(run.config);
  json["device"] = run.device;
  json["surfels"] = {{"total", run.statistics.surfels},       {"occupied", run.statistics.occupied},
                     {"frontier", run.statistics.frontier},   {"taken_back", taken_back(run.frames)},
                     {"map_bytes", run.statistics.map_bytes}, {"seen_bytes", run.statistics.seen_bytes}};
  json["map_checksum"] = checksum_text(map_checksum(run.surfels));
  if (run.config.correct_poses) json["pose_corrections"] = corrections_json(run.frames);
  json["time_ms"] = time_json(warm, stage_names(run.frames));
  if (cpu_is_measured(warm)) json["cpu_ms"] = mean_and_median(column(warm, cpu_ms));
  json["memory_mb"] = {{"peak_rss", run.peak_rss_mb}, {"device", run.statistics.device_bytes / 1e6}};
  if (scores.octomap) {
    json["octomap"] = {{"resolution", yardsticks.octomap_resolution()},
                       {"pixel_spacing", yardsticks.pixel_spacing()},
                       {"time_ms", mean_and_median(column(warm, octomap_ms))},
                       {"cpu_ms", mean_and_median(column(warm, octomap_cpu_ms))},
                       {"memory_mb", yardsticks.octomap()->memory_mb()}};
    json["octomap"].update(octomap_json(*scores.octomap));
    if (scores.octomap_exact) json["octomap"]["exact"] = exact_json(*scores.octomap_exact);
    if (scores.octomap_truth) json["octomap"]["truth"] = exact_json(*scores.octomap_truth);
  }
  if (scores.exact) json["exact"] = exact_json(*scores.exact);
  if (scores.truth) json["truth"] = exact_json(*scores.truth);
  if (!scores.objects.empty()) json["objects"] = objects_json(scores.objects);
  return json;
}

Error empty_map(const std::string& path, const std::vector<std::string>& warnings) {
  std::string why;
  for (const std::string& warning : warnings) why += " " + warning;
  if (why.empty()) why = " No frame has seen a surface or free space: check the depth images, and z_min and z_max.";
  return Error("The map of '" + path + "' is empty." + why);
}

std::string frames_csv(const std::vector<FrameRecord>& frames) {
  const std::vector<std::string> stages = stage_names(frames);
  const bool still = is_still(frames);
  const bool octomap = !frames.empty() && frames.front().octomap.has_value();
  std::string csv = "stamp,surfels,created,removed,";
  for (const std::string& name : stages) csv += name + ",";
  csv += octomap ? "total,octomap_ms,reason\n" : "total,reason\n";
  for (const FrameRecord& frame : frames) {
    const Report& report = frame.report;
    csv += exact_text(report.stamp) + "," + std::to_string(report.surfels) + "," + std::to_string(report.created) + "," +
           std::to_string(report.removed) + ",";
    for (const std::string& name : stages) csv += exact_text(stage_ms(frame, name)) + ",";
    csv += exact_text(report.total_ms);
    if (octomap) csv += "," + exact_text(octomap_ms(frame));
    csv += "," + reason(frame, still) + "\n";
  }
  return csv;
}

std::string trajectory_text(const std::vector<FrameRecord>& frames) {
  std::string text = "# stamp tx ty tz qx qy qz qw (camera to world, optical frame)\n";
  for (const FrameRecord& frame : frames) {
    text += exact_text(frame.report.stamp);
    const Eigen::Quaterniond q(frame.report.T_world_camera.linear());
    const Eigen::Vector3d p = frame.report.T_world_camera.translation();
    for (const double value : {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()}) text += " " + exact_text(value);
    text += "\n";
  }
  return text;
}

/// The main figures of an exact test.
std::string exact_line(const ordered_json& exact) {
  const auto percent = [&](const char* figure) { return 100 * exact[figure].get<double>(); };
  return formatted("right %.2f %%; more than 2 cm off %.2f %%; boundary missed by 2 cm %.2f %%; label right %.2f %%\n", percent("right"),
                   percent("fdr_2cm"), percent("miss_2cm"), percent("label_ok"));
}

std::string result_table(const ordered_json& summary) {
  const auto& input = summary["input"];
  const auto& surfels = summary["surfels"];
  const auto& time = summary["time_ms"];
  std::string table;
  table += formatted("frames      %.0f, %.0f skipped\n", input["frames"], input["skipped"]);
  table += formatted("surfels     %.0f: %.0f occupied, %.0f frontier; %.1f MB\n", surfels["total"], surfels["occupied"],
                     surfels["frontier"], surfels["map_bytes"].get<double>() / 1e6);
  if (surfels["taken_back"] > 0)
    table += formatted("taken back  by %.0f pixels, whose surface stood where space was seen to be free before\n", surfels["taken_back"]);
  if (summary.contains("pose_corrections")) {
    const auto &shift = summary["pose_corrections"]["shift_mm"], &turn = summary["pose_corrections"]["turn_deg"];
    table += formatted("poses       corrected by %.1f mm and %.2f degrees, 95 %% by less than %.1f mm and %.2f degrees\n", shift["median"],
                       turn["median"], shift["p95"], turn["p95"]);
  }
  table +=
      formatted("time        median %.1f ms a frame, 95 %% below %.1f ms, at most %.1f ms\n", time["median"], time["p95"], time["max"]);
  const auto percent = [](const ordered_json& share) { return 100 * share.get<double>(); };
  if (summary.contains("exact")) table += "exact test  " + exact_line(summary["exact"]);
  if (summary.contains("truth")) table += "truth       " + exact_line(summary["truth"]);
  if (summary.contains("objects")) table += objects_table(summary["objects"]);
  if (summary.contains("octomap")) {
    const auto& octomap = summary["octomap"];
    table += formatted("OctoMap     voxels of %.1f mm, median %.1f ms a frame, %.1f MB; ", 1000 * octomap["resolution"].get<double>(),
                       octomap["time_ms"]["median"], octomap["memory_mb"]);
    table += formatted("FDR %.2f %%, FOR %.2f %% at 5 cm\n", percent(octomap["fdr"]), percent(octomap["for"]));
    if (octomap["resolution"] < 0.999 * octomap["pixel_spacing"].get<double>()) {
      table += formatted("            FOR counts OctoMap's own gaps: at z_max, pixels are %.1f mm apart\n",
                         1000 * octomap["pixel_spacing"].get<double>());
    }
    if (octomap.contains("exact")) table += "            exact test: " + exact_line(octomap["exact"]);
    if (octomap.contains("truth")) table += "            truth: " + exact_line(octomap["truth"]);
  }
  for (const char* kind : {"warnings", "notes"}) {
    constexpr std::size_t kShown = 5;
    const auto& sentences = summary[kind];
    for (std::size_t i = 0; i < std::min(sentences.size(), kShown); ++i)
      table += (kind == std::string("warnings") ? "WARNING     " : "note        ") + sentences[i].get<std::string>() + "\n";
    if (sentences.size() > kShown) table += "            ... and " + std::to_string(sentences.size() - kShown) + " more in summary.json.\n";
  }
  return table;
}

void write_file(const std::string& path, const std::string& content) {
  const std::string unfinished = path + ".unfinished";
  std::ofstream file(unfinished, std::ios::binary);
  file << content;
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(unfinished, path, error);
  if (file && !error) return;
  std::filesystem::remove(unfinished, error);
  throw FileError("'" + path + "' cannot be written: check that the folder is writable and the disk is not full.");
}

}  // namespace frontier_surfels::replay
