/// CPU time, of the process or of a thread.
#pragma once

#include <time.h>

namespace frontier_surfels::scoring {

/// @param clock  CLOCK_PROCESS_CPUTIME_ID or CLOCK_THREAD_CPUTIME_ID. @return user and system time so far [ms]
inline double cpu_ms(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return time.tv_sec * 1e3 + time.tv_nsec / 1e6;
}

}  // namespace frontier_surfels::scoring
