/// Ctrl-C as a request to stop early and keep what has been done.
#pragma once

namespace frontier_surfels::replay {

/// From now on the first Ctrl-C only requests a stop. The second one ends the program at once.
void catch_first_interrupt();

/// Whether Ctrl-C has been pressed.
bool stop_requested();

}  // namespace frontier_surfels::replay
