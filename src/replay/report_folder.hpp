/// The folder of a report, in which a new report replaces an earlier one only when it is complete.
#pragma once

#include <filesystem>

namespace frontier_surfels::replay {

/// A new report is written to the folder `unfinished_report` inside the report's folder. commit() moves its files over those of the earlier
/// report. Without commit() or keep(), the earlier report stays as it was, and the new files are removed.
class ReportFolder {
 public:
  /// Makes the folders, and checks that they can be written before a long run starts. @throws FileError
  explicit ReportFolder(const std::filesystem::path& folder);
  ~ReportFolder();
  ReportFolder(const ReportFolder&) = delete;
  ReportFolder& operator=(const ReportFolder&) = delete;

  /// Folder in which the new report is written.
  const std::filesystem::path& unfinished() const { return unfinished_; }

  /// Moves the new files to the report's folder, and then removes those of an earlier report that have no successor. @throws FileError
  void commit();

  /// Where keep() leaves the new files: in the report's folder, or where they are if that has a page.
  const std::filesystem::path& kept() const;

  /// Keeps new files that have no page, without taking the place of an earlier report that has one. @throws FileError
  void keep();

 private:
  const std::filesystem::path folder_;
  const std::filesystem::path unfinished_;
  bool is_new_ = false;   ///< this object has made the folder
  bool is_kept_ = false;  ///< the new files stay in unfinished_
};

}  // namespace frontier_surfels::replay
