/// Simulates a full disk for this process.
#pragma once

#include <sys/resource.h>

namespace frontier_surfels {

/// Limits the size of every file to `max_bytes` if `full`, else lifts the limit. SIGXFSZ must be ignored, so that write() fails instead.
inline void limit_file_size(bool full, rlim_t max_bytes = rlim_t{4} << 20) {
  rlimit now;
  getrlimit(RLIMIT_FSIZE, &now);
  now.rlim_cur = full ? max_bytes : now.rlim_max;
  setrlimit(RLIMIT_FSIZE, &now);
}

}  // namespace frontier_surfels
