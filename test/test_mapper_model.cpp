/// Random sequences of everything that a user can do with a map, and of failures of the device, against a slow and obvious model of the
/// map.
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <set>
#include <tuple>
#include <utility>

#include "frontier_surfels/map_file.hpp"
#include "mapper_input.hpp"
#include "opencl/fault_injection.hpp"

namespace frontier_surfels {
namespace {

// The sequences are the same in every run. RC_PARAMS='seed=2 max_success=1000' tries others.
const int kParameters = setenv("RC_PARAMS", "seed=1 max_success=25 max_size=40", 0);

enum class Action { kFrame, kFailingFrame, kBadFrame, kSave, kLoad, kFailingLoad, kBadLoad, kReset, kChanges, kFailingChanges, kBox };
constexpr const char* kNames[] = {"frame", "failing frame", "bad frame",       "save", "load", "failing load", "bad load",
                                  "reset", "changes",       "failing changes", "box"};

struct Step {
  Action action = Action::kFrame;
  unsigned which = 0;  ///< frame, or reader of the changes
  unsigned call = 0;   ///< which call of the device fails; in frames, counted from the last one
  bool for_good = false;
};

std::ostream& operator<<(std::ostream& text, const Step& step) {
  return text << kNames[static_cast<int>(step.action)] << ' ' << step.which << " (call " << step.call << (step.for_good ? " on)" : ")");
}

rc::Gen<Step> any_step() {
  const auto below = [](unsigned end) { return rc::gen::resize(rc::kNominalSize, rc::gen::inRange(0U, end)); };
  return rc::gen::build<Step>(rc::gen::set(&Step::action, rc::gen::weightedElement<Action>({{12, Action::kFrame},
                                                                                            {8, Action::kFailingFrame},
                                                                                            {1, Action::kBadFrame},
                                                                                            {2, Action::kSave},
                                                                                            {2, Action::kLoad},
                                                                                            {1, Action::kFailingLoad},
                                                                                            {1, Action::kBadLoad},
                                                                                            {1, Action::kReset},
                                                                                            {6, Action::kChanges},
                                                                                            {1, Action::kFailingChanges},
                                                                                            {1, Action::kBox}})),
                              rc::gen::set(&Step::which, below(12)),
                              rc::gen::set(&Step::call, rc::gen::oneOf(below(12), below(75), below(200))),
                              rc::gen::set(&Step::for_good, rc::gen::arbitrary<bool>()));
}

/// Views around the table, three of a camera that comes nearer to a wall, so that surfels are split, and two far away.
Frames views() {
  const Intrinsics camera = replay::synthetic_camera(24, 16);
  const Eigen::Vector3d forward(0, 1, 0);
  Frames frames = orbit_frames(camera, 7, 6);
  for (const double depth : {2.5, 1.2, 0.55}) frames.push_back(plane_frame(camera, depth, look_along(-depth * forward, forward)));
  for (const double along : {40.0, 41.0}) frames.push_back(plane_frame(camera, 2, look_along(Eigen::Vector3d(along, 0, 0), forward)));
  return frames;
}

/// Surfels without their ids, in an order that does not depend on these.
std::vector<Surfel> without_ids(std::vector<Surfel> surfels) {
  const auto key = [](const Surfel& s) {
    return std::make_tuple(s.position.x(), s.position.y(), s.position.z(), s.normal.x(), s.normal.y(), s.normal.z(), s.radius, s.label,
                           s.rgb);
  };
  for (Surfel& surfel : surfels) surfel.id = 0;
  std::sort(surfels.begin(), surfels.end(), [&](const Surfel& a, const Surfel& b) { return key(a) < key(b); });
  return surfels;
}

void check(const testing::AssertionResult& result, const std::string& what) {
  if (!result) RC_FAIL(what + ": " + result.message());
}

/// The map as a user knows it who has only ever got its changes.
class Reader {
 public:
  void read(const Mapper& mapper) {
    ask(mapper);
    compare(mapper);
  }

  /// Changes nothing if the mapper fails.
  void ask(const Mapper& mapper) {
    const Changes changes = mapper.changes(sequence_);
    RC_ASSERT(changes.sequence == mapper.sequence());
    const std::set<std::uint32_t> removed(changes.removed.begin(), changes.removed.end());
    for (const Surfel& surfel : changes.updated) {
      RC_ASSERT(removed.count(surfel.id) == 0U);
      const auto known = surfels_.find(surfel.id);
      RC_ASSERT(known == surfels_.end() || (known->second.position == surfel.position && known->second.normal == surfel.normal));
    }
    for (const std::uint32_t id : removed) surfels_.erase(id);
    for (const Surfel& surfel : changes.updated) surfels_[surfel.id] = surfel;
    sequence_ = changes.sequence;
  }

  void compare(const Mapper& mapper) const {
    std::vector<Surfel> all;
    for (const auto& [id, surfel] : surfels_) all.push_back(surfel);
    check(same(all, mapper.surfels()), "the map made from changes");
  }

 private:
  std::map<std::uint32_t, Surfel> surfels_;
  std::uint64_t sequence_ = 0;
};

class MapperModel : public testing::Test {
 public:
  ~MapperModel() override { FaultInjection::stop(); }

 protected:
  void SetUp() override {}
  void TearDown() override {
    mapper_.reset();
    std::filesystem::remove_all(folder_);
  }

  void begin(const Config& config) {
    std::filesystem::remove_all(folder_);  // of a sequence that has failed
    std::filesystem::create_directories(folder_);
    config_ = config;
    mapper_ = std::make_unique<Mapper>(config);
    Config in_memory = config;
    in_memory.map_folder.clear();
    undisturbed_ = std::make_unique<Mapper>(in_memory);
  }

  void take(const Step& step) {
    switch (step.action) {
      case Action::kFrame:
        return frame(step);
      case Action::kFailingFrame:
        return failing_frame(step);
      case Action::kBadFrame:
        return refuse<BadFrame>([&] { mapper_->integrate({}); });
      case Action::kSave:
        return save();
      case Action::kLoad:
        return load();
      case Action::kFailingLoad:
        return failing_load(step);
      case Action::kBadLoad:
        return refuse<FileError>([&] { mapper_->load((folder_ / "none.ply").string()); });
      case Action::kReset:
        return reset();
      case Action::kChanges:
        return changes(step);
      case Action::kFailingChanges:
        return failing_changes(step);
      case Action::kBox:
        return box(step);
    }
  }

  /// With a map folder: what is found there by the next mapper is the map.
  void take_any_steps(const Config& config) {
    const auto steps = *rc::gen::container<std::vector<Step>>(any_step());
    begin(config);
    for (const Step& step : steps) take(step);
  }

  Config with_folder(Config config) const {
    config.eviction_radius = 9;
    config.map_folder = (folder_ / "map").string();
    return config;
  }

  void reopen() {
    mapper_.reset();
    mapper_ = std::make_unique<Mapper>(config_);
    check(same(without_ids(mapper_->whole_map()), without_ids(undisturbed_->surfels())), "the map that the folder has at the end");
    check(same_memory(mapper_->saved_map(), undisturbed_->saved_map()), "what the folder remembers at the end");
  }

 private:
  bool evicts() const { return !config_.map_folder.empty(); }

  /// The mapper without failures has got the same calls, except those that failed, so it has the same map. Blocks that come from disk
  /// have other ids.
  void compare(const char* what) {
    if (evicts()) return check(same(without_ids(mapper_->whole_map()), without_ids(undisturbed_->surfels())), what);
    check(same(mapper_->surfels(), undisturbed_->surfels()), what);
    RC_ASSERT(mapper_->sequence() == undisturbed_->sequence());
    RC_ASSERT(mapper_->size() == undisturbed_->size());
  }

  template <typename Error, typename Call>
  void refuse(Call call) {
    RC_ASSERT(!fault_of<Error>(call).empty());
    compare("after what was refused");
  }

  /// @return did a call of the device fail?
  template <typename Call>
  static bool fails(std::size_t passing, const Step& step, Call call) {
    FaultInjection::fail(passing, step.for_good ? std::numeric_limits<std::size_t>::max() : 1);
    const bool failed = !fault_of<DeviceError>(call).empty();
    FaultInjection::stop();
    return failed;
  }

  void frame(const Step& step) {
    const DepthFrame frame = frames_[step.which].view();
    if (std::exchange(save_may_have_failed_, false)) fault_of<DeviceError>([&] { mapper_->integrate(frame); });
    if (mapper_->sequence() > undisturbed_->sequence()) return undisturbed_->integrate(frame), compare("after a frame");
    FaultInjection::stop();
    const Report report = mapper_->integrate(frame);
    calls_ = FaultInjection::count();
    const Report expected = undisturbed_->integrate(frame);
    RC_ASSERT(report.created == expected.created && report.removed == expected.removed && report.split == expected.split);
    compare("after a frame");
  }

  void failing_frame(const Step& step) {
    const DepthFrame frame = frames_[step.which].view();
    const bool failed = fails(calls_ - std::min<std::size_t>(calls_, 1 + step.call), step, [&] { mapper_->integrate(frame); });
    save_may_have_failed_ = evicts();
    RC_ASSERT(failed == (mapper_->sequence() == undisturbed_->sequence()));
    if (!failed) undisturbed_->integrate(frame);
    if (step.which % 2 == 1) changes(step);
    compare("after a frame in which the device failed");
  }

  void save() {
    saved_ = without_ids(undisturbed_->surfels());
    mapper_->save(path_);
    const SavedMap map = read_saved_map(path_);
    check(same(without_ids(map.surfels), saved_), "the saved map");
    check(same_memory(map, undisturbed_->saved_map()), "what the saved map remembers");
    is_saved_ = true;
  }

  void load() {
    if (!is_saved_) return;
    mapper_->load(path_);
    undisturbed_->load(path_);
    check(same(without_ids(mapper_->whole_map()), saved_), "the loaded map");
    compare("after loading");
  }

  /// Leaves the map as it was, or says that it is lost.
  void failing_load(const Step& step) {
    if (!is_saved_) return;
    save_may_have_failed_ = evicts();
    if (!fails(step.call % 60, step, [&] { mapper_->load(path_); })) {
      undisturbed_->load(path_);
    } else if (const std::string said = fault_of<DeviceError>([&] { mapper_->surfels(); }); !said.empty()) {
      RC_ASSERT(said.find("lost") != std::string::npos);
      return load();
    }
    compare("after loading when the device failed");
  }

  void reset() {
    mapper_->reset();
    undisturbed_->reset();
    RC_ASSERT(mapper_->whole_map().empty());
  }

  void changes(const Step& step) {
    readers_[step.which % std::size(readers_)].read(*mapper_);
    undisturbed_readers_[step.which % std::size(readers_)].read(*undisturbed_);
  }

  /// What the mapper failed to tell, it tells later.
  void failing_changes(const Step& step) {
    Reader& reader = readers_[step.which % std::size(readers_)];
    if (!fails(step.call % 12, step, [&] { reader.ask(*mapper_); })) {
      reader.compare(*mapper_);
      undisturbed_readers_[step.which % std::size(readers_)].read(*undisturbed_);
    }
    compare("after changes when the device failed");
  }

  void box(const Step& step) {
    const Eigen::Vector3f middle = frames_[step.which].T_world_camera.translation().cast<float>();
    const Eigen::AlignedBox3f box(middle.array() - 1, middle.array() + 1);
    std::vector<Surfel> expected;
    for (const Surfel& surfel : mapper_->surfels())
      if ((surfel.position.array() >= box.min().array()).all() && (surfel.position.array() <= box.max().array()).all())
        expected.push_back(surfel);
    check(same(mapper_->surfels(box), expected), "the surfels in a box");
  }

 protected:
  const std::filesystem::path folder_ = std::filesystem::temp_directory_path() / ("mapper_model_" + std::to_string(getpid()));

 private:
  const std::string path_ = (folder_ / "map.ply").string();
  const Frames frames_ = views();
  Config config_;
  std::unique_ptr<Mapper> mapper_, undisturbed_;
  Reader readers_[3], undisturbed_readers_[3];
  std::vector<Surfel> saved_;
  std::size_t calls_ = 0;  ///< of the device, in the last frame
  bool is_saved_ = false;
  bool save_may_have_failed_ = false;  ///< in the map folder; then the next frame is refused
};

/// Views are forgotten soon, so that seen points decide.
Config few_views() {
  Config config = undecimated();
  config.recent_views = 2;
  return config;
}

RC_GTEST_FIXTURE_PROP(MapperModel, InMemory, ()) { take_any_steps(undecimated()); }

RC_GTEST_FIXTURE_PROP(MapperModel, InMemoryWithFewViews, ()) { take_any_steps(few_views()); }

RC_GTEST_FIXTURE_PROP(MapperModel, WithAMapFolder, ()) {
  take_any_steps(with_folder(undecimated()));
  reopen();
}

RC_GTEST_FIXTURE_PROP(MapperModel, WithAMapFolderAndFewViews, ()) {
  take_any_steps(with_folder(few_views()));
  reopen();
}

}  // namespace
}  // namespace frontier_surfels
