/// Map folders whose process is killed, or whose disk is full.
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstring>
#include <functional>
#include <iostream>
#include <thread>

#include "file_size_limit.hpp"
#include "map_folder_input.hpp"

namespace frontier_surfels {
namespace {

namespace fs = std::filesystem;
using MapFolderFaults = MapFolders;

/// Runs action() in a child. @return its process id
template <typename Action>
pid_t in_child(const Action& action) {
  const pid_t child = fork();
  if (child != 0) return child;
  try {
    action();
  } catch (const std::exception& error) {
    std::cerr << error.what() << std::endl;
    _exit(1);
  }
  _exit(0);
}

int exit_code(pid_t child) {
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST_F(MapFolderFaults, ASecondMapperIsRefused) {
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  const pid_t other = in_child([&] {
    const MapFolder folder(path_, kBlockSize);
    if (::write(pipe_ends[1], "o", 1) == 1) pause();
  });
  char opened = 0;
  ASSERT_EQ(::read(pipe_ends[0], &opened, 1), 1);
  EXPECT_TRUE(says(fault_of_opening(path_), "in use by another running mapper"));
  kill(other, SIGKILL);
  exit_code(other);
  const MapFolder folder(path_, kBlockSize);
  EXPECT_TRUE(says(fault_of_opening(path_), "in use by another running mapper")) << "nor twice in one process";
  close(pipe_ends[0]);
  close(pipe_ends[1]);
}

/// Transaction `n`: eight blocks that are always there, one new, and one of those before erased.
std::vector<StoredBlock> transaction(int n) {
  std::mt19937 random(static_cast<unsigned>(n));
  std::vector<StoredBlock> blocks;
  for (int k = 0; k < 8; ++k) blocks.push_back({{k, 0, 0}, random_bytes(random, 1000 + random() % 30000)});
  blocks.push_back({{n, 1, 0}, random_bytes(random, 500)});
  blocks.push_back({{n - 5, 1, 0}, {}});
  return blocks;
}

/// Number of the last transaction in a folder: that of the newest block beside the eight. -1: none
int last_transaction(const MapFolder& folder) {
  const auto keys = folder.keys();
  int last = -1;
  for (const BlockKey& key : keys)
    if (key.y == 1) last = std::max(last, key.x);
  return last;
}

Content after_transactions(int last) {
  Content content;
  for (int n = std::max(0, last - 10); n <= last; ++n)
    for (auto& [key, bytes] : transaction(n)) {
      if (bytes.empty()) {
        content.erase(key);
      } else {
        content[key] = bytes;
      }
    }
  return content;
}

/// Writes transactions until it is killed, and tells which are flushed.
void write_forever(const std::string& path, int tell) {
  MapFolder folder(path, kBlockSize);
  for (int n = last_transaction(folder) + 1;; ++n) {
    folder.write(transaction(n));
    if (n % 8 != 0) continue;
    folder.flush();
    if (::write(tell, &n, sizeof n) != sizeof n) return;
  }
}

TEST_F(MapFolderFaults, KilledAtAnyMomentItOpensWithWholeTransactions) {
  int least = 0;
  for (int round = 0; round < 24; ++round) {
    if (round < 6) {  // killed while it is made, or soon after
      fs::remove_all(path_);
      least = -1;
    }
    int pipe_ends[2];
    ASSERT_EQ(pipe(pipe_ends), 0);
    const pid_t child = in_child([&] { write_forever(path_, pipe_ends[1]); });
    if (round >= 6) {
      ASSERT_EQ(::read(pipe_ends[0], &least, sizeof least), static_cast<ssize_t>(sizeof least));  // so that every round gets further
    }
    std::this_thread::sleep_for(std::chrono::microseconds(random_() % (round < 6 ? 8000 : 80000)));
    kill(child, SIGKILL);
    EXPECT_EQ(exit_code(child), -1) << "it ended by itself";
    close(pipe_ends[1]);
    int flushed = -1;
    while (::read(pipe_ends[0], &flushed, sizeof flushed) == sizeof flushed) least = flushed;
    close(pipe_ends[0]);

    const MapFolder folder(path_, kBlockSize);
    const int last = last_transaction(folder);
    EXPECT_GE(last, least) << "what was flushed is missing";
    EXPECT_EQ(content_of(folder), after_transactions(last)) << "after " << last << " transactions";
    least = last;
  }
  std::cout << "24 times killed, " << least + 1 << " transactions\n";
}

/// Fills a folder until `full` is in the way, which then goes out of the way.
void expect_nothing_lost(const std::string& path, const std::function<void(bool)>& limit) {
  Content expected;
  std::mt19937 random(3);
  MapFolder folder(path, kBlockSize);
  limit(true);
  std::string said;
  std::vector<StoredBlock> refused;
  for (int n = 0; n < 3000 && said.empty(); ++n) {  // 600 MB: more than may be queued
    std::vector<StoredBlock> blocks = {{{n, 0, 0}, random_bytes(random, 200000)}};
    const StoredBlock copy = blocks.front();
    try {
      folder.write(std::move(blocks));
      expected.insert(copy);
    } catch (const FileError& error) {
      said = error.what();
      ASSERT_EQ(blocks.size(), 1u);
      EXPECT_EQ(blocks.front(), copy) << "a refused block stays with whom it belongs to";
      refused = std::move(blocks);
    }
  }
  EXPECT_TRUE(says(said, "cannot be"));
  std::cout << said << "\n";
  EXPECT_EQ(content_of(folder), expected);
  EXPECT_TRUE(says(fault_of([&] { folder.flush(); }), "cannot be")) << "as long as there is no room";
  EXPECT_TRUE(says(folder.fault(), "cannot be"));
  EXPECT_EQ(content_of(folder), expected);

  limit(false);
  folder.flush();
  EXPECT_EQ(folder.fault(), "");
  expected.insert(refused.front());
  folder.write(std::move(refused));
  folder.flush();
  EXPECT_EQ(content_of(folder), expected);
}

TEST_F(MapFolderFaults, NothingIsLostWhenAFileMayNotGrow) {
  std::signal(SIGXFSZ, SIG_IGN);  // write() then fails
  expect_nothing_lost(path_, [](bool full) { limit_file_size(full); });
  std::signal(SIGXFSZ, SIG_DFL);
  MapFolder(path_, kBlockSize);
}

TEST_F(MapFolderFaults, NothingIsLostOnAFullDisk) {
  const fs::path disk = root_ / "disk";
  fs::create_directory(disk);
  if (mount("none", disk.c_str(), "tmpfs", 0, "size=4m") != 0)
    GTEST_SKIP() << "A small disk cannot be mounted here (" << std::strerror(errno) << "): run as root to test a full one.";
  expect_nothing_lost((disk / "map").string(), [&](bool full) {
    if (full) return;
    ASSERT_EQ(mount("none", disk.c_str(), "tmpfs", MS_REMOUNT, "size=400m"), 0);
  });
  umount(disk.c_str());
}

TEST_F(MapFolderFaults, GivingUpOnAFullDiskEndsAndKeepsWhatWasWritten) {
  std::signal(SIGXFSZ, SIG_IGN);
  const BlockKey before = {-1, 0, 0};
  {
    MapFolder folder(path_, kBlockSize);
    folder.write({{before, Bytes(1000, 1)}});
    folder.flush();
    limit_file_size(true);
    folder.write({{{0, 0, 0}, Bytes(std::size_t{100} << 20, 2)}});  // alone more than may be queued
    EXPECT_TRUE(says(fault_of([&] { folder.write({}); }), "cannot be")) << "it waits for room, not for ever";
  }
  limit_file_size(false);
  std::signal(SIGXFSZ, SIG_DFL);
  const MapFolder folder(path_, kBlockSize);
  EXPECT_EQ(folder.keys(), std::vector<BlockKey>{before});
}

TEST_F(MapFolderFaults, ClearingForgetsWhatCannotBeWritten) {
  std::signal(SIGXFSZ, SIG_IGN);
  MapFolder folder(path_, kBlockSize);
  limit_file_size(true);
  folder.write({{{0, 0, 0}, Bytes(std::size_t{20} << 20, 2)}});
  EXPECT_TRUE(says(fault_of([&] { folder.flush(); }), "cannot be"));
  folder.clear();  // the large block is tried once more just now
  EXPECT_EQ(folder.fault(), "");
  folder.write({{{1, 0, 0}, Bytes(1000, 3)}});
  folder.flush();
  limit_file_size(false);
  std::signal(SIGXFSZ, SIG_DFL);
  EXPECT_EQ(content_of(folder), (Content{{{1, 0, 0}, Bytes(1000, 3)}}));
}

/// SQLite goes on writing into files that have no name any more.
TEST_F(MapFolderFaults, AFolderThatIsMovedAwayIsNoticed) {
  const Content before = {{{0, 0, 0}, Bytes(1000, 1)}};
  MapFolder folder(path_, kBlockSize);
  folder.write({{{0, 0, 0}, Bytes(1000, 1)}});
  folder.flush();
  EXPECT_EQ(folder.fault(), "");
  fs::rename(path_, path_ + "_away");
  EXPECT_TRUE(says(fault_of([&] { folder.flush(); }), "has been deleted, moved or replaced")) << "also if there is nothing to write";
  EXPECT_TRUE(says(folder.fault(), "has been deleted, moved or replaced"));
  { const MapFolder other(path_, kBlockSize); }
  EXPECT_TRUE(says(fault_of([&] { folder.flush(); }), "has been deleted, moved or replaced")) << "another folder is in its place";
  fs::remove_all(path_);
  fs::rename(path_ + "_away", path_);
  folder.flush();
  EXPECT_EQ(folder.fault(), "");
  EXPECT_EQ(content_of(folder), before);
}

TEST_F(MapFolderFaults, ADeletedFolderIsNoticed) {
  MapFolder folder(path_, kBlockSize);
  fs::remove_all(path_);
  folder.write({{{0, 0, 0}, Bytes(1000, 1)}});
  EXPECT_TRUE(says(fault_of([&] { folder.flush(); }), "has been deleted, moved or replaced"));
  EXPECT_EQ(content_of(folder), (Content{{{0, 0, 0}, Bytes(1000, 1)}})) << "what is queued is not lost";
}

}  // namespace
}  // namespace frontier_surfels
