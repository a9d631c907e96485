#include "recordings/text_files.hpp"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "config/c_locale.hpp"

namespace frontier_surfels::replay {
namespace {

struct Line {
  std::string where;  ///< file and number of the line, for messages
  std::vector<std::string> words;
};

std::vector<Line> read_lines(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw Error(path.string() + " is missing or cannot be read.");
  std::vector<Line> lines;
  std::string text;
  for (int number = 1; std::getline(file, text); ++number) {
    constexpr const char* kByteOrderMark = "\xEF\xBB\xBF";  // some editors begin UTF-8 files with it
    if (number == 1 && text.compare(0, 3, kByteOrderMark) == 0) text.erase(0, 3);
    std::istringstream stream(text.substr(0, text.find('#')));
    Line line{path.string() + ", line " + std::to_string(number), {}};
    for (std::string word; stream >> word;) line.words.push_back(word);
    if (!line.words.empty()) lines.push_back(std::move(line));
  }
  return lines;
}

/// Accepts nan and inf, unlike a stream: trackers write them where they have lost the camera.
double to_number(const Line& line, std::size_t index) {
  const std::string& word = line.words[index];
  const CLocale c_locale;
  char* end = nullptr;
  const double number = std::strtod(word.c_str(), &end);
  if (end != word.c_str() + word.size()) throw Error(line.where + ": '" + word + "' is not a number.");
  return number;
}

void expect_words(const Line& line, std::size_t count, const char* form) {
  if (line.words.size() == count) return;
  throw Error(line.where + " has " + std::to_string(line.words.size()) + " entries, but must have the form `" + form + "`.");
}

}  // namespace

std::vector<StampedPose> read_poses(const std::filesystem::path& path) {
  std::vector<StampedPose> poses;
  for (const Line& line : read_lines(path)) {
    expect_words(line, 8, "stamp tx ty tz qx qy qz qw");
    StampedPose pose{to_number(line, 0), {}};
    for (std::size_t i = 1; i < line.words.size(); ++i) pose.pose.push_back(to_number(line, i));
    poses.push_back(std::move(pose));
  }
  return poses;
}

std::vector<StampedFile> read_file_list(const std::filesystem::path& path) {
  std::vector<StampedFile> files;
  for (const Line& line : read_lines(path)) {
    expect_words(line, 2, "stamp file");
    const double stamp = to_number(line, 0);
    if (!std::isfinite(stamp)) throw Error(line.where + ": the stamp is not finite.");
    files.push_back({stamp, line.words[1]});
  }
  return files;
}

Intrinsics read_camera(const std::filesystem::path& path) {
  const std::vector<Line> lines = read_lines(path);
  if (lines.size() != 1)
    throw Error(path.string() + " must have one line `fx fy cx cy width height`, not " + std::to_string(lines.size()) + ".");
  expect_words(lines[0], 6, "fx fy cx cy width height");
  double numbers[6];
  for (std::size_t i = 0; i < 6; ++i) {
    numbers[i] = to_number(lines[0], i);
    if (!std::isfinite(numbers[i])) throw Error(lines[0].where + ": '" + lines[0].words[i] + "' is not finite.");
  }
  const auto is_size = [](double number) { return number >= 1 && number <= 65535 && number == std::floor(number); };
  if (!(numbers[0] > 0) || !(numbers[1] > 0)) throw Error(lines[0].where + ": the focal lengths must be above 0.");
  if (!is_size(numbers[4]) || !is_size(numbers[5])) throw Error(lines[0].where + ": width and height must be whole numbers of pixels.");
  return {numbers[0], numbers[1], numbers[2], numbers[3], static_cast<int>(numbers[4]), static_cast<int>(numbers[5])};
}

}  // namespace frontier_surfels::replay
