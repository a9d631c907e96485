#include "ros/exploration/exploration_log.hpp"

#include <ros/console.h>

#include <filesystem>
#include <iomanip>
#include <regex>
#include <sstream>

#include "frontier_surfels/paths.hpp"
#include "frontier_surfels/types.hpp"
#include "replay/report_page.hpp"

namespace frontier_surfels {

std::vector<std::string> strategies_in(const std::string& text) {
  std::istringstream words(text);
  std::vector<std::string> strategies;
  for (std::string word; words >> word;) {
    if (word != "frontiers" && word != "octomap" && word != "nearest" && word != "random")
      throw Error("There is no strategy '" + word + "': ~strategies may name frontiers, octomap, nearest and random.");
    strategies.push_back(word);
  }
  return strategies;
}

ExplorationLog::ExplorationLog(const std::string& folder) {
  if (folder.empty()) return;
  folder_ = absolute_path(folder);
  std::error_code fault;
  std::filesystem::create_directories(folder_, fault);
  const std::regex picture("(frontiers|nearest|random)_[0-9]{4,}\\.ply");  // of an earlier exploration: the page would show them
  for (const auto& entry : std::filesystem::directory_iterator(folder_, fault))
    if (std::regex_match(entry.path().filename().string(), picture)) std::filesystem::remove(entry.path(), fault);
  table_.open(folder_ + "/exploration.csv");
  table_ << "strategy,views,metres,seconds,share,decision_ms,x,y,z" << std::endl;
  if (!table_) throw FileError("Cannot write '" + folder_ + "/exploration.csv': does the folder exist, and may it be written?");
}

void ExplorationLog::add(const std::string& strategy, const Coverage& coverage, double decision_ms, const Eigen::Vector3f& p) {
  if (coverage.views % 20 == 0)
    ROS_INFO("%s: %u views, %.1f m, %.1f %% of what can be seen was seen.", strategy.c_str(), coverage.views, coverage.metres,
             100 * coverage.share);
  if (folder_.empty()) return;
  table_ << strategy << ',' << coverage.views << ',' << coverage.metres << ',' << coverage.seconds << ',' << coverage.share << ','
         << decision_ms << ',' << p.x() << ',' << p.y() << ',' << p.z() << std::endl;
  if (!table_) throw FileError("Cannot write '" + folder_ + "/exploration.csv': is the disk full?");
}

std::optional<std::string> ExplorationLog::picture(const std::string& strategy, const Coverage& coverage, bool at_end) {
  constexpr double kStep = 0.2;
  if (strategy != strategy_) next_picture_ = kStep;
  strategy_ = strategy;
  if (folder_.empty() || (coverage.share < next_picture_ && !at_end)) return {};
  while (next_picture_ <= coverage.share) next_picture_ += kStep;
  std::ostringstream name;
  name << folder_ << '/' << strategy << '_' << std::setw(4) << std::setfill('0') << coverage.views << ".ply";
  return name.str();
}

void ExplorationLog::finish() {
  if (folder_.empty()) return;
  table_.close();
  ROS_INFO("Making the page %s/explore.html.", folder_.c_str());
  replay::make_page("explore_report.py", "explore.html", folder_, folder_);
}

}  // namespace frontier_surfels
