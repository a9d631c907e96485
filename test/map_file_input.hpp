/// Surfels and folders for the tests of saved maps.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "frontier_surfels/map_file.hpp"
#include "temporary_folder.hpp"

namespace frontier_surfels {

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

inline std::vector<Surfel> some_surfels(std::size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> number(-5, 5);
  std::vector<Surfel> surfels(count);
  for (Surfel& s : surfels) {
    s.position = {number(random), number(random), number(random)};
    s.normal = Eigen::Vector3f(number(random), number(random), number(random)).normalized();
    s.radius = 0.01f + std::abs(number(random));
    s.label = random() % 2 ? Label::kOccupied : Label::kFrontier;
    if (random() % 3 > 0)
      s.rgb = {static_cast<std::uint8_t>(random()), static_cast<std::uint8_t>(random()), static_cast<std::uint8_t>(random())};
    s.id = 1000000 + random() % 1000;
  }
  return surfels;
}

/// Everything but the ids, which are counted anew when a map is read.
inline testing::AssertionResult same_but_ids(const std::vector<Surfel>& a, const std::vector<Surfel>& b) {
  if (a.size() != b.size()) return testing::AssertionFailure() << a.size() << " and " << b.size() << " surfels";
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i].position != b[i].position || a[i].normal != b[i].normal || a[i].radius != b[i].radius || a[i].label != b[i].label ||
        a[i].rgb != b[i].rgb)
      return testing::AssertionFailure() << "surfel " << i << " differs";
    if (b[i].id != i) return testing::AssertionFailure() << "surfel " << i << " has the id " << b[i].id;
  }
  return testing::AssertionSuccess();
}

/// What the action complains of; "" if it does not.
template <typename Action>
std::string file_fault(const Action& action) {
  try {
    action();
  } catch (const FileError& error) {
    return error.what();
  }
  return "";
}

/// Gives every test a folder of its own, with the path of one map in it.
class MapFileFolder : public testing::Test {
 protected:
  explicit MapFileFolder(const std::string& ending) : ending_(ending) {}

  std::size_t files() const { return std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator()); }

  std::string bytes() const {
    std::ifstream file(path_, std::ios::binary);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
  }
  void put(const std::string& bytes) const { std::ofstream(path_, std::ios::binary) << bytes; }

  /// What reading a file of these bytes complains of.
  std::string fault(const std::string& bytes) const {
    put(bytes);
    return file_fault([&] { read_map(path_); });
  }

  std::string ending_;
  const TemporaryFolder temporary_{"map_file"};
  const std::filesystem::path folder_ = temporary_.path();
  std::string path_ = (folder_ / ("map" + ending_)).string();
};

}  // namespace frontier_surfels
