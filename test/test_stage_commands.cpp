/// The device's queue: values that commands read or write stay alive until these are done.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "opencl/commands.hpp"
#include "opencl/fault_injection.hpp"
#include "opencl/programs.hpp"
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

  static constexpr std::size_t kSize = 1000, kLarge = 1 << 24;
  DeviceArray<cl_int> array_;
};

/// Before it lets go of their values: drivers may return from a blocking write while earlier commands have not even begun.
TEST_F(StageCommands, AWriteWaitsForAllEarlierCommands) {
  const auto values = keep_values(test_commands());
  FaultInjection::fail(1, 1);  // the write succeeds, but the wait fails
  EXPECT_THROW(array_.write(std::vector<cl_int>(kSize, 2)), cl::Error);
  FaultInjection::stop();
  EXPECT_FALSE(values.expired());
  array_.write(std::vector<cl_int>(kSize, 2));
  EXPECT_TRUE(values.expired());
}

TEST_F(StageCommands, ABlockingReadEndsAllEarlierCommands) {
  const auto values = keep_values(test_commands());
  EXPECT_EQ(array_.read(kSize), std::vector<cl_int>(kSize, 1));
  EXPECT_TRUE(values.expired());
}

/// Commands that still run read what was sent, even if a failure has ended the call that sent it.
TEST_F(StageCommands, SentValuesOutliveTheirArray) {
  DeviceArray<cl_int> large(test_commands());
  large.resize(kLarge);
  auto sent = std::make_unique<SentArray<cl_int>>(test_commands());
  sent->send(std::vector<cl_int>(kSize, 6));
  EXPECT_EQ(array_.read_one(0), 1);  // the host has waited since
  for (int n = 0; n < 4; ++n) large.fill("test", n, kLarge);
  test_commands().queue().enqueueCopyBuffer((*sent)(), array_(), 0, 0, kSize * sizeof(cl_int));
  sent.reset();
  const std::vector<cl_int> other(kSize, 7);  // would take the place of freed values
  EXPECT_EQ(array_.read(kSize), std::vector<cl_int>(kSize, 6));
}

/// Drivers of graphics processors allocate memory when it is used for the first time.
TEST_F(StageCommands, ABufferThatCannotBeUsedReplacesNoOther) {
  Device device = test_device();
  device.shares_memory = false;
  Commands commands(device);
  DeviceArray<cl_int> array(commands);
  array.send(std::vector<cl_int>(kSize, 8));
  const std::size_t before = array.size(), bytes = commands.allocated_bytes();
  FaultInjection::fail(1, 1);  // the buffer is made, but its first use fails
  EXPECT_THROW(array.resize(100 * kSize), AllocationError);
  FaultInjection::stop();
  EXPECT_EQ(array.size(), before);
  EXPECT_EQ(commands.allocated_bytes(), bytes);
  EXPECT_EQ(array.read(kSize), std::vector<cl_int>(kSize, 8));
  array.resize(100 * kSize);
  EXPECT_GE(array.size(), 100 * kSize);
}

/// Each of them has its own values, and the order of the commands decides. What is read later is what there is when the host waits.
TEST_F(StageCommands, WritesAndReadsKeepTheirOrder) {
  array_.send(std::vector<cl_int>(kSize, 3));
  const auto first = array_.read_later(kSize);
  array_.write(std::vector<cl_int>(kSize / 2, 4));
  const auto second = array_.read_later(kSize);
  array_.send({5}, kSize - 1);
  std::vector<cl_int> wanted(kSize, 3);
  std::fill(wanted.begin(), wanted.begin() + kSize / 2, 4);
  wanted.back() = 5;
  EXPECT_EQ(array_.read_one(kSize - 1), 5);
  EXPECT_EQ(*first, std::vector<cl_int>(kSize, 3));
  EXPECT_EQ(*second, wanted);
}

/// A driver may let the host wait for each read: all come together, just before the one wait.
TEST_F(StageCommands, ReadsArePutOffToTheNextWait) {
  FaultInjection::stop();
  const auto values = array_.read_later(kSize);
  array_.fill("test", 9, kSize);
  EXPECT_EQ(FaultInjection::count(Call::kRead), 0u);
  test_commands().wait();
  EXPECT_EQ(FaultInjection::count(Call::kRead), 1u);
  EXPECT_EQ(*values, std::vector<cl_int>(kSize, 9));
  test_commands().wait();
  EXPECT_EQ(FaultInjection::count(Call::kRead), 1u);
}

/// Fewer work items share a job where there are more jobs.
TEST(WorkShape, Teams) {
  WorkShape shape;
  EXPECT_EQ(shape.team(1), 1U);
  shape.view_team = 16;
  for (const std::size_t few : {0, 1, 1 << 14}) EXPECT_EQ(shape.team(few), 16U);
  EXPECT_EQ(shape.team((1 << 14) + 1), 8U);
  EXPECT_EQ(shape.team(1 << 17), 2U);
  EXPECT_EQ(shape.team((1 << 17) + 1), 1U);
  EXPECT_EQ(shape.team(1 << 30), 1U);
}

/// Fewer chunks where each has more counts, if many work items share a chunk.
TEST(WorkShape, SortChunks) {
  WorkShape shape;
  shape.most_sort_chunks = 512;
  for (const std::size_t blocks : {0, 256, 1 << 10, 200000}) EXPECT_EQ(shape.sort_chunks(blocks), 512U);
  shape.many_items = true;
  EXPECT_EQ(shape.sort_chunks(0), 512U);
  EXPECT_EQ(shape.sort_chunks(256), 512U);
  EXPECT_EQ(shape.sort_chunks(1 << 10), 128U);
  EXPECT_EQ(shape.sort_chunks(200000), 32U);
}

/// Each program has all that its kernels call.
TEST(StageKernelPrograms, AreBuiltByThemselves) {
  const Device& device = test_commands().device();
  std::map<std::string, int> programs;
  for (const KernelProgram& program : kernel_programs()) {
    SCOPED_TRACE(program.name);
    std::set<std::string> listed(program.kernels.begin(), program.kernels.end()), built;
    for (const cl::Kernel& kernel : build_kernels(device, program.source, build_options(device), "").kernels)
      built.insert(kernel.getInfo<CL_KERNEL_FUNCTION_NAME>());
    EXPECT_TRUE(listed == built) << listed.size() << " kernels are listed, and " << built.size() << " are built";
    for (const std::string& name : built) ++programs[name];
  }
  for (const char* once : {"visit_surfels", "list_bits", "mark_lines", "sign_field", "median", "draw_views"})
    EXPECT_EQ(programs[once], 1) << once;
  EXPECT_GT(programs.size(), 60u);
}

/// They are built when one of their kernels is launched, or before.
TEST(StageKernelPrograms, AreBuiltWhenTheyAreNeeded) {
  Commands commands(test_commands().device());
  EXPECT_TRUE(commands.has_built("frames"));
  EXPECT_FALSE(commands.has_built(kKnownSpaceProgram) || commands.has_built(kPlannersProgram));
  commands.build(kKnownSpaceProgram);
  EXPECT_TRUE(commands.has_built(kKnownSpaceProgram));
  EXPECT_FALSE(commands.has_built(kPlannersProgram));
  EXPECT_THROW(commands.run("test", "no_such_kernel", 1, 1), std::out_of_range);
}

}  // namespace
}  // namespace frontier_surfels
