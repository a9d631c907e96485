/// A disk that is full, for this process alone.
#pragma once

#include <sys/resource.h>

namespace frontier_surfels {

/// From now on no file may grow beyond `most` bytes, or all may again. SIGXFSZ must be ignored, so that write() fails.
inline void limit_file_size(bool full, rlim_t most = rlim_t{4} << 20) {
  rlimit now;
  getrlimit(RLIMIT_FSIZE, &now);
  now.rlim_cur = full ? most : now.rlim_max;
  setrlimit(RLIMIT_FSIZE, &now);
}

}  // namespace frontier_surfels
