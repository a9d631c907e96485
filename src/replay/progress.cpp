#include "replay/progress.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "config/c_locale.hpp"

namespace frontier_surfels::replay {

Progress::Progress(std::string title, double total, std::string unit)
    : title_(std::move(title)), total_(total), unit_(std::move(unit)), visible_(isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() {
  if (!visible_) return;
  draw();
  std::fputc('\n', stderr);
}

void Progress::update(double done) {
  done_ = done;
  if (!visible_ || Clock::now() - drawn_ < std::chrono::milliseconds(100)) return;
  draw();
  drawn_ = Clock::now();
}

void Progress::draw() {
  const double elapsed_s = std::chrono::duration<double>(Clock::now() - start_).count();
  std::fprintf(stderr, "\r%s\033[K", line(title_, done_, total_, unit_, elapsed_s).c_str());
  std::fflush(stderr);
}

std::string Progress::line(const std::string& title, double done, double total, const std::string& unit, double elapsed_s) {
  constexpr int kWidth = 30;
  const double share = total > 0 ? std::clamp(done / total, 0.0, 1.0) : 0;
  const int filled = static_cast<int>(share * kWidth);
  const CLocale c_locale;
  char text[200];
  std::snprintf(text, sizeof(text), "%-8s [%s%s] %3.0f %%", title.c_str(), std::string(filled, '#').c_str(),
                std::string(kWidth - filled, '.').c_str(), 100 * share);
  std::string result = text;
  if (!unit.empty()) {
    std::snprintf(text, sizeof(text), "  %.0f/%.0f %s", done, total, unit.c_str());
    result += text;
  }
  if (done <= 0 || elapsed_s <= 0) return result;
  if (!unit.empty()) {
    std::snprintf(text, sizeof(text), "  %.3g/s", done / elapsed_s);
    result += text;
  }
  const auto left_s = static_cast<long>(elapsed_s * (1 - share) / share + 0.5);
  std::snprintf(text, sizeof(text), "  %ld:%02ld left", left_s / 60, left_s % 60);
  return result + text;
}

}  // namespace frontier_surfels::replay
