/// Checks of a bag's structure before rosbag reads it.
#pragma once

#include <string>

namespace frontier_surfels::replay {

/// Checks that all lengths, positions and offsets of a bag lie where they must. rosbag trusts them: where they are wrong, it ends the
/// program, never returns, or reads memory that is not its own. The contents of messages are not checked.
/// @throws Error that says what is wrong and what to do
void check_bag(const std::string& path);

}  // namespace frontier_surfels::replay
