// summary.json, frames.csv, the argument of --sweep and the progress bar, compared with values computed by hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <sstream>

#include "frontier_surfels/map_checksum.hpp"
#include "replay/progress.hpp"
#include "replay/summary.hpp"
#include "replay/sweep.hpp"

namespace frontier_surfels::replay {
namespace {

using nlohmann::ordered_json;

std::vector<std::string> keys(const ordered_json& object) {
  std::vector<std::string> result;
  for (const auto& item : object.items()) result.push_back(item.key());
  return result;
}

using Keys = std::vector<std::string>;

/// Frame i takes i + 1 ms. Stage "sweeps" takes a quarter of this, stage "median" a half, in odd frames only, and OctoMap 100 times as
/// much. CPU times are twice, and 90 times as much.
FrameRecord frame(int i) {
  FrameRecord record;
  record.report.stamp = 1305031102.160407 + i / 30.0;
  record.report.surfels = 1000 * (i + 1);
  record.report.created = 1200 + i;
  record.report.removed = 200 + i;
  record.report.total_ms = i + 1;
  record.report.stages = {{"sweeps", (i + 1) / 4.0}};
  if (i % 2 == 1) record.report.stages.push_back({"median", (i + 1) / 2.0});
  record.T_world_camera = Eigen::Isometry3d(Eigen::Translation3d(i, 0.1, -2) * Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()));
  record.report.T_world_camera = record.T_world_camera * Eigen::Translation3d(0, 0, 0.001 * i);
  record.cpu_ms = 2 * (i + 1);
  record.depths.usable = record.depths.in_working_image = 1;
  record.octomap = scoring::InsertionTime{100.0 * (i + 1), 90.0 * (i + 1)};
  return record;
}

std::vector<FrameRecord> frames(int n) {
  std::vector<FrameRecord> result;
  for (int i = 0; i < n; ++i) result.push_back(frame(i));
  return result;
}

Run run_of(int n) {
  Run run;
  run.device = "some device";
  run.frames = frames(n);
  run.skipped = {"No pose.", "No depth."};
  run.statistics = {5000, 3000, 2000, 80000, 7000, 64500000};
  run.peak_rss_mb = 321.5;
  return run;
}

Scores some_scores() {
  Scores scores;
  scores.octomap = scoring::OctomapScore{4000, 50, 20, 0.01, 0.005};
  scoring::ExactScore exact;
  exact.right = 0.94;
  exact.buried = 0.03;
  exact.floating = 0.02;
  exact.flipped = 0.01;
  exact.miss_2cm = 0.0005;
  exact.label_ok = 0.98;
  scores.exact = exact;
  return scores;
}

/// Yardsticks that have got a frame of a camera with fx = 500 and fy = 510.
std::unique_ptr<Yardsticks> yardsticks_of_a_frame(const OctomapResolution& octomap_resolution) {
  const std::vector<float> depth(8 * 8, 1.0F);
  DepthFrame frame;
  frame.depth = {8, 8, 8 * sizeof(float), DepthImage::Encoding::kMetresF32, depth.data(), false};
  frame.intrinsics = {500, 510, 4, 4, 8, 8};
  frame.T_world_camera = Eigen::Isometry3d::Identity();
  auto yardsticks = std::make_unique<Yardsticks>(Config(), octomap_resolution, true);
  yardsticks->add(frame, frame.T_world_camera);
  return yardsticks;
}

/// Neighbouring pixels, of which every fourth is used, are 4 z / fx apart. The default z_max is 3 m.
TEST(Yardsticks, OctomapsAutomaticResolutionIsThePixelSpacing) {
  const auto automatic = yardsticks_of_a_frame(std::nullopt);
  EXPECT_DOUBLE_EQ(automatic->octomap_resolution(), 4 * 3.0 / 500);
  ASSERT_TRUE(automatic->octomap());
  EXPECT_FLOAT_EQ(automatic->octomap_boundary().at(0).radius, std::sqrt(3.0) / 2 * 4 * 3.0 / 500);

  const auto given = yardsticks_of_a_frame(0.01), none = yardsticks_of_a_frame(0);
  EXPECT_EQ(given->octomap_resolution(), 0.01);
  EXPECT_FLOAT_EQ(given->octomap_boundary().at(0).radius, std::sqrt(3.0) / 2 * 0.01);
  EXPECT_DOUBLE_EQ(given->pixel_spacing(), 4 * 3.0 / 500);
  EXPECT_FALSE(none->octomap());
}

TEST(TimeStatistics, OfFiveValues) {
  const TimeStatistics time = time_statistics({9, 1, 3, 5, 7});
  EXPECT_DOUBLE_EQ(time.mean, 5);
  EXPECT_DOUBLE_EQ(time.median, 5);
  EXPECT_DOUBLE_EQ(time.p95, 9);
  EXPECT_DOUBLE_EQ(time.max, 9);
  EXPECT_NEAR(time.rsd_percent, 100 * std::sqrt(10.0) / 5, 1e-9);  // squares 16 + 4 + 0 + 4 + 16 = 40, over n - 1 = 4
}

TEST(TimeStatistics, MedianOfAnEvenNumberIsTheMeanOfTheMiddleTwo) { EXPECT_DOUBLE_EQ(time_statistics({8, 1, 2, 4}).median, 3); }

TEST(TimeStatistics, PercentileIsByNearestRank) {
  std::vector<double> values;
  for (int i = 20; i >= 1; --i) values.push_back(i);
  EXPECT_DOUBLE_EQ(time_statistics(values).p95, 19);  // ceil(0.95 * 20) = 19th
  values.push_back(21);
  EXPECT_DOUBLE_EQ(time_statistics(values).p95, 20);  // ceil(0.95 * 21) = ceil(19.95) = 20th
}

TEST(TimeStatistics, OfOneValueAndOfZeros) {
  const TimeStatistics one = time_statistics({4});
  EXPECT_DOUBLE_EQ(one.p95, 4);
  EXPECT_DOUBLE_EQ(one.median, 4);
  EXPECT_DOUBLE_EQ(one.rsd_percent, 0);
  EXPECT_DOUBLE_EQ(time_statistics({0, 0, 0}).rsd_percent, 0);
}

TEST(WarmFrames, LeaveOutTheFirstFiveOnlyOfMoreThanTen) {
  EXPECT_EQ(warm_frames(frames(10)).size(), 10u);
  ASSERT_EQ(warm_frames(frames(11)).size(), 6u);
  EXPECT_DOUBLE_EQ(warm_frames(frames(11)).front().report.total_ms, 6);
}

TEST(StageNames, StagesThatStartLaterTakeTheirPlace) {
  std::vector<FrameRecord> records(3);
  records[0].report.stages = {{"first", 1}, {"last", 1}};
  records[1].report.stages = {{"first", 1}, {"second", 1}, {"third", 1}, {"last", 1}};
  records[2].report.stages = {{"zeroth", 1}, {"second", 1}, {"last", 1}, {"after", 1}};
  EXPECT_EQ(stage_names(records), (Keys{"zeroth", "first", "second", "third", "last", "after"}));
}

TEST(Summary, HasExactlyTheKeysOfTheInterface) {
  const auto yardsticks = yardsticks_of_a_frame(0.02);
  const ordered_json json = summary_json({"a/folder", {}}, run_of(12), *yardsticks, some_scores());
  EXPECT_EQ(keys(json), (Keys{"input", "version", "date", "world_frame", "warnings", "reasons", "notes", "skipped", "config", "device",
                              "surfels", "map_checksum", "pose_corrections", "time_ms", "cpu_ms", "memory_mb", "octomap", "exact"}));
  EXPECT_EQ(keys(json["input"]), (Keys{"path", "frames", "skipped"}));
  EXPECT_EQ(keys(json["surfels"]), (Keys{"total", "occupied", "frontier", "taken_back", "map_bytes", "seen_bytes"}));
  EXPECT_EQ(keys(json["pose_corrections"]), (Keys{"shift_mm", "turn_deg"}));
  EXPECT_EQ(keys(json["pose_corrections"]["shift_mm"]), (Keys{"median", "p95"}));
  EXPECT_EQ(keys(json["time_ms"]), (Keys{"mean", "median", "p95", "max", "rsd_percent", "stages"}));
  EXPECT_EQ(keys(json["time_ms"]["stages"]), (Keys{"sweeps", "median"}));
  EXPECT_EQ(keys(json["time_ms"]["stages"]["sweeps"]), (Keys{"mean", "median"}));
  EXPECT_EQ(keys(json["memory_mb"]), (Keys{"peak_rss", "device"}));
  EXPECT_EQ(keys(json["octomap"]),
            (Keys{"resolution", "pixel_spacing", "time_ms", "cpu_ms", "memory_mb", "surfels", "fp", "fn", "fdr", "for"}));
  EXPECT_EQ(keys(json["octomap"]["time_ms"]), (Keys{"mean", "median"}));
  EXPECT_EQ(keys(json["octomap"]["cpu_ms"]), (Keys{"mean", "median"}));
  EXPECT_EQ(keys(json["cpu_ms"]), (Keys{"mean", "median"}));
  EXPECT_EQ(keys(json["exact"]), (Keys{"right", "buried", "floating", "flipped", "within_1v", "within_2v", "fdr_2cm", "fdr_5cm", "miss_1cm",
                                       "miss_2cm", "miss_5cm", "label_ok"}));
}

TEST(Summary, HasTheRunsValues) {
  const auto yardsticks = yardsticks_of_a_frame(0.02);
  const ordered_json json = summary_json({"a/folder", {}}, run_of(12), *yardsticks, some_scores());
  EXPECT_EQ(json["input"]["path"], "a/folder");
  EXPECT_EQ(json["input"]["frames"], 12);
  EXPECT_EQ(json["input"]["skipped"], 2);
  EXPECT_EQ(json["surfels"]["total"], 5000);
  EXPECT_EQ(json["surfels"]["occupied"], 3000);
  EXPECT_EQ(json["surfels"]["map_bytes"], 80000);
  EXPECT_EQ(json["surfels"]["seen_bytes"], 7000);
  EXPECT_EQ(json["map_checksum"], checksum_text(map_checksum(run_of(12).surfels)));
  // Of frames 0, 1, ... 11, moved by as many mm
  EXPECT_NEAR(json["pose_corrections"]["shift_mm"]["median"], 5.5, 1e-9);
  EXPECT_NEAR(json["pose_corrections"]["shift_mm"]["p95"], 11, 1e-9);
  EXPECT_NEAR(json["pose_corrections"]["turn_deg"]["p95"], 0, 1e-6);
  // Frames 6 to 12, of 6, 7, ... 12 ms
  EXPECT_DOUBLE_EQ(json["time_ms"]["mean"], 9);
  EXPECT_DOUBLE_EQ(json["time_ms"]["max"], 12);
  EXPECT_DOUBLE_EQ(json["time_ms"]["stages"]["sweeps"]["mean"], 2.25);
  // Halves of 6, 8, 10, 12 ms, and three frames without this stage
  EXPECT_DOUBLE_EQ(json["time_ms"]["stages"]["median"]["mean"], 18.0 / 7);
  EXPECT_DOUBLE_EQ(json["time_ms"]["stages"]["median"]["median"], 3);
  EXPECT_DOUBLE_EQ(json["memory_mb"]["peak_rss"], 321.5);
  EXPECT_DOUBLE_EQ(json["memory_mb"]["device"], 64.5);
  EXPECT_DOUBLE_EQ(json["octomap"]["time_ms"]["median"], 900);
  EXPECT_DOUBLE_EQ(json["octomap"]["for"], 0.005);
  EXPECT_DOUBLE_EQ(json["octomap"]["resolution"], 0.02);
  EXPECT_DOUBLE_EQ(json["octomap"]["pixel_spacing"], 4 * 3.0 / 500);
  EXPECT_DOUBLE_EQ(json["cpu_ms"]["median"], 18);
  EXPECT_DOUBLE_EQ(json["octomap"]["cpu_ms"]["median"], 810);
  EXPECT_EQ(json["octomap"]["fp"], 50);
  EXPECT_DOUBLE_EQ(json["exact"]["right"], 0.94);
  EXPECT_DOUBLE_EQ(json["exact"]["miss_2cm"], 0.0005);
}

/// Graphics processors measure the stages in few frames: Config::stage_times_every.
TEST(Summary, TimesOfStagesAreThoseOfTimedFrames) {
  const auto yardsticks = yardsticks_of_a_frame(0.02);
  auto run = run_of(12);
  for (FrameRecord& frame : run.frames)
    if (frame.report.total_ms != 8) frame.report.stages.clear();
  ordered_json json = summary_json({"a/folder", {}}, run, *yardsticks, some_scores());
  EXPECT_DOUBLE_EQ(json["time_ms"]["mean"], 9);
  EXPECT_DOUBLE_EQ(json["time_ms"]["stages"]["sweeps"]["mean"], 2);
  EXPECT_DOUBLE_EQ(json["time_ms"]["stages"]["median"]["median"], 4);
  run.frames[7].report.stages.clear();
  run.frames[0].report.stages = {{"sweeps", 1}};  // a frame of the warm-up
  json = summary_json({"a/folder", {}}, run, *yardsticks, some_scores());
  EXPECT_TRUE(json["time_ms"]["stages"].empty());
}

TEST(Summary, HasNoPoseCorrectionsIfThereAreNone) {
  auto run = run_of(12);
  run.config.correct_poses = false;
  const Yardsticks none(Config(), 0, false);
  const ordered_json json = summary_json({"a/folder", {}}, run, none, {});
  EXPECT_FALSE(json.contains("pose_corrections"));
  EXPECT_EQ(result_table(json).find("poses"), std::string::npos);
}

TEST(Summary, LeavesOutWhatWasNotMeasured) {
  const Yardsticks none(Config(), 0, false);
  const ordered_json json = summary_json({"a", {}}, run_of(3), none, {});
  EXPECT_FALSE(json.contains("octomap"));
  EXPECT_FALSE(json.contains("exact"));
  EXPECT_NE(result_table(json).find("median 2.0 ms"), std::string::npos) << result_table(json);
}

TEST(Summary, TellsOfOctomapsGapsWhereThereAreSome) {
  for (const bool gaps : {false, true}) {
    const auto yardsticks = yardsticks_of_a_frame(gaps ? OctomapResolution(0.01) : std::nullopt);
    const std::string table = result_table(summary_json({"a", {}}, run_of(3), *yardsticks, some_scores()));
    EXPECT_EQ(table.find("OctoMap's own gaps") != std::string::npos, gaps) << table;
    EXPECT_NE(table.find(gaps ? "voxels of 10.0 mm" : "voxels of 24.0 mm"), std::string::npos) << table;
  }
}

/// A mapper in another process: its CPU time is not known.
TEST(Summary, HasNoCpuTimeThatWasNotMeasured) {
  auto run = run_of(3);
  for (FrameRecord& record : run.frames) record.cpu_ms = 0;
  EXPECT_FALSE(summary_json({"a", {}}, run, *yardsticks_of_a_frame(0.02), some_scores()).contains("cpu_ms"));
}

TEST(Summary, ConfigurationKeepsNamesAndKinds) {
  Config config;
  config.th_d = 0.25;
  const ordered_json json = config_json(config);
  Keys names;
  for_each_field(config, [&names](const FieldInfo& info, const auto&) { names.push_back(info.name); });
  EXPECT_EQ(keys(json), names);
  EXPECT_DOUBLE_EQ(json["th_d"], 0.25);
  EXPECT_TRUE(json["decimation"].is_number_integer());
  EXPECT_TRUE(json["carve_no_return"].is_boolean());
  EXPECT_TRUE(json["device_type"].is_string());
}

TEST(FramesCsv, NumbersReadBackExactly) {
  std::vector<FrameRecord> records = frames(2);
  records[0].report.total_ms = 1.0 / 3;
  records[1].report.total_ms = std::nextafter(0.1, 1.0);
  std::istringstream csv(frames_csv(records));
  std::string line;
  ASSERT_TRUE(std::getline(csv, line));
  EXPECT_EQ(line, "stamp,surfels,created,removed,sweeps,median,total,octomap_ms,reason");
  for (const FrameRecord& record : records) {
    ASSERT_TRUE(std::getline(csv, line));
    std::vector<double> values;
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',') && !cell.empty();) values.push_back(std::stod(cell));
    const Report& report = record.report;
    const double median = report.stages.size() > 1 ? report.stages[1].ms : 0;
    const std::vector<double> expected = {report.stamp,
                                          static_cast<double>(report.surfels),
                                          static_cast<double>(report.created),
                                          static_cast<double>(report.removed),
                                          report.stages[0].ms,
                                          median,
                                          report.total_ms,
                                          record.octomap->wall_ms};
    EXPECT_EQ(values, expected) << line;
  }
  EXPECT_FALSE(std::getline(csv, line));
}

TEST(FramesCsv, HasNoOctomapColumnWithoutOctomap) {
  std::vector<FrameRecord> records = frames(1);
  records[0].octomap.reset();
  EXPECT_EQ(frames_csv(records), "stamp,surfels,created,removed,sweeps,total,reason\n1305031102.160407,1000,1200,200,0.25,1.0,\n");
}

TEST(Trajectory, IsInTumsFormat) {
  std::istringstream text(trajectory_text({frame(1)}));
  std::string comment;
  std::getline(text, comment);
  EXPECT_EQ(comment.front(), '#');
  double stamp, x, y, z, qx, qy, qz, qw;
  ASSERT_TRUE(text >> stamp >> x >> y >> z >> qx >> qy >> qz >> qw);
  EXPECT_DOUBLE_EQ(stamp, frame(1).report.stamp);
  EXPECT_DOUBLE_EQ(x, 1);
  EXPECT_DOUBLE_EQ(y, 0.1);
  EXPECT_DOUBLE_EQ(z, -1.999);  // as it was mapped
  EXPECT_NEAR(qz, std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(qw, std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(qx, 0, 1e-12);
  EXPECT_NEAR(qy, 0, 1e-12);
}

TEST(WriteFile, RefusesAFolderThatIsNotThere) {
  const std::string path = (std::filesystem::temp_directory_path() / "frontier_surfels_no_such_folder" / "x").string();
  EXPECT_THROW(write_file(path, "text"), FileError);
}

TEST(Sweep, ValuesAreEquallySpaced) {
  const Sweep sweep = parse_sweep("th_d=0.01:0.42:9", {});
  EXPECT_EQ(sweep.parameter, "th_d");
  ASSERT_EQ(sweep.configs.size(), 9u);
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(sweep.configs[i].th_d, 0.01 + 0.41 * i / 8, 1e-12);
  EXPECT_DOUBLE_EQ(sweep.configs[8].peak, Config().peak);
}

TEST(Sweep, WholeNumbersAreRoundedAndNotRepeated) {
  const Sweep sweep = parse_sweep("recent_views=0:2:5", {});  // 0, 0.5, 1, 1.5, 2
  ASSERT_EQ(sweep.configs.size(), 3u);
  EXPECT_EQ(sweep.configs[0].recent_views, 0);
  EXPECT_EQ(sweep.configs[1].recent_views, 1);
  EXPECT_EQ(sweep.configs[2].recent_views, 2);
}

TEST(Sweep, RefusesWhatItCannotDo) {
  for (const char* text :
       {"th_d", "th_d=0.1:0.2", "th_d=0.1:0.2:1", "th_d=0.2:0.1:3", "th_d=0.1:nan:3", "th_d=0.1x:0.2:3", "th_d=0.1:0.2:99999",
        "no_such=0:1:3", "device_type=0:1:3", "carve_no_return=0:1:2", "th_d=0.1:5:3", "decimation=0:4:5"}) {
    EXPECT_THROW(parse_sweep(text, {}), Error) << text;
  }
}

TEST(Sweep, RefusesToBeginWithAnotherValuesMap) {
  Config base;
  base.map_folder = "kept";
  EXPECT_THROW(parse_sweep("th_d=0.1:0.2:2", base), Error);
}

TEST(Sweep, OtherDepthRangeOrPixelsNeedOtherYardsticks) {
  const Yardsticks yardsticks(Config(), 0, false);
  Config config;
  config.th_d = 0.1;
  EXPECT_TRUE(yardsticks.fit(config));
  config.z_max = 2;
  EXPECT_FALSE(yardsticks.fit(config));
  config = Config();
  config.decimation = 8;
  EXPECT_FALSE(yardsticks.fit(config));
  for (bool Config::*reading : {&Config::carve_no_return, &Config::carve_beyond_range, &Config::correct_poses}) {
    config = Config();
    config.*reading = !(config.*reading);
    EXPECT_FALSE(yardsticks.fit(config));
  }
}

TEST(Progress, ShowsShareRateAndTimeLeft) {
  EXPECT_EQ(Progress::line("Mapping", 50, 200, "frames", 10),
            "Mapping  [#######.......................]  25 %  50/200 frames  5/s  0:30 left");
  EXPECT_EQ(Progress::line("Scoring", 0.5, 1, "", 90), "Scoring  [###############...............]  50 %  1:30 left");
  EXPECT_EQ(Progress::line("Mapping", 0, 0, "frames", 0), "Mapping  [..............................]   0 %  0/0 frames");
  EXPECT_EQ(Progress::line("Mapping", 0, 7, "frames", 3), "Mapping  [..............................]   0 %  0/7 frames");
}

}  // namespace
}  // namespace frontier_surfels::replay
