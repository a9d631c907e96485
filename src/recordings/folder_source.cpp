#include "recordings/folder_source.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "frontier_surfels/number_text.hpp"
#include "recordings/text_files.hpp"

namespace frontier_surfels::replay {
namespace fs = std::filesystem;
namespace {

constexpr double kAssociationTolerance = 0.020;  // [s]
constexpr double kQuaternionTolerance = 1e-2;    // largest difference of the norm from 1 that can be rounding
constexpr float kTumUnitsPerMetre = 5000.0f;

bool is_image(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return std::tolower(c); });
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg" || extension == ".tif" || extension == ".tiff";
}

bool is_number(const fs::path& path) {
  const std::string stem = path.stem().string();
  return stem.find_first_not_of("0123456789") == std::string::npos;
}

/// The images of a folder in the order of their names. If all names are numbers, the order is that of the numbers, with or without zeros
/// in front.
std::vector<fs::path> images_in(const fs::path& folder) {
  std::vector<fs::path> images;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && is_image(entry.path())) images.push_back(entry.path());
  }
  std::sort(images.begin(), images.end());
  if (std::all_of(images.begin(), images.end(), is_number)) {
    const auto digits = [](const fs::path& path) {
      const std::string stem = path.stem().string();
      return stem.substr(std::min(stem.find_first_not_of('0'), stem.size() - 1));
    };
    std::stable_sort(images.begin(), images.end(), [&](const fs::path& a, const fs::path& b) {
      const std::string digits_a = digits(a), digits_b = digits(b);
      return digits_a.size() != digits_b.size() ? digits_a.size() < digits_b.size() : digits_a < digits_b;
    });
  }
  return images;
}

/// Reads an image. Returns an empty one if that fails for whatever reason.
cv::Mat read_image(const fs::path& path, int flags) {
  try {
    return cv::imread(path.string(), flags);
  } catch (const cv::Exception&) {
    return {};
  }
}

/// The element nearest to `stamp` in a list sorted by stamp, or null if none is within the tolerance.
template <typename T>
const T* nearest(const std::vector<T>& sorted, double stamp) {
  auto after = std::lower_bound(sorted.begin(), sorted.end(), stamp, [](const T& element, double value) { return element.stamp < value; });
  const T* best = nullptr;
  double best_distance = kAssociationTolerance;
  for (auto it = after == sorted.begin() ? after : std::prev(after); it != sorted.end() && it <= after; ++it) {
    const double distance = std::abs(it->stamp - stamp);
    if (distance <= best_distance) {
      best = &*it;
      best_distance = distance;
    }
  }
  return best;
}

}  // namespace

Eigen::Isometry3d to_pose(const std::vector<double>& numbers) {
  if (numbers.empty()) {
    throw BadFrame("no pose lies within " + std::to_string(std::lround(kAssociationTolerance * 1e3)) + " ms of its stamp");
  }
  if (!std::all_of(numbers.begin(), numbers.end(), [](double number) { return std::isfinite(number); })) {
    throw BadFrame("its pose is not finite");
  }
  const Eigen::Quaterniond rotation(numbers[6], numbers[3], numbers[4], numbers[5]);
  if (!(std::abs(rotation.norm() - 1) <= kQuaternionTolerance)) {
    throw BadFrame("the quaternion of its pose has the length " + fixed_text(rotation.norm(), 6) + " instead of 1");
  }
  return Eigen::Translation3d(numbers[0], numbers[1], numbers[2]) * rotation.normalized();
}

FolderSource::FolderSource(const fs::path& folder, const SourceOptions& options) : folder_(folder) {
  if (fs::exists(folder / "poses.txt")) {
    list_numbered_images();
  } else if (fs::exists(folder / "groundtruth.txt") && fs::exists(folder / "depth.txt")) {
    list_tum_images();
  } else {
    throw Error(folder.string() +
                " is not a recording: a folder needs depth/, poses.txt and camera.txt, or TUM RGB-D's depth.txt and groundtruth.txt.");
  }
  selection_ = select_frames(options, entries_.size(), folder.string());
}

void FolderSource::list_numbered_images() {
  if (!fs::is_directory(folder_ / "depth")) throw Error(folder_.string() + " has a poses.txt, but no folder depth/ with the images.");
  intrinsics_ = read_camera(folder_ / "camera.txt");
  const std::vector<StampedPose> poses = read_poses(folder_ / "poses.txt");
  const std::vector<fs::path> images = images_in(folder_ / "depth");
  if (poses.size() != images.size()) {
    throw Error(folder_.string() + " has " + std::to_string(poses.size()) + " poses in poses.txt for " + std::to_string(images.size()) +
                " images in depth/: there must be one line for each image.");
  }
  for (std::size_t i = 0; i < images.size(); ++i) {
    fs::path color;
    for (const char* extension : {".jpg", ".jpeg", ".png"}) {
      const fs::path candidate = folder_ / "color" / images[i].stem().concat(extension);
      if (color.empty() && fs::exists(candidate)) color = candidate;
    }
    entries_.push_back({poses[i].stamp, images[i], color, poses[i].pose});
  }
}

void FolderSource::list_tum_images() {
  tum_layout_ = true;
  if (fs::exists(folder_ / "camera.txt")) {
    intrinsics_ = read_camera(folder_ / "camera.txt");
  } else {
    choose_tum_camera();
  }
  const auto by_stamp = [](const auto& a, const auto& b) { return a.stamp < b.stamp; };
  std::vector<StampedPose> poses = read_poses(folder_ / "groundtruth.txt");
  poses.erase(std::remove_if(poses.begin(), poses.end(), [](const StampedPose& pose) { return !std::isfinite(pose.stamp); }), poses.end());
  std::stable_sort(poses.begin(), poses.end(), by_stamp);
  std::vector<StampedFile> colors;
  if (fs::exists(folder_ / "rgb.txt")) colors = read_file_list(folder_ / "rgb.txt");
  std::stable_sort(colors.begin(), colors.end(), by_stamp);

  std::vector<StampedFile> images = read_file_list(folder_ / "depth.txt");
  if (!std::is_sorted(images.begin(), images.end(), by_stamp)) {
    std::stable_sort(images.begin(), images.end(), by_stamp);
    notes_.push_back("The images of " + (folder_ / "depth.txt").string() +
                     " are not listed in the order of their stamps: they are sorted.");
  }
  for (const StampedFile& image : images) {
    const StampedPose* pose = nearest(poses, image.stamp);
    const StampedFile* color = nearest(colors, image.stamp);
    entries_.push_back(
        {image.stamp, folder_ / image.file, color ? folder_ / color->file : fs::path(), pose ? pose->pose : std::vector<double>()});
  }
}

/// Uses the calibration that TUM publishes for the camera in the folder's name.
void FolderSource::choose_tum_camera() {
  const struct {
    const char* name;
    const char* short_name;
    Intrinsics intrinsics;
  } kCameras[] = {{"freiburg1", "fr1", {517.3, 516.5, 318.6, 255.3, 640, 480}},
                  {"freiburg2", "fr2", {520.9, 521.0, 325.1, 249.7, 640, 480}},
                  {"freiburg3", "fr3", {535.4, 539.2, 320.1, 247.6, 640, 480}}};
  const fs::path full = fs::weakly_canonical(folder_);
  const std::string name = full.filename().string();
  for (const auto& camera : kCameras) {
    if (name.find(camera.name) == std::string::npos && name.find(camera.short_name) == std::string::npos) continue;
    intrinsics_ = camera.intrinsics;
    notes_.push_back("There is no camera.txt in " + folder_.string() + ": TUM's calibration of " + camera.name +
                     " is used, because the folder's name contains it.");
    return;
  }
  throw Error(folder_.string() +
              " has no camera.txt, and its name contains none of freiburg1, freiburg2, freiburg3: write a file camera.txt with the line "
              "`fx fy cx cy width height`.");
}

std::optional<RecordedFrame> FolderSource::next() {
  while (done_ < selection_.count) {
    const std::size_t index = selection_.first + done_++ * selection_.stride;
    try {
      return read(index);
    } catch (const BadFrame& fault) {
      skipped_.push_back("Frame " + entries_[index].depth.string() + " is skipped: " + fault.what() + ".");
    }
  }
  return std::nullopt;
}

RecordedFrame FolderSource::read(std::size_t index) {
  const Entry& entry = entries_[index];
  RecordedFrame frame;
  if (!std::isfinite(entry.stamp)) throw BadFrame("its stamp is not finite");
  frame.index = index;
  frame.stamp = entry.stamp;
  frame.T_world_camera = to_pose(entry.pose);
  frame.intrinsics = intrinsics_;
  frame.depth = read_depth(entry);
  if (!entry.color.empty()) frame.color = read_color(entry, frame.depth.size());
  return frame;
}

/// @return CV_16UC1 as it is recorded, or CV_32FC1 [m]
cv::Mat FolderSource::read_depth(const Entry& entry) const {
  if (!fs::exists(entry.depth)) throw BadFrame("there is no such file");
  const cv::Mat depth = read_image(entry.depth, cv::IMREAD_UNCHANGED);
  if (depth.empty()) throw BadFrame("the image cannot be read");
  if (depth.type() != CV_16UC1 && depth.type() != CV_32FC1) throw BadFrame("the image must have one channel of 16 bits, or of floats");
  if (depth.size() != cv::Size(intrinsics_.width, intrinsics_.height)) {
    throw BadFrame("the image has " + std::to_string(depth.cols) + "x" + std::to_string(depth.rows) + " pixels, but camera.txt says " +
                   std::to_string(intrinsics_.width) + "x" + std::to_string(intrinsics_.height));
  }
  if (!tum_layout_ || depth.type() == CV_32FC1) return depth;
  cv::Mat metres(depth.size(), CV_32FC1);
  std::transform(depth.begin<std::uint16_t>(), depth.end<std::uint16_t>(), metres.begin<float>(),
                 [](std::uint16_t value) { return value == 65535 ? 0 : static_cast<float>(value) / kTumUnitsPerMetre; });
  return metres;
}

/// The colour image of a frame, or an empty one. A fault of a colour image never drops a frame.
cv::Mat FolderSource::read_color(const Entry& entry, const cv::Size& size) {
  const cv::Mat color = read_image(entry.color, cv::IMREAD_COLOR);
  if (color.size() == size) return color;
  notes_.push_back("Colour image " + entry.color.string() + (color.empty() ? " cannot be read" : " has another size than the depth image") +
                   ": its frame is used without colour.");
  return {};
}

}  // namespace frontier_surfels::replay
