/// Makes HTML pages from the other files of a folder, with Python scripts of this package.
#pragma once

#include <string>

namespace frontier_surfels::replay {

/// @param script     beside this program if that is installed, else in the source tree
/// @param page       the name of the file that it makes, for messages
/// @param directory  of the other files, and of the page
/// @param kept       folder to which the caller moves the other files if there is no page, for the message
/// @throws Error  if Python, the script or one of its modules is missing, or the script fails; all other files stay as they are
void make_page(const std::string& script, const std::string& page, const std::string& directory, const std::string& kept);

/// report.html of replay_score.
inline void make_report_page(const std::string& directory, const std::string& kept) {
  make_page("replay_report.py", "report.html", directory, kept);
}

}  // namespace frontier_surfels::replay
