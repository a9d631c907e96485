/// Makes report.html from the other files of a report, with the script replay_report.py.
#pragma once

#include <string>

namespace frontier_surfels::replay {

/// @param directory  of the other files, and of the page
/// @param kept       folder to which the caller moves the other files if there is no page, for the message
/// @throws Error  if Python, the script or one of its modules is missing, or the script fails; all other files stay as they are
void make_report_page(const std::string& directory, const std::string& kept);

}  // namespace frontier_surfels::replay
