/// Ctrl-C asks a program to end with what it has done.
#pragma once

namespace frontier_surfels::replay {

/// From now on the first Ctrl-C only asks to stop; the second ends the program at once.
void catch_first_interrupt();

/// Whether it came.
bool stop_requested();

}  // namespace frontier_surfels::replay
