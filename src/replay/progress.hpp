/// A progress bar with rate and time left; silent where standard error is not a terminal.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>

namespace frontier_surfels::replay {

class Progress {
 public:
  /// @param total  of what update() counts
  /// @param unit   what is counted, in the plural; empty: only the share is shown
  Progress(std::string title, double total, std::string unit = "");
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Redraws the bar, ten times a second at most.
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
