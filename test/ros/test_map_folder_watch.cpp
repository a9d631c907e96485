/// The node tries again to write a map folder, also while no frames come.
#include <csignal>

#include "file_size_limit.hpp"
#include "mapper_archive_input.hpp"
#include "ros/map_folder_watch.hpp"

namespace frontier_surfels {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST_F(MapperArchive, IsWrittenAgainOnceThereIsSpace) {
  std::signal(SIGXFSZ, SIG_IGN);  // write() then fails
  Mapper mapper(walking(path_));
  MapFolderWatch watch(mapper);
  auto now = Throttle::Clock::now();
  EXPECT_EQ(watch.look(now), "");
  integrate_all(mapper, walk_there(3));
  limit_file_size(true, 4096);
  const std::string said = fault_of<FileError>([&] { mapper.flush(); });
  EXPECT_EQ(watch.look(now), said);
  EXPECT_NE(said, "");
  now += seconds(6);
  EXPECT_EQ(watch.look(now), said) << "still no space";
  limit_file_size(false);
  now += milliseconds(100);
  EXPECT_EQ(watch.look(now), said) << "not tried after each frame";
  now += seconds(6);
  EXPECT_EQ(watch.look(now), "");
  std::signal(SIGXFSZ, SIG_DFL);
  EXPECT_NO_THROW(mapper.flush());
}

}  // namespace
}  // namespace frontier_surfels
