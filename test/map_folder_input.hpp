/// Folders and their contents for the tests of map folders.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "storage/map_folder.hpp"
#include "temporary_folder.hpp"

namespace frontier_surfels {

using Bytes = std::vector<std::uint8_t>;
using Content = std::map<BlockKey, Bytes>;

constexpr double kBlockSize = 0.5;  // [m]

inline Bytes random_bytes(std::mt19937& random, std::size_t size) {
  Bytes bytes(size);
  for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

inline Content content_of(const MapFolder& folder) {
  Content content;
  for (const BlockKey& key : folder.keys()) content[key] = folder.read(key);
  return content;
}

template <typename Action>
std::string fault_of(const Action& action) {
  try {
    action();
  } catch (const FileError& error) {
    return error.what();
  }
  return "no FileError was thrown";
}

/// Is `said` a sentence about a map folder that contains `what`?
inline testing::AssertionResult says(const std::string& said, const std::string& what) {
  if (said.find(what) != std::string::npos && said.find("The map folder") == 0 && said.back() == '.') return testing::AssertionSuccess();
  return testing::AssertionFailure() << "said '" << said << "'";
}

class MapFolders : public testing::Test {
 protected:
  std::string fault_of_opening(const std::string& path, double block_size = kBlockSize) {
    return fault_of([&] { MapFolder(path, block_size); });
  }

  std::mt19937 random_{1};
  const TemporaryFolder temporary_{"map_folder"};
  const std::filesystem::path root_ = temporary_.path();
  std::string path_ = (root_ / "maps" / "kitchen").string();
  const std::filesystem::path file_ = std::filesystem::path(path_) / "map.sqlite";
};

}  // namespace frontier_surfels
