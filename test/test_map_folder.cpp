/// Map folders: what was written is read again; what is damaged, or not ours, is refused.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <fstream>
#include <iostream>
#include <thread>
#include <unordered_set>

#include "map_folder_input.hpp"

namespace frontier_surfels {
namespace {

namespace fs = std::filesystem;

class MapFolderFiles : public MapFolders {
 protected:
  /// A folder of `count` blocks of 3000 bytes.
  Content make_folder(int count) {
    Content content;
    MapFolder folder(path_, kBlockSize);
    for (int n = 0; n < count; ++n) {
      const BlockKey key = {n, -n, 7};
      content[key] = random_bytes(random_, 3000);
      folder.write({{key, content[key]}});
    }
    return content;
  }

  void run_sql(const char* sql) { SQLite::Database(file_.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE).exec(sql); }
};

TEST_F(MapFolderFiles, WhatWasWrittenIsReadAgain) {
  Content expected;
  {
    MapFolder folder(path_, kBlockSize);
    EXPECT_EQ(folder.size(), 0u);
    for (const BlockKey& key : {BlockKey{0, 0, 0}, BlockKey{-1, 2, -3}, BlockKey{INT32_MIN, INT32_MAX, INT32_MIN}, BlockKey{5, 0, 0}})
      expected[key] = random_bytes(random_, 1 + random_() % 100000);
    folder.write({expected.begin(), expected.end()});
    EXPECT_EQ(content_of(folder), expected) << "queued or written";
    folder.flush();
    EXPECT_EQ(content_of(folder), expected) << "written";
    EXPECT_TRUE(folder.contains({-1, 2, -3}));
    EXPECT_FALSE(folder.contains({-1, 2, 3}));
    EXPECT_TRUE(folder.read({-1, 2, 3}).empty());
  }
  const MapFolder folder(path_, kBlockSize);
  EXPECT_EQ(content_of(folder), expected);
  EXPECT_EQ(folder.size(), 4u);
}

/// Any order of overwriting, erasing, clearing and reopening gives what a std::map gives.
TEST_F(MapFolderFiles, AnyHistoryIsThatOfAMap) {
  Content expected;
  auto folder = std::make_unique<MapFolder>(path_, kBlockSize);
  for (int step = 0; step < 400; ++step) {
    std::vector<StoredBlock> blocks(random_() % 6);
    for (auto& [key, bytes] : blocks) {
      key = {static_cast<int>(random_() % 4), static_cast<int>(random_() % 4), -1};  // often twice in one transaction
      bytes = random_bytes(random_, random_() % 3 * (random_() % 9000));
      if (bytes.empty()) {
        expected.erase(key);
      } else {
        expected[key] = bytes;
      }
    }
    folder->write(std::move(blocks));
    if (random_() % 50 == 0) {
      folder->clear();
      expected.clear();
    }
    if (random_() % 10 == 0) folder->flush();
    if (random_() % 40 == 0) {
      folder.reset();
      folder = std::make_unique<MapFolder>(path_, kBlockSize);
    }
    ASSERT_EQ(content_of(*folder), expected) << "step " << step;
    std::uint64_t bytes = 0;
    for (const auto& block : expected) bytes += block.second.size();
    ASSERT_EQ(folder->bytes(), bytes);
  }
}

TEST_F(MapFolderFiles, OthersReadWhileItIsWritten) {
  MapFolder folder(path_, kBlockSize);
  for (int n = 0; n < 50; ++n) folder.write({{{n, 0, 0}, Bytes(5000, 0)}});
  std::atomic<bool> done{false};
  std::atomic<int> torn{0};
  const auto read = [&] {
    for (int n = 0; !done; n = (n + 1) % 50) {
      const Bytes bytes = folder.read({n, 0, 0});
      if (bytes.size() != 5000 || bytes.front() != bytes.back()) ++torn;
    }
  };
  std::thread first(read), second(read);
  for (int round = 1; round < 40; ++round) {
    for (int n = 0; n < 50; ++n) folder.write({{{n, 0, 0}, Bytes(5000, static_cast<std::uint8_t>(round))}});
    if (round % 10 == 0) folder.flush();
  }
  done = true;
  first.join();
  second.join();
  EXPECT_EQ(torn, 0);
}

TEST_F(MapFolderFiles, AnotherBlockSizeIsRefused) {
  const Content content = make_folder(3);
  EXPECT_TRUE(says(fault_of_opening(path_, 0.25), "has blocks of 0.5 m, not of 0.25 m"));
  EXPECT_EQ(content_of(MapFolder(path_, kBlockSize)), content);
}

TEST_F(MapFolderFiles, OtherVersionsAreRefused) {
  make_folder(3);
  run_sql("UPDATE meta SET version = 3");
  EXPECT_TRUE(says(fault_of_opening(path_), "newer version"));
  run_sql("UPDATE meta SET version = 1");
  EXPECT_TRUE(says(fault_of_opening(path_), "older version"));
}

TEST_F(MapFolderFiles, FilesOfOtherProgramsAreRefusedAndLeftAlone) {
  const auto bytes_of_file = [&] {
    std::ifstream file(file_, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  fs::create_directories(path_);
  std::ofstream(file_) << std::string(5000, 'x');
  EXPECT_TRUE(says(fault_of_opening(path_), "no map"));
  EXPECT_EQ(bytes_of_file(), std::string(5000, 'x'));

  fs::remove(file_);
  run_sql("CREATE TABLE blocks (x, y, z)");
  const std::string before = bytes_of_file();
  EXPECT_TRUE(says(fault_of_opening(path_), "another program"));
  EXPECT_EQ(bytes_of_file(), before);
}

TEST_F(MapFolderFiles, ADamagedBlockIsNamed) {
  Content content = make_folder(5);
  run_sql("UPDATE blocks SET bytes = zeroblob(3000) WHERE x = 3");
  run_sql("UPDATE blocks SET x = 40 WHERE x = 4");
  MapFolder folder(path_, kBlockSize);
  EXPECT_NE(fault_of([&] { folder.read({3, -3, 7}); }).find("Block (3, -3, 7)"), std::string::npos);
  EXPECT_NE(fault_of([&] { folder.read({40, -4, 7}); }).find("Block (40, -4, 7)"), std::string::npos) << "right bytes at another place";
  EXPECT_EQ(folder.read({2, -2, 7}), (content[{2, -2, 7}]));
  folder.write({{{3, -3, 7}, content[{3, -3, 7}]}});
  folder.flush();
  EXPECT_EQ(folder.read({3, -3, 7}), (content[{3, -3, 7}])) << "overwritten";
}

/// A file cut off or with wrong bytes anywhere: refused at once, or block by block, or it still has what was written; never a wrong block.
TEST_F(MapFolderFiles, ADamagedFileNeverGivesWrongBlocks) {
  const Content content = make_folder(100);
  const fs::path copy = root_ / "copy.sqlite";
  fs::copy_file(file_, copy);
  const auto size = fs::file_size(copy);
  int refused = 0, blocks_refused = 0;
  for (int trial = 0; trial < 120; ++trial) {
    for (const auto& entry : fs::directory_iterator(path_)) fs::remove(entry);
    fs::copy_file(copy, file_);
    if (trial % 2 == 0) {
      fs::resize_file(file_, random_() % size);
    } else {
      std::fstream file(file_, std::ios::binary | std::ios::in | std::ios::out);
      file.seekp(static_cast<std::streamoff>(random_() % (size - 64)));
      const Bytes noise = random_bytes(random_, 64);
      file.write(reinterpret_cast<const char*>(noise.data()), 64);
    }
    try {
      const MapFolder folder(path_, kBlockSize);
      for (const BlockKey& key : folder.keys()) {
        try {
          const Bytes bytes = folder.read(key);
          ASSERT_EQ(content.count(key), 1u);
          ASSERT_EQ(bytes, content.at(key));
        } catch (const FileError&) {
          ++blocks_refused;
        }
      }
    } catch (const FileError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 50);
  EXPECT_GT(blocks_refused, 10);
}

TEST_F(MapFolderFiles, FoldersThatCannotBeAreRefused) {
  std::ofstream(root_ / "file") << "text";
  EXPECT_TRUE(says(fault_of_opening((root_ / "file").string()), "cannot be made"));
  EXPECT_TRUE(says(fault_of_opening((root_ / "file" / "map").string()), "cannot be made"));
  EXPECT_TRUE(says(fault_of_opening(""), "cannot be made"));
  EXPECT_TRUE(says(fault_of_opening("/proc/map"), "cannot be made"));
}

TEST_F(MapFolderFiles, WhatMayNotBeWrittenIsRefused) {
  make_folder(2);
  fs::permissions(root_, fs::perms::all);
  const auto fault_with = [&](fs::perms folder, fs::perms file, const std::string& path) {
    fs::permissions(file_, file);
    fs::permissions(fs::path(path_) / "map.lock", fs::perms::all);
    fs::permissions(path_, folder);
    const bool root = geteuid() == 0;
    if (root && seteuid(65534) != 0) return std::string("root could not become nobody, who may not write everywhere");
    const std::string said = fault_of_opening(path);
    if (root && seteuid(0) != 0) return std::string("nobody could not become root again");
    fs::permissions(path_, fs::perms::all);
    return said;
  };
  const fs::perms readable = fs::perms::owner_read | fs::perms::others_read;
  const fs::perms closed = readable | fs::perms::owner_exec | fs::perms::others_exec;
  EXPECT_TRUE(says(fault_with(closed, fs::perms::all, path_ + "/sub"), "cannot be made"));
  EXPECT_TRUE(says(fault_with(closed, fs::perms::all, path_), "cannot be"));
  EXPECT_TRUE(says(fault_with(fs::perms::all, readable, path_), "cannot be opened for writing"));
  EXPECT_EQ(fault_with(fs::perms::all, fs::perms::all, path_), "no FileError was thrown");
}

TEST_F(MapFolderFiles, KeysOfNeighboursSpread) {
  std::unordered_set<std::size_t> low_bits;
  for (int x = -16; x < 16; ++x)
    for (int y = -16; y < 16; ++y)
      for (int z = -16; z < 16; ++z) low_bits.insert(std::hash<BlockKey>()({x, y, z}) & 0xfffff);
  EXPECT_GT(low_bits.size(), 31000u) << "of 32768 in a million places; 32260 by chance";
}

/// Prints what it costs; asserts nothing of it.
TEST_F(MapFolderFiles, Speed) {
  auto seconds = [start = std::chrono::steady_clock::now()]() mutable {
    const auto now = std::chrono::steady_clock::now();
    return std::chrono::duration<double>(now - std::exchange(start, now)).count();
  };
  for (const auto& [count, size] : {std::pair<int, std::size_t>{20000, 4096}, {800, 100000}}) {
    fs::remove_all(path_);
    auto folder = std::make_unique<MapFolder>(path_, kBlockSize);
    std::cout << count << " blocks of " << size << " bytes:";
    for (const char* what : {" written", ", overwritten"}) {
      const Bytes bytes = random_bytes(random_, size);
      seconds();
      for (int n = 0; n < count; n += 20) {
        std::vector<StoredBlock> blocks;
        for (int k = n; k < n + 20; ++k) blocks.push_back({{k % 100, k / 100 % 100, k / 10000}, bytes});
        folder->write(std::move(blocks));
      }
      folder->flush();
      std::cout << what << " in " << seconds() << " s";
    }
    folder.reset();
    std::cout << ", closed in " << seconds() << " s";
    folder = std::make_unique<MapFolder>(path_, kBlockSize);
    std::cout << ", opened in " << seconds() << " s";
    std::vector<BlockKey> keys = folder->keys();
    std::shuffle(keys.begin(), keys.end(), random_);
    for (const BlockKey& key : keys) ASSERT_EQ(folder->read(key).size(), size);
    std::cout << ", read in any order in " << seconds() << " s\n";
  }
}

}  // namespace
}  // namespace frontier_surfels
