/// Faults of map folders: a killed mapper, a full disk, damaged blocks, unusable folders.
#include <fcntl.h>
#include <sys/wait.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <iostream>
#include <random>
#include <thread>

#include "file_size_limit.hpp"
#include "mapper_archive_input.hpp"

namespace frontier_surfels {
namespace {

constexpr char kFolder[] = "FRONTIER_SURFELS_TEST_FOLDER";  // folder in which the child maps

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// Views are kept for longer than it takes until the next save, and than blocks stay in memory: what is remembered of them goes into blocks
/// whose surfels have not changed for long.
Config to_be_killed(const std::string& folder) {
  Config config = walking(folder);
  config.recent_views = 30;
  return config;
}

/// Child process of the next test: maps at a camera's rate and appends a byte to a file after every frame.
TEST(MapperArchiveChild, DISABLED_MapsUntilItIsKilled) {
  const char* folder = std::getenv(kFolder);
  if (folder == nullptr) GTEST_SKIP() << "Only for the test that kills it.";
  const int frames_done = open((std::string(folder) + "_frames").c_str(), O_WRONLY | O_CREAT | O_APPEND, 0666);
  Mapper mapper{to_be_killed(folder)};
  auto next = std::chrono::steady_clock::now();
  for (const auto& frame : walk_there_and_back(30)) {
    std::this_thread::sleep_until(next);
    next = std::chrono::steady_clock::now() + std::chrono::milliseconds(25);
    mapper.integrate(frame.view());
    if (write(frames_done, "f", 1) != 1) return;
  }
  for (;;) pause();
}

/// Starts this program anew as a child, so that it initialises OpenCL itself. @return its process id
pid_t start_child(const std::string& folder) {
  setenv(kFolder, folder.c_str(), 1);
  const pid_t child = fork();
  if (child != 0) return child;
  const int nowhere = open("/dev/null", O_WRONLY);
  dup2(nowhere, STDOUT_FILENO);
  execl("/proc/self/exe", "child", "--gtest_filter=MapperArchiveChild.*", "--gtest_also_run_disabled_tests", nullptr);
  _exit(1);
}

/// Waits until a condition holds, but no longer than a minute.
template <typename Condition>
void wait_until(Condition condition) {
  for (int wait = 0; wait < 240000 && !condition(); ++wait) std::this_thread::sleep_for(std::chrono::microseconds(250));
}

/// Some are killed between any two frames, others while they write.
TEST_F(MapperArchive, AfterAKillTheFolderHoldsTheMapOfARecentFrame) {
  std::vector<SavedMap> maps(1);  // after each frame; old ones are dropped
  Mapper mapper(to_be_killed(""));
  const Frames frames = walk_there_and_back(30);
  const std::filesystem::path written = std::filesystem::path(path_) / "map.sqlite-wal";
  std::mt19937 random(5);
  for (const std::size_t wanted : {5u, 50u, 75u, 90u, 140u, 200u}) {
    const pid_t child = start_child(path_);
    const std::string frames_done = path_ + "_frames";
    const auto count = [&] { return std::filesystem::exists(frames_done) ? std::filesystem::file_size(frames_done) : 0; };
    wait_until([&] { return count() >= wanted; });
    const bool writing = wanted % 2 == 0;
    std::error_code ignored;  // the file may not be there yet
    const auto before = std::filesystem::last_write_time(written, ignored);
    if (writing) wait_until([&] { return std::filesystem::last_write_time(written, ignored) != before; });
    std::this_thread::sleep_for(std::chrono::microseconds(random() % (writing ? 2000 : 20000)));
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the child ended by itself";
    const std::size_t last = count();
    ASSERT_GE(last, wanted);

    Mapper again(to_be_killed(path_));
    SavedMap found = again.saved_map();
    found.surfels = sorted(found.surfels);
    while (maps.size() <= last + 1 && maps.size() <= frames.size()) {
      mapper.integrate(frames[maps.size() - 1].view());
      maps.push_back(mapper.saved_map());
      if (maps.size() > 40) maps[maps.size() - 40] = {};
    }
    std::size_t n = maps.size();
    while (n > 0 && (found.surfels.size() != maps[n - 1].surfels.size() || !same(found.surfels, sorted(maps[n - 1].surfels)))) --n;
    ASSERT_GT(n, 0u) << "killed after frame " << last << ": the folder holds the map of no frame";
    EXPECT_TRUE(same_memory(found, maps[n - 1])) << "the surfels are those of frame " << n - 1;
    EXPECT_GE(n - 1 + 30, last) << "too many frames are lost";
    std::cout << "killed after frame " << last << (writing ? " while writing" : "") << ", the folder holds the map after frame " << n - 1
              << "\n";

    EXPECT_NO_THROW(again.integrate(frames[last].view()));
    again.reset();
    std::filesystem::remove(frames_done);
  }
}

/// On a full disk some frames are refused, nothing is lost, and mapping goes on when there is room again.
TEST_F(MapperArchive, AFullDiskRefusesFramesAndLosesNothing) {
  const Frames frames = walk_there_and_back(20);
  Mapper plain(walking());
  integrate_all(plain, frames);
  std::signal(SIGXFSZ, SIG_IGN);  // write() then fails
  std::size_t refused = 0;
  std::string said;
  {
    Mapper mapper(walking(path_));
    Follower follower;
    for (std::size_t n = 0; n < frames.size(); ++n) {
      limit_file_size(n > 30 && n < 140, rlim_t{1} << 20);
      for (int tries = 0;; ++tries) {
        EXPECT_LT(tries, 2) << "frame " << n << ": " << said;
        const std::string fault = fault_of<FileError>([&] { mapper.integrate(frames[n].view()); });
        follower.apply(mapper.changes(follower.sequence()));
        ASSERT_TRUE(same(follower.surfels(), mapper.surfels())) << "frame " << n << ", try " << tries;
        if (fault.empty()) break;
        ++refused;
        said = fault;
      }
      ASSERT_EQ(mapper.sequence(), n + 1);
    }
    limit_file_size(false);
    EXPECT_TRUE(same(saved(mapper), sorted(plain.surfels())));
  }
  std::signal(SIGXFSZ, SIG_DFL);
  EXPECT_GT(refused, 0u);
  EXPECT_LT(refused, 10u) << "not every frame";
  EXPECT_TRUE(contains(said, "The map folder " + path_ + " cannot be") && said.back() == '.') << said;
  EXPECT_TRUE(same(stored(), sorted(plain.surfels())));
  std::cout << refused << " of " << frames.size() << " frames refused: " << said << "\n";
}

/// The destructor could tell nobody.
TEST_F(MapperArchive, FlushTellsThatTheEndOfTheMapCannotBeWritten) {
  const Frames frames = walk_there(4.5);  // the last one is none of those after which the map is saved, at once or a little later
  Mapper plain(walking());
  integrate_all(plain, frames);
  std::signal(SIGXFSZ, SIG_IGN);  // write() then fails
  {
    Mapper mapper(walking(path_));
    integrate_all(mapper, frames);
    limit_file_size(true, 4096);
    for (int tries = 0; tries < 3; ++tries) {
      const std::string said = fault_of<FileError>([&] { mapper.flush(); });
      EXPECT_TRUE(contains(said, "The map folder " + path_ + " cannot be") && said.back() == '.') << said;
      EXPECT_EQ(mapper.map_folder_fault(), said);
    }
    EXPECT_TRUE(same(sorted(mapper.whole_map()), sorted(plain.surfels())));
    limit_file_size(false);
    mapper.flush();
    EXPECT_EQ(mapper.map_folder_fault(), "");
    std::string copy = path_ + "_copy";
    std::filesystem::copy(path_, copy);
    path_.swap(copy);
    EXPECT_TRUE(same(stored(), sorted(plain.surfels()))) << "all is on disk before the mapper ends";
    path_.swap(copy);
    EXPECT_NO_THROW(mapper.integrate(frames.back().view())) << "the fault is over";
  }
  std::signal(SIGXFSZ, SIG_DFL);
  Mapper without(walking());
  EXPECT_NO_THROW(without.flush());
  EXPECT_EQ(without.map_folder_fault(), "");
}

TEST_F(MapperArchive, ADeletedFolderIsTold) {
  const Frames frames = walk_there(60);  // as many as it takes until the thread in the background has tried to write
  Mapper mapper(walking(path_));
  mapper.integrate(frames[0].view());
  mapper.flush();
  std::filesystem::remove_all(path_);
  std::string said;
  for (std::size_t n = 1; n < frames.size() && said.empty(); ++n) said = fault_of<FileError>([&] { mapper.integrate(frames[n].view()); });
  EXPECT_TRUE(contains(said, "has been deleted, moved or replaced")) << said;
  said = fault_of<FileError>([&] { mapper.flush(); });
  EXPECT_TRUE(contains(said, "has been deleted, moved or replaced")) << said;
}

/// The other views, and all else, are still there.
TEST_F(MapperArchive, DamagedViewsAreLeftOutWithAWarning) {
  const Frames frames = walk_there(6);
  SavedMap expected;
  {
    Mapper mapper(walking(path_));
    integrate_all(mapper, frames);
    expected = mapper.saved_map();
  }
  const std::string views = " x = " + std::to_string(view_key(0).x), of_view = views + " AND z = (SELECT ";
  change_file("UPDATE blocks SET crc = ~crc WHERE" + of_view + "min(z) FROM blocks WHERE" + views + ")");
  change_file("UPDATE blocks SET bytes = substr(bytes, 1, 20) WHERE" + of_view + "max(z) FROM blocks WHERE" + views + ")");
  ASSERT_EQ(expected.views.size(), 12u);
  expected.views.erase(expected.views.begin());
  expected.views.pop_back();
  {
    Mapper mapper(walking(path_));
    const std::vector<std::string> warnings = mapper.take_warnings();
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_TRUE(contains(warnings[0], "The map folder " + path_ + " has lost 2 of its 12 kept views")) << warnings[0];
    EXPECT_TRUE(mapper.take_warnings().empty());
    const SavedMap map = mapper.saved_map();
    EXPECT_TRUE(same(sorted(map.surfels), sorted(expected.surfels)));
    EXPECT_TRUE(same_memory(map, expected));
  }
  Mapper mapper(walking(path_));
  EXPECT_TRUE(mapper.take_warnings().empty());
  EXPECT_TRUE(same_memory(mapper.saved_map(), expected));
  mapper.integrate(frames.back().view());
}

/// Some blocks enter memory, then one cannot be read: the frame is refused, and changes() reports the blocks that have entered.
TEST_F(MapperArchive, ADamagedBlockRefusesFramesThatNeedIt) {
  const Frames there = walk_there(20), all = walk_there_and_back(20);
  Mapper plain(walking()), mapper(walking(path_));
  integrate_all(plain, all);
  Follower follower;
  for (const auto& frame : there) mapper.integrate(frame.view());
  follower.apply(mapper.changes(0));
  std::size_t refused = 0;
  for (std::size_t n = there.size(); n < all.size(); ++n) {
    const bool now = n == there.size() + 20;
    if (now) {
      mapper.flush();  // nobody else uses the file
      change_file("UPDATE blocks SET crc = ~crc");
    }
    for (int tries = 0; tries < 3 && now; ++tries) {
      const std::vector<Surfel> before = mapper.surfels();
      const std::string said = fault_of<FileError>([&] { mapper.integrate(there.front().view()); });
      EXPECT_TRUE(contains(said, "cannot be read (its checksum does not fit)")) << said;
      EXPECT_EQ(!same(before, mapper.surfels()), tries == 0) << "blocks move at the first try only";
      const Changes changes = mapper.changes(follower.sequence());
      EXPECT_EQ(changes.sequence, n);
      follower.apply(changes);
      ASSERT_TRUE(same(follower.surfels(), mapper.surfels())) << "after a refused frame";
      ++refused;
    }
    if (now) {
      mapper.flush();
      change_file("UPDATE blocks SET crc = ~crc WHERE crc < 0");  // blocks that were written meanwhile are sound
    }
    mapper.integrate(all[n].view());
    follower.apply(mapper.changes(follower.sequence()));
    ASSERT_TRUE(same(follower.surfels(), mapper.surfels())) << "frame " << n;
  }
  EXPECT_EQ(refused, 3u);
  EXPECT_TRUE(same(saved(mapper), sorted(plain.surfels())));
}

/// A failed frame leaves no view behind: blocks that leave memory later must not be taken for unknown ones.
TEST_F(MapperArchive, BadFramesBetweenChangeNothing) {
  const Frames frames = walk_there_and_back(12);
  Mapper plain(walking()), mapper(walking(path_));
  for (const auto& frame : frames) {
    plain.integrate(frame.view());
    auto bad = frame;
    bad.intrinsics.fx = bad.intrinsics.fy = 0.02;  // a grid as wide as a city
    EXPECT_THROW(mapper.integrate(bad.view()), Error);
    bad = frame;
    bad.T_world_camera.translation().x() = 1e9;
    EXPECT_THROW(mapper.integrate(bad.view()), BadFrame);
    mapper.integrate(frame.view());
  }
  EXPECT_TRUE(same(saved(mapper), sorted(plain.surfels())));
}

TEST_F(MapperArchive, UnusableFoldersAreRefusedWithASentence) {
  const auto refusal = [](const Config& config) { return fault_of<Error>([&] { Mapper mapper(config); }); };
  {
    const Mapper first(walking(path_));
    const std::string said = refusal(walking(path_));
    EXPECT_TRUE(contains(said, "in use by another running mapper")) << said;
  }
  EXPECT_EQ(refusal(walking(path_)), "") << "free again";

  Config config = walking(path_);
  config.eviction_radius = 4.4;
  EXPECT_TRUE(contains(refusal(config), "eviction_radius is 4.4 m: it must be at least three times z_max")) << refusal(config);
  config.map_folder.clear();
  EXPECT_EQ(refusal(config), "");
  config = walking(path_);
  config.z_max = 20;
  config.eviction_radius = 60;
  EXPECT_TRUE(contains(refusal(config), "has blocks of 0.5 m, not of 1 m")) << refusal(config);

  std::ofstream(root_ / "file") << "no folder";
  const std::string said = refusal(walking((root_ / "file" / "map").string()));
  EXPECT_TRUE(contains(said, "cannot be made") && said.back() == '.') << said;
}

}  // namespace
}  // namespace frontier_surfels
