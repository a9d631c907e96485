/// Which OpenCL device is taken, and what people are told about all of them.
#include <gtest/gtest.h>

#include "frontier_surfels/types.hpp"
#include "opencl/device_listing.hpp"
#include "opencl/device_ranking.hpp"

namespace frontier_surfels {
namespace {

DeviceFacts device(const std::string& platform, const std::string& name, const std::string& type, unsigned units, unsigned mhz) {
  DeviceFacts facts;
  facts.platform = platform;
  facts.name = name;
  facts.driver = "driver 1";
  facts.version = "OpenCL 1.2";
  facts.type = type;
  facts.compute_units = units;
  facts.clock_mhz = mhz;
  facts.global_bytes = std::uint64_t{8} << 30;
  facts.largest_buffer_bytes = std::uint64_t{2} << 30;
  facts.local_bytes = 48 * 1024;
  facts.group_items = 256;
  return facts;
}

const DeviceFacts kLlvmpipe = device("rusticl", "llvmpipe", "cpu", 64, 4000), kCpu = device(kPocl, "cpu-skylake", "cpu", 2, 2000),
                  kAccelerator = device("Chips", "board", "accelerator", 1, 100), kSlowCard = device("Cards", "slow", "gpu", 10, 1000),
                  kFastCard = device("Cards", "fast", "gpu", 8, 1500);

std::vector<std::string> ranked(const std::vector<DeviceFacts>& devices) {
  std::vector<std::string> names;
  for (const std::size_t n : ranking(devices)) names.push_back(devices[n].name);
  return names;
}

std::string refusal(const std::vector<DeviceFacts>& devices, const Config& config) {
  try {
    choose(devices, config);
  } catch (const DeviceError& error) {
    return error.what();
  }
  return "";
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(DeviceRanking, TheFastestComesFirst) {
  using Names = std::vector<std::string>;
  EXPECT_EQ(ranked({kLlvmpipe, kCpu, kAccelerator, kSlowCard, kFastCard}), (Names{"fast", "slow", "board", "cpu-skylake", "llvmpipe"}));
  DeviceFacts equal = kSlowCard;
  equal.name = "equal";
  EXPECT_EQ(ranked({kSlowCard, equal}), (Names{"slow", "equal"}));
  EXPECT_EQ(ranked({equal, kSlowCard}), (Names{"equal", "slow"})) << "the order of the platforms";
}

TEST(DeviceRanking, TheReasonIsTold) {
  EXPECT_EQ(choose({kCpu}, {}).why, "the only usable device");
  EXPECT_EQ(choose({kCpu, kSlowCard}, {}).why, "fastest usable of 2: a graphics processor");
  EXPECT_EQ(choose({kLlvmpipe, kCpu}, {}).why, "fastest usable of 2: PoCL, before other drivers of CPUs");
  EXPECT_EQ(choose({kCpu, kSlowCard, kFastCard}, {}).why, "fastest usable of 3: the most compute units x clock");
  EXPECT_EQ(choose({kSlowCard, kSlowCard}, {}).why, "fastest usable of 2: the first of equals");
  EXPECT_EQ(choose({kCpu, kAccelerator}, {}).why, "fastest usable of 2: an accelerator");
}

TEST(DeviceRanking, TheConfigurationNarrowsIt) {
  const std::vector<DeviceFacts> devices = {kLlvmpipe, kSlowCard, kCpu, kFastCard};
  Config config;
  const auto chosen = [&] { return devices[choose(devices, config).index].name; };
  EXPECT_EQ(chosen(), "fast");
  config.device_index = 1;
  EXPECT_EQ(chosen(), "slow");
  EXPECT_EQ(choose(devices, config).why, "device_index 1 of the 4 from 0, fastest first");
  config.device_type = "cpu";
  EXPECT_EQ(chosen(), "llvmpipe");
  config.device_index = 0;
  EXPECT_EQ(chosen(), "cpu-skylake");
  config.platform = "RUSTI";
  EXPECT_EQ(chosen(), "llvmpipe");
  EXPECT_EQ(choose(devices, config).why, "the only usable device that fits platform and device_type");
  config.device_type = "gpu";
  const std::string said = refusal(devices, config);
  EXPECT_TRUE(contains(said, "'RUSTI'") && contains(said, "'gpu'")) << said;
  for (const DeviceFacts& facts : devices) EXPECT_TRUE(contains(said, describe(facts))) << said;
  EXPECT_TRUE(contains(refusal({}, {}), "pocl-opencl-icd"));
}

TEST(DeviceRanking, UnusableDevicesArePassedOver) {
  DeviceFacts away = kFastCard, no_compiler = kFastCard, big_endian = kFastCard, no_memory = kFastCard, small_groups = kFastCard,
              faulty = kFastCard;
  away.available = false;
  no_compiler.has_compiler = false;
  big_endian.little_endian = false;
  no_memory.local_bytes = 32 * 1024 - 1;
  small_groups.group_items = 63;
  faulty.fault = "its driver answers with nonsense";
  for (const DeviceFacts& unusable : {away, no_compiler, big_endian, no_memory, small_groups, faulty}) {
    const std::string lack = lacking(unusable);
    SCOPED_TRACE(lack);
    EXPECT_NE(lack, "");
    const std::vector<DeviceFacts> devices = {unusable, kCpu};
    const Choice choice = choose(devices, {});
    EXPECT_EQ(choice.index, 1u);
    EXPECT_EQ(choice.why, "the only usable device; passed over: fast, because " + lack);
    Config config;
    config.device_index = 1;  // behind the usable ones
    EXPECT_TRUE(contains(refusal(devices, config), lack));
    config = {};
    config.device_type = "gpu";
    EXPECT_EQ(refusal(devices, config), "The device fast cannot be used: " + lack + "; choose another one.");
  }
  EXPECT_EQ(lacking(kFastCard), "");
}

TEST(DeviceRanking, Listing) {
  DeviceFacts unusable = kFastCard;
  unusable.has_compiler = false;
  const std::string text = listing({kLlvmpipe, unusable, kCpu}, {});
  const std::size_t at_cpu = text.find(": cpu-skylake"), at_llvmpipe = text.find(": llvmpipe"), at_card = text.find(": fast");
  EXPECT_LT(at_cpu, at_llvmpipe);
  EXPECT_LT(at_llvmpipe, at_card);
  for (const char* part :
       {"2 at 2000 MHz", "8192 MiB", "2048 MiB", "48 KiB", "driver 1", "OpenCL 1.2", "lacks           it has no compiler for OpenCL C",
        "The default configuration takes ", "cpu-skylake (cpu, 2 compute units) (fastest"})
    EXPECT_TRUE(contains(text, part)) << part << " is not in:\n" << text;
  EXPECT_TRUE(contains(listing({}, {}), "pocl-opencl-icd"));
  EXPECT_TRUE(contains(listing({unusable}, {}), "takes none"));
}

TEST(DeviceRanking, ListingOfThisMachine) {
  EXPECT_TRUE(contains(device_listing(), "The default configuration takes ") || contains(device_listing(), "pocl-opencl-icd"))
      << device_listing();
}

}  // namespace
}  // namespace frontier_surfels
