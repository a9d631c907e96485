/// The device's queue: values that commands read or write stay alive until these are done.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "opencl/commands.hpp"
#include "stages/test_device.hpp"

namespace frontier_surfels {
namespace {

/// Values that a command would still use, seen from outside.
std::weak_ptr<const void> keep_values(Commands& commands) {
  const auto values = std::make_shared<const std::vector<int>>(100);
  commands.keep(values);
  return values;
}

class StageCommands : public testing::Test {
 protected:
  StageCommands() : array_(test_commands()) {
    array_.resize(kSize);
    array_.fill("test", 1, kSize);
  }

  static constexpr std::size_t kSize = 1000;
  DeviceArray<cl_int> array_;
};

/// A blocking write may return while earlier commands have not even begun; other drivers than PoCL do so.
TEST_F(StageCommands, ABlockingWriteEndsNoEarlierCommand) {
  const auto values = keep_values(test_commands());
  array_.write(std::vector<cl_int>(kSize, 2));
  EXPECT_FALSE(values.expired());
  test_commands().wait();
  EXPECT_TRUE(values.expired());
}

TEST_F(StageCommands, ABlockingReadEndsAllEarlierCommands) {
  const auto values = keep_values(test_commands());
  EXPECT_EQ(array_.read(kSize), std::vector<cl_int>(kSize, 1));
  EXPECT_TRUE(values.expired());
}

/// Each of them has its own values, and the order of the commands decides.
TEST_F(StageCommands, WritesAndReadsKeepTheirOrder) {
  array_.send(std::vector<cl_int>(kSize, 3));
  const auto first = array_.read_later(kSize);
  array_.write(std::vector<cl_int>(kSize / 2, 4));
  const auto second = array_.read_later(kSize);
  array_.send({5}, kSize - 1);
  std::vector<cl_int> wanted(kSize, 3);
  std::fill(wanted.begin(), wanted.begin() + kSize / 2, 4);
  EXPECT_EQ(array_.read_one(kSize - 1), 5);
  EXPECT_EQ(*first, std::vector<cl_int>(kSize, 3));
  EXPECT_EQ(*second, wanted);
}

}  // namespace
}  // namespace frontier_surfels
