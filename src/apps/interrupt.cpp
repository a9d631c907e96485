#include "apps/interrupt.hpp"

#include <signal.h>

namespace frontier_surfels::replay {
namespace {

volatile sig_atomic_t interrupted = 0;

}  // namespace

bool stop_requested() { return interrupted != 0; }

void catch_first_interrupt() {
  struct sigaction action {};
  action.sa_handler = [](int) { interrupted = 1; };
  action.sa_flags = SA_RESETHAND | SA_RESTART;
  sigaction(SIGINT, &action, nullptr);
}

}  // namespace frontier_surfels::replay
