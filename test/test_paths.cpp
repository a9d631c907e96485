/// Paths as people write them.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "frontier_surfels/mapper.hpp"
#include "frontier_surfels/paths.hpp"
#include "temporary_folder.hpp"

namespace frontier_surfels {
namespace {

/// Sets HOME and the current folder for the time of a test.
class Paths : public testing::Test {
 protected:
  Paths() : home_(std::getenv("HOME") != nullptr ? std::getenv("HOME") : ""), current_(std::filesystem::current_path()) {
    setenv("HOME", "/house/of me", 1);
    std::filesystem::current_path("/tmp");
  }
  ~Paths() override {
    home_.empty() ? unsetenv("HOME") : setenv("HOME", home_.c_str(), 1);
    std::filesystem::current_path(current_);
  }

 private:
  const std::string home_;
  const std::filesystem::path current_;
};

TEST_F(Paths, ATildeIsTheHomeFolder) {
  EXPECT_EQ(absolute_path("~"), "/house/of me");
  EXPECT_EQ(absolute_path("~/map.ply"), "/house/of me/map.ply");
  EXPECT_EQ(absolute_path("~/maps/../map.ply"), "/house/of me/map.ply");
}

TEST_F(Paths, OtherTildesAreNames) {
  EXPECT_EQ(absolute_path("~other/map.ply"), "/tmp/~other/map.ply");
  EXPECT_EQ(absolute_path("/maps/~/map.ply"), "/maps/~/map.ply");
  EXPECT_EQ(absolute_path("./~/map.ply"), "/tmp/~/map.ply");
}

TEST_F(Paths, RelativePathsBeginInTheCurrentFolder) {
  EXPECT_EQ(absolute_path("map.ply"), "/tmp/map.ply");
  EXPECT_EQ(absolute_path("it's \"one\".ply"), "/tmp/it's \"one\".ply");
  EXPECT_EQ(absolute_path("/maps//map.ply"), "/maps/map.ply");
  EXPECT_EQ(absolute_path(""), "");
}

TEST_F(Paths, WithoutHomeTheAccountDecides) {
  unsetenv("HOME");
  const std::string path = absolute_path("~/map.ply");
  EXPECT_EQ(path.front(), '/');
  EXPECT_EQ(path.find('~'), std::string::npos) << path;
}

TEST_F(Paths, TheMapFolderOfAMapperMayBeginWithATilde) {
  const TemporaryFolder temporary("home");
  const std::string folder = temporary.path().string();
  setenv("HOME", folder.c_str(), 1);
  Config config;
  config.map_folder = "~/map";
  EXPECT_EQ(Mapper(config).config().map_folder, folder + "/map");
  EXPECT_TRUE(std::filesystem::is_directory(folder + "/map"));
  EXPECT_FALSE(std::filesystem::exists("/tmp/~"));
}

}  // namespace
}  // namespace frontier_surfels
