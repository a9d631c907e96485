/// How many threads of the host a parameter asks for.
#pragma once

#include <algorithm>
#include <thread>

namespace frontier_surfels {

/// @param wanted  Config::threads; 0: as many as the machine has. @return at most that many
inline int threads_of_host(int wanted) {
  const int most = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  return wanted == 0 ? most : std::min(wanted, most);
}

}  // namespace frontier_surfels
