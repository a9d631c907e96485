/// Work on the rows of an image by several threads.
#pragma once

#include <algorithm>
#include <future>
#include <system_error>
#include <vector>

#include "config/threads.hpp"

namespace frontier_surfels {

/// Calls work(first, last) for bands of rows, first ... last - 1, that make up all rows, on `threads` threads, the calling one among them.
/// An exception of any of them is thrown again here. @param threads  Config::threads
template <typename Work>
void in_row_bands(int rows, int threads, Work work) {
  constexpr int kMostThreads = 8, kLeastRows = 16;  // more threads would take longer to start than they save
  const int bands = std::clamp(std::min(threads_of_host(threads), rows / kLeastRows), 1, kMostThreads);
  const auto begin = [&](int band) { return static_cast<int>(static_cast<long>(rows) * band / bands); };
  std::vector<std::future<void>> others;
  int band = 1;
  try {
    for (; band < bands; ++band) others.push_back(std::async(std::launch::async, work, begin(band), begin(band + 1)));
  } catch (const std::system_error&) {  // no more threads: the rest is done here
  }
  work(0, begin(1));
  if (band < bands) work(begin(band), rows);
  for (std::future<void>& other : others) other.get();
}

}  // namespace frontier_surfels
