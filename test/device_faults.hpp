/// A device that fails at any of its calls: what tests of frames share.
#pragma once

#include <gtest/gtest.h>

#include <limits>
#include <memory>

#include "map_file_input.hpp"
#include "mapper_input.hpp"
#include "opencl/fault_injection.hpp"

namespace frontier_surfels {

inline Intrinsics small_camera() { return replay::synthetic_camera(40, 30); }

constexpr std::size_t kForEver = std::numeric_limits<std::size_t>::max();

inline std::uint64_t frame_before(const Mapper& mapper) { return mapper.sequence() == 0 ? 0 : mapper.sequence() - 1; }

/// All that a user sees of a map. Ids depend on who follows the changes: compare only mappers that have been looked at equally often.
struct Seen {
  explicit Seen(const Mapper& mapper)
      : surfels(mapper.surfels()), last(mapper.changes(frame_before(mapper))), all(mapper.changes(0)), size(mapper.size()) {}

  std::vector<Surfel> surfels;
  Changes last, all;
  std::size_t size;
};

inline testing::AssertionResult same(const Changes& a, const Changes& b) {
  if (a.sequence != b.sequence) return testing::AssertionFailure() << "sequence " << a.sequence << " against " << b.sequence;
  if (a.removed != b.removed)
    return testing::AssertionFailure() << a.removed.size() << " removed surfels against " << b.removed.size() << ", or others";
  return same(a.updated, b.updated);
}

inline void expect_same(const Seen& a, const Seen& b) {
  EXPECT_TRUE(same(a.surfels, b.surfels));
  EXPECT_TRUE(same(a.last, b.last)) << "changes of the last frame";
  EXPECT_TRUE(same(a.all, b.all)) << "all changes";
  EXPECT_EQ(a.size, b.size);
}

class MapperDeviceFaults : public testing::Test {
 protected:
  ~MapperDeviceFaults() override { FaultInjection::stop(); }

  /// Error of an integration in which the device fails; "" if nothing fails.
  static std::string refusal(Mapper& mapper, const replay::RecordedFrame& frame, std::size_t passing, std::size_t failing) {
    FaultInjection::fail(passing, failing);
    return fault_of<DeviceError>([&] { mapper.integrate(frame.view()); });
  }

  /// A mapper of the first frames, whose changes are followed.
  static std::unique_ptr<Mapper> begin(const Config& config, const Frames& frames, std::size_t count) {
    FaultInjection::stop();
    auto mapper = std::make_unique<Mapper>(config);
    for (std::size_t n = 0; n < count; ++n) {
      mapper->changes(frame_before(*mapper));
      mapper->integrate(frames[n].view());
    }
    return mapper;
  }

  /// Lets every call of frame `at` fail once, each in a new mapper. @return number of calls
  static std::size_t fail_everywhere(const Config& config, const Frames& frames, std::size_t at, const Report& wanted) {
    const auto undisturbed = begin(config, frames, at), counted = begin(config, frames, at);
    FaultInjection::stop();
    const Report report = counted->integrate(frames[at].view());
    const std::size_t calls = FaultInjection::count();
    EXPECT_GE(report.split, wanted.split);
    EXPECT_GE(report.removed, wanted.removed);
    EXPECT_GE(report.created, wanted.created);
    EXPECT_GE(report.taken_back, wanted.taken_back);
    const Seen before(*undisturbed);
    const SavedMap memory_before = undisturbed->saved_map();
    undisturbed->integrate(frames[at].view());
    const Seen after(*undisturbed);
    undisturbed->integrate(frames[at + 1].view());
    const Seen later(*undisturbed);
    const SavedMap memory_later = undisturbed->saved_map();
    for (std::size_t n = 0; n < calls && !testing::Test::HasFailure(); ++n) {
      SCOPED_TRACE("call " + std::to_string(n) + " of " + std::to_string(calls));
      const auto mapper = begin(config, frames, at);
      const std::string said = refusal(*mapper, frames[at], n, 1);
      FaultInjection::stop();
      EXPECT_NE(said.find("CL_"), std::string::npos) << said;
      EXPECT_TRUE(contains(said, "this mapper uses ") && contains(said, "of the device's ")) << said;
      EXPECT_TRUE(contains(said, "lower z_max or recent_views")) << said;
      EXPECT_EQ(said.back(), '.') << said;
      expect_same(Seen(*mapper), before);
      if (n % 2 == 0) {  // it ends what a frame would have to
        EXPECT_TRUE(same_memory(mapper->saved_map(), memory_before));
      }
      mapper->integrate(frames[at].view());
      expect_same(Seen(*mapper), after);
      mapper->integrate(frames[at + 1].view());
      expect_same(Seen(*mapper), later);
      EXPECT_TRUE(same_memory(mapper->saved_map(), memory_later));
    }
    return calls;
  }

  /// The device fails from each call of frame 2 on, with the same mapper, until it lasts for the whole frame.
  static void stay_away(const Config& config, const Frames& frames) {
    const auto undisturbed = begin(config, frames, 2), mapper = begin(config, frames, 2);
    const Seen before(*undisturbed);
    expect_same(Seen(*mapper), before);
    undisturbed->integrate(frames[2].view());
    const Seen after(*undisturbed);
    for (std::size_t n = 0; !HasFailure(); ++n) {
      SCOPED_TRACE("from call " + std::to_string(n) + " on");
      const std::string said = refusal(*mapper, frames[2], n, kForEver);
      if (said.empty()) break;
      const std::string later = fault_of<DeviceError>([&] { mapper->surfels(); });
      EXPECT_NE(later.find("CL_OUT_OF_RESOURCES"), std::string::npos) << later;
      EXPECT_EQ(mapper->size(), before.size);
      FaultInjection::stop();
      EXPECT_TRUE(same(mapper->surfels(), before.surfels));
    }
    FaultInjection::stop();
    expect_same(Seen(*mapper), after);
  }
};

/// A camera that comes nearer: surfels are split.
inline Frames approach() {
  const Eigen::Vector3d forward(0, 1, 0);
  Frames frames;
  for (const double depth : {2.5, 1.2, 0.55, 0.5})
    frames.push_back(plane_frame(small_camera(), depth, look_along(-depth * forward, forward)));
  return frames;
}

/// A box that is put down before a wall, and taken away later.
inline Frames box_that_goes() {
  Frames frames;
  for (int n = 0; n < 32; ++n) {
    frames.push_back(plane_frame(small_camera(), 2, Eigen::Isometry3d(Eigen::Translation3d(0.008 * n, 0, 0))));
    if (n >= 12 && n < 30) frames.back().depth(cv::Rect(12, 8, 16, 14)) = 1.5;
  }
  return frames;
}

}  // namespace frontier_surfels
