// What summary.json and the table on the terminal say of a truth.
#include <gtest/gtest.h>

#include "replay/objects_summary.hpp"
#include "replay/summary.hpp"

namespace frontier_surfels::replay {
namespace {

using nlohmann::ordered_json;
using scoring::FacesCovered;
using scoring::LeftSurfels;
using scoring::ObjectScore;
using scoring::StandScore;

Run some_run() {
  Run run;
  FrameRecord frame;
  frame.report.total_ms = 1;
  frame.T_world_camera = Eigen::Isometry3d::Identity();
  frame.octomap = scoring::InsertionTime{3, 3};
  run.frames = {frame};
  return run;
}

scoring::ExactScore exact_score(double right) {
  scoring::ExactScore score;
  score.right = right;
  score.fdr_2cm = right / 2;
  return score;
}

StandScore stand(std::size_t first, std::size_t last) {
  StandScore score;
  score.first = first;
  score.last = last;
  return score;
}

/// A box that is seen, goes, comes back unseen, and leaves surfels behind, and a person who does not stand anywhere.
std::vector<ObjectScore> some_objects() {
  StandScore seen = stand(10, 50);
  seen.first_seen = 12;
  seen.faces = {{0.17, FacesCovered{100, 0.25}, FacesCovered{200, 0.5}}, {0.1, std::nullopt, FacesCovered{250, 0.125}}};
  return {{"box", {seen, stand(60, 70)}, LeftSurfels{3, 4}, LeftSurfels{30, 40}}, {"person", {}, LeftSurfels{}, std::nullopt}};
}

/// Yardsticks with an OctoMap, which has got a frame.
std::unique_ptr<Yardsticks> yardsticks_of_a_frame() {
  const std::vector<float> depth(8 * 8, 1.0F);
  DepthFrame frame;
  frame.depth = {8, 8, 8 * sizeof(float), DepthImage::Encoding::kMetresF32, depth.data(), false};
  frame.intrinsics = {500, 510, 4, 4, 8, 8};
  frame.T_world_camera = Eigen::Isometry3d::Identity();
  auto yardsticks = std::make_unique<Yardsticks>(Config(), 0.02, true);
  yardsticks->add(frame, frame.T_world_camera);
  return yardsticks;
}

Scores all_scores() {
  Scores scores;
  scores.octomap = scoring::OctomapScore{4000, 50, 20, 0.01, 0.005};
  scores.exact = exact_score(0.875);
  scores.truth = exact_score(0.75);
  scores.octomap_exact = exact_score(0.625);
  scores.octomap_truth = exact_score(0.5);
  scores.objects = some_objects();
  return scores;
}

TEST(SummaryOfTruth, StandsBesideTheExactTest) {
  const ordered_json json = summary_json({"a", {}}, some_run(), *yardsticks_of_a_frame(), all_scores());
  EXPECT_EQ(json["exact"]["right"], 0.875);
  EXPECT_EQ(json["truth"]["right"], 0.75);
  EXPECT_EQ(json["octomap"]["exact"]["right"], 0.625);
  EXPECT_EQ(json["octomap"]["truth"]["right"], 0.5);
  EXPECT_EQ(json["objects"], objects_json(some_objects()));
  for (const char* part : {"truth", "exact"}) {
    EXPECT_EQ(json[part].size(), json["octomap"][part].size());
    for (const auto& figure : json[part].items()) EXPECT_TRUE(json["octomap"][part].contains(figure.key())) << figure.key();
  }
}

TEST(SummaryOfTruth, IsAbsentWithoutOne) {
  Scores scores = all_scores();
  scores.truth = scores.octomap_exact = scores.octomap_truth = std::nullopt;
  scores.objects.clear();
  const ordered_json json = summary_json({"a", {}}, some_run(), *yardsticks_of_a_frame(), scores);
  for (const char* key : {"truth", "objects"}) EXPECT_FALSE(json.contains(key)) << key;
  for (const char* key : {"exact", "truth"}) EXPECT_FALSE(json["octomap"].contains(key)) << key;
  EXPECT_FALSE(json["input"].contains("truth"));
  EXPECT_EQ(result_table(json).find("truth"), std::string::npos);
}

TEST(SummaryOfTruth, ObjectsHaveOnlyTheFiguresThatThereAre) {
  const ordered_json expected = ordered_json::parse(R"([
    {"name": "box",
     "stands": [{"first": 10, "last": 50, "first_seen": 12,
                 "faces": [{"cosine": 0.17, "early_points": 100, "early_covered": 0.25, "points": 200, "covered": 0.5},
                           {"cosine": 0.1, "points": 250, "covered": 0.125}]},
                {"first": 60, "last": 70, "faces": []}],
     "left": {"occupied": 3, "frontier": 4}, "most_left": {"occupied": 30, "frontier": 40}},
    {"name": "person", "stands": [], "left": {"occupied": 0, "frontier": 0}}])");
  EXPECT_EQ(objects_json(some_objects()), expected);
}

TEST(SummaryOfTruth, TheTableHasALineForEachJudgeAndThing) {
  const std::string table = result_table(summary_json({"a", {}}, some_run(), *yardsticks_of_a_frame(), all_scores()));
  for (const char* line :
       {"\nexact test  right 87.50 %; more than 2 cm off 43.75 %;", "\ntruth       right 75.00 %; more than 2 cm off 37.50 %;",
        "\n            exact test: right 62.50 %;", "\n            truth: right 50.00 %;",
        "\nbox         frames 10 to 50, seen from 12: faces with occupied surfels 25.00 % (0.17) after 8 frames, 50.00 % (0.17), 12.50 % "
        "(0.10) at the end\n",
        "\n            frames 60 to 70: never seen\n",
        "\n            left where it was: 3 occupied, 4 frontier; at most 30 and 40 in any frame\n",
        "\nperson      left where it was: 0 occupied, 0 frontier\n"})
    EXPECT_NE(table.find(line), std::string::npos) << line << "\nis not in\n" << table;
}

}  // namespace
}  // namespace frontier_surfels::replay
