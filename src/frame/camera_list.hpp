/// What is kept of each of the last cameras: a camera is told from others by its intrinsics.
#pragma once

#include <algorithm>
#include <cstddef>
#include <list>
#include <utility>

#include "frame/working_image.hpp"

namespace frontier_surfels {

/// @tparam Entry  has intrinsics(), of the working image
template <typename Entry>
class CameraList {
 public:
  /// @return null if there is none
  const Entry* find(const Intrinsics& intrinsics) const {
    const auto found = find_in(entries_, intrinsics);
    return found == entries_.end() ? nullptr : &*found;
  }

  /// The camera's entry, made of `args` if there is none. It becomes the one used last, and the one used longest ago goes if there are too
  /// many. The reference is valid until the next call.
  template <typename... Args>
  Entry& use(const Intrinsics& intrinsics, Args&&... args) {
    const auto found = find_in(entries_, intrinsics);
    if (found != entries_.end()) {
      entries_.splice(entries_.begin(), entries_, found);
    } else {
      entries_.emplace_front(std::forward<Args>(args)...);
      if (entries_.size() > kMost) entries_.pop_back();
    }
    return entries_.front();
  }

  void clear() { entries_.clear(); }

 private:
  static constexpr std::size_t kMost = 16;  // limits the memory if a driver changes its intrinsics with every frame

  template <typename Entries>
  static auto find_in(Entries& entries, const Intrinsics& intrinsics) {
    return std::find_if(entries.begin(), entries.end(), [&](const Entry& entry) { return same_camera(entry.intrinsics(), intrinsics); });
  }

  std::list<Entry> entries_;  ///< the one used last first
};

}  // namespace frontier_surfels
