/// PoCL's cache folder: where it cannot be written, a sentence names it and says what to do.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>

#include "frontier_surfels/mapper.hpp"
#include "opencl/kernel_cache.hpp"

namespace frontier_surfels {
namespace {

namespace fs = std::filesystem;

class KernelCache : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_);
    std::ofstream(file_) << "no folder";
  }
  void TearDown() override { fs::remove_all(folder_); }

  const fs::path folder_ = fs::temp_directory_path() / ("kernel_cache_" + std::to_string(getpid()));
  const fs::path file_ = folder_ / "file", below_a_file_ = file_ / "cache";
};

TEST_F(KernelCache, FoldersThatCanBeWritten) {
  EXPECT_EQ(kernel_cache_fault(folder_), "");
  EXPECT_EQ(kernel_cache_fault(folder_ / "new/one"), "");
  EXPECT_TRUE(fs::is_empty(folder_ / "new/one"));
}

TEST_F(KernelCache, FoldersThatCannot) {
  const std::string remedy = "Set the environment variable POCL_CACHE_DIR to a folder";
  for (const fs::path& folder : {below_a_file_, fs::path("/proc/none")}) {
    const std::string said = kernel_cache_fault(folder);
    EXPECT_NE(said.find(folder.string()), std::string::npos) << said;
    EXPECT_NE(said.find(remedy), std::string::npos) << said;
  }
  const std::string full = kernel_cache_fault(folder_, std::numeric_limits<std::uintmax_t>::max());
  EXPECT_NE(full.find("are free there"), std::string::npos) << full;
  EXPECT_NE(full.find(folder_.string()), std::string::npos) << full;
  EXPECT_NE(full.find(remedy), std::string::npos) << full;
}

/// Uses a process for each, because PoCL looks for its folder once.
TEST_F(KernelCache, AMapperSaysSo) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const auto make_mapper = [] {
    try {
      Mapper mapper;
    } catch (const DeviceError& error) {
      std::fputs(error.what(), stderr);
      std::exit(3);
    }
    std::exit(0);
  };
  const auto with = [&](const char* name, const std::string& value) {
    for (const char* other : {"POCL_CACHE_DIR", "XDG_CACHE_HOME"}) unsetenv(other);
    setenv(name, value.c_str(), 1);
    make_mapper();
  };
  EXPECT_EXIT(with("POCL_CACHE_DIR", below_a_file_), testing::ExitedWithCode(3), "cache folder .*/file/cache: .*POCL_CACHE_DIR");
  EXPECT_EXIT(with("XDG_CACHE_HOME", file_), testing::ExitedWithCode(3), "cache folder .*/file/pocl/kcache: .*POCL_CACHE_DIR");
  EXPECT_EXIT(with("HOME", file_), testing::ExitedWithCode(3), "cache folder .*/file/.cache/pocl/kcache: .*POCL_CACHE_DIR");
}

}  // namespace
}  // namespace frontier_surfels
