/// A progress bar with rate and time left, on standard error. Nothing is shown if that is not a terminal.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>

namespace frontier_surfels::replay {

class Progress {
 public:
  /// @param total  the value of update() at the end
  /// @param unit   name of what is counted, in the plural; empty: only the share is shown
  Progress(std::string title, double total, std::string unit = "");
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Sets how much is done. Redraws the bar at most ten times a second.
  void update(double done);

  /// The bar's text, without the terminal's control characters.
  static std::string line(const std::string& title, double done, double total, const std::string& unit, double elapsed_s);

 private:
  using Clock = std::chrono::steady_clock;
  void draw();

  std::string title_;
  double total_;
  std::string unit_;
  bool visible_;
  double done_ = 0;
  Clock::time_point start_ = Clock::now();
  Clock::time_point drawn_ = start_;
};

}  // namespace frontier_surfels::replay
