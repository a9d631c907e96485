/// report.html, which the script replay_report.py makes of the other files.
#pragma once

#include <string>

namespace frontier_surfels::replay {

/// @throws Error: Python, the script or one of its modules is missing, or it failed; all other files stay as they are
void make_report_page(const std::string& directory);

}  // namespace frontier_surfels::replay
