#include "replay/report_folder.hpp"

#include <fstream>
#include <string>
#include <system_error>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels::replay {
namespace fs = std::filesystem;
namespace {

constexpr const char* kPage = "report.html";
constexpr const char* kFiles[] = {"summary.json", "frames.csv",   "trajectory.txt", "surfels.ply",
                                  "octomap.ply",  "verdicts.bin", "sweep.json",     kPage};

/// Removes the files of a report, also those that a killed program was writing, and nothing else.
void remove_files(const fs::path& folder) {
  std::error_code ignored;
  for (const std::string name : kFiles) {
    fs::remove(folder / name, ignored);
    fs::remove(folder / (name + ".unfinished"), ignored);
  }
}

bool can_be_written(const fs::path& folder) {
  const fs::path probe = folder / kFiles[0];
  std::error_code ignored;
  const bool written = static_cast<bool>(std::ofstream(probe));
  fs::remove(probe, ignored);
  return written;
}

}  // namespace

ReportFolder::ReportFolder(const fs::path& folder) : folder_(folder), unfinished_(folder / "unfinished_report") {
  std::error_code error;
  is_new_ = !fs::exists(folder_, error);
  fs::create_directories(folder_, error);
  fs::create_directory(unfinished_, error);
  if (!fs::is_directory(unfinished_, error) || !can_be_written(unfinished_)) {
    throw FileError("The report's folder '" + folder_.string() + "' cannot be made or written: choose another with --report.");
  }
  remove_files(unfinished_);  // of a run that was killed
}

ReportFolder::~ReportFolder() {
  if (is_kept_) return;
  std::error_code ignored;
  remove_files(unfinished_);
  fs::remove(unfinished_, ignored);
  if (is_new_) fs::remove(folder_, ignored);  // does nothing if there are files in it
}

/// Nothing of the earlier report is removed before all new files are in their places.
void ReportFolder::commit() {
  const auto check = [this](const std::error_code& error, const char* name) {
    if (!error) return;
    throw FileError("'" + (folder_ / name).string() + "' cannot be replaced (" + error.message() +
                    "): check that the folder and its files are yours.");
  };
  std::error_code error;
  std::vector<const char*> absent;
  for (const char* name : kFiles) {
    if (fs::exists(unfinished_ / name)) {
      fs::rename(unfinished_ / name, folder_ / name, error);
      check(error, name);
    } else {
      absent.push_back(name);
    }
  }
  for (const char* name : absent) fs::remove(folder_ / name, error);
}

const fs::path& ReportFolder::kept() const {
  std::error_code ignored;
  return fs::exists(folder_ / kPage, ignored) ? unfinished_ : folder_;
}

void ReportFolder::keep() {
  if (kept() == folder_) return commit();
  is_kept_ = true;
}

}  // namespace frontier_surfels::replay
