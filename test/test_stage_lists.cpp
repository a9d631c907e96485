/// kernels/common/lists.cl: prefix sums and lists of set bits, compared exactly.

#include <gtest/gtest.h>

#include "opencl/lists.hpp"
#include "stages/random_input.hpp"
#include "stages/test_device.hpp"

namespace frontier_surfels {
namespace {

using reference::Random;

/// Sizes around a word, a chunk, the number that one work item scans alone (16, 2048, or 65536 on PoCL), the number that a group scans
/// (16384), and a second and third level of sums.
std::vector<std::size_t> sizes() {
  std::vector<std::size_t> sizes = {0, 1, 15, 16, 17, 63, 64, 65, 2047, 2048, 2049};
  if (reference::small_tests()) return sizes;
  sizes.insert(sizes.end(), {2112, 16383, 16384, 16385, 65535, 65536, 65537, 100000, 64 * 2048, 64 * 2048 + 1, 64 * 65536, 64 * 65536 + 1,
                             64 * 64 * 2048 + 77});
  return sizes;
}

struct TestLists {
  /// @return prefix sums, followed by the total
  std::vector<std::uint32_t> scan(const std::vector<std::uint32_t>& values, std::uint32_t* total) {
    DeviceArray<cl_uint> array(test_commands());
    array.resize(values.size() + 1);
    array.write(values);
    *total = lists.scan("test", array, values.size());
    return array.read(values.empty() ? 0 : values.size() + 1);
  }

  std::vector<std::uint32_t> list_bits(const std::vector<std::uint64_t>& words) {
    DeviceArray<cl_ulong> bits(test_commands());
    DeviceArray<cl_uint> list(test_commands());
    bits.write(words);
    return list.read(lists.list_bits("test", bits, words.size(), list));
  }

  Lists lists = Lists(test_commands());
};

TEST(StageLists, PrefixSum) {
  Random random(1);
  TestLists lists;
  for (const std::size_t size : sizes()) {
    for (const std::uint32_t largest : {0u, 1u, 200u}) {
      SCOPED_TRACE(std::to_string(size) + " values up to " + std::to_string(largest));
      std::vector<std::uint32_t> values, expected;
      std::uint32_t sum = 0, total = 1;
      for (std::size_t n = 0; n < size; ++n) {
        values.push_back(random.bits() % (largest + 1));
        expected.push_back(sum);
        sum += values.back();
      }
      if (size > 0) expected.push_back(sum);
      const auto actual = lists.scan(values, &total);
      EXPECT_EQ(total, sum);
      EXPECT_TRUE(actual == expected);
    }
  }
}

/// Sums of up to 2^32 - 2 are exact, and larger ones are refused: those of few values, of chunks, and of chunks of chunks.
TEST(StageLists, LargestSums) {
  TestLists lists;
  std::uint32_t total = 0;
  for (const std::size_t size : {std::size_t{2}, std::size_t{4096}, std::size_t{1} << 18, std::size_t{1} << 20}) {
    SCOPED_TRACE(std::to_string(size) + " values");
    const auto share = static_cast<std::uint32_t>((std::uint64_t{1} << 32) / size);
    std::vector<std::uint32_t> values(size, share);  // together 2^32
    values.back() = share - 2;
    const auto sums = lists.scan(values, &total);
    EXPECT_EQ(total, Lists::kMaxTotal);
    EXPECT_EQ(sums[size - 1], std::uint64_t{share} * (size - 1));
    for (const std::uint32_t last : {share - 1, share, share + 1, 0xffffffffU}) {
      values.back() = last;
      EXPECT_THROW(lists.scan(values, &total), BadFrame) << "last value " << last;
    }
    values.front() = 0xffffffffU;
    EXPECT_THROW(lists.scan(values, &total), BadFrame);
  }
}

TEST(StageLists, SetBitsInOrder) {
  Random random(2);
  TestLists lists;
  for (const std::size_t size : sizes()) {
    if (size > 200000) continue;
    for (const double density : {0.0, 0.02, 0.5, 1.0}) {
      SCOPED_TRACE(std::to_string(size) + " words, share of set bits " + std::to_string(density));
      std::vector<std::uint64_t> words(size, 0);
      std::vector<std::uint32_t> expected;
      for (std::size_t bit = 0; bit < 64 * size; ++bit) {
        if (!random.chance(density)) continue;
        words[bit / 64] |= std::uint64_t{1} << (bit % 64);
        expected.push_back(static_cast<std::uint32_t>(bit));
      }
      EXPECT_TRUE(lists.list_bits(words) == expected);
    }
  }
}

/// A list of whose length the host is not told has as many of the bits as there was room for, and the next time it has all.
TEST(StageLists, SetBitsIntoTheRoomThatThereIs) {
  Random random(4);
  Commands& commands = test_commands();
  Lists lists(commands);
  DeviceList list(commands);
  std::size_t cut = 0;
  for (const std::size_t size : {0, 1, 64, 65, 500, 3000, 100, 20000, 200, 0, 1, 300000}) {
    if (reference::small_tests() && size > 3000) continue;
    SCOPED_TRACE(std::to_string(size) + " words");
    std::vector<std::uint64_t> words(size, 0);
    std::vector<std::uint32_t> expected;
    for (std::size_t bit = 0; bit < 64 * size; ++bit) {
      if (!random.chance(0.3)) continue;
      words[bit / 64] |= std::uint64_t{1} << (bit % 64);
      expected.push_back(static_cast<std::uint32_t>(bit));
    }
    DeviceArray<cl_ulong> bits(commands);
    bits.write(words);
    const auto make = [&] {
      lists.list_bits("test", bits, size, list);
      list.read_length_later();
      commands.wait();
      list.note_length();
      return list.is_whole();
    };
    const bool whole = make();
    EXPECT_EQ(whole, expected.size() <= list.room());
    EXPECT_EQ(list.count(), std::min(list.room(), expected.size()));
    if (commands.shape().is_near) {
      EXPECT_EQ(list.room(), expected.size());
    }
    EXPECT_TRUE(list.read() == std::vector<std::uint32_t>(expected.begin(), expected.begin() + static_cast<std::ptrdiff_t>(list.count())));
    cut += whole ? 0 : 1;
    EXPECT_TRUE(make());
    EXPECT_TRUE(list.read() == expected);
  }
  if (!commands.shape().is_near) {
    EXPECT_GT(cut, reference::small_tests() ? 0u : 2u) << "there was always room";
  }
}

/// Enough words that the bits are counted before they are listed, on PoCL as well.
TEST(StageLists, SetBitsOfManyWords) {
  Random random(3);
  TestLists lists;
  for (const std::size_t size : {std::size_t{1} << 18, (std::size_t{1} << 18) + 1, std::size_t{1} << 19}) {
    std::vector<std::uint64_t> words(size, 0);
    std::vector<std::uint32_t> expected;
    for (std::size_t n = 0; n < size; ++n) {
      if (!random.chance(0.1)) continue;
      words[n] = random.chance(0.5) ? ~std::uint64_t{0} : std::uint64_t{1} << n % 64;
      for (std::size_t bit = 0; bit < 64; ++bit)
        if (words[n] >> bit & 1) expected.push_back(static_cast<std::uint32_t>(64 * n + bit));
    }
    EXPECT_TRUE(lists.list_bits(words) == expected) << size << " words";
  }
}

}  // namespace
}  // namespace frontier_surfels
