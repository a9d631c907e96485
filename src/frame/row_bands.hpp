/// Work on the rows of an image by several threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <future>
#include <system_error>
#include <vector>

#include "config/threads.hpp"

namespace frontier_surfels {

/// Calls work(first, last) for bands of rows, first ... last - 1, that make up all rows, on `threads` threads, the calling one among them.
/// An exception of any of them is thrown again here.
/// @param values   numbers that are read for all rows together
/// @param threads  Config::threads
template <typename Work>
void in_row_bands(int rows, std::size_t values, int threads, Work work) {
  // To start a thread takes 25 to 50 us, one after the other. So many values take about four times as long: a smaller band would not be
  // worth a thread.
  constexpr std::size_t kLeastValues = 100000;
  constexpr int kMostThreads = 8, kLeastRows = 16;
  const int worth = static_cast<int>(std::min<std::size_t>(values / kLeastValues, kMostThreads));
  const int bands = std::max(1, std::min({threads_of_host(threads), rows / kLeastRows, worth}));
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
