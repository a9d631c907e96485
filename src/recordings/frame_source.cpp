#include "recordings/frame_source.hpp"

#include <algorithm>
#include <filesystem>

#include "recordings/folder_source.hpp"
#include "recordings/selection.hpp"
#ifdef FRONTIER_SURFELS_WITH_ROS
#include "recordings/bag_source.hpp"
#endif

namespace frontier_surfels::replay {

Selection select_frames(const SourceOptions& options, std::size_t frames, const std::string& path) {
  if (options.stride < 1) throw Error("The stride must be 1 or more, not " + std::to_string(options.stride) + ".");
  if (options.first < 0) throw Error("The first frame must be 0 or more, not " + std::to_string(options.first) + ".");
  if (options.last < -1 || (options.last != -1 && options.last < options.first)) {
    throw Error("The last frame (" + std::to_string(options.last) + ") must not be before the first (" + std::to_string(options.first) +
                "); -1 stands for the end.");
  }
  if (frames == 0) throw Error(path + " has no frames.");

  Selection selection;
  selection.first = static_cast<std::size_t>(options.first);
  selection.stride = static_cast<std::size_t>(options.stride);
  if (selection.first >= frames) {
    throw Error(path + " has " + std::to_string(frames) + " frames, counted from 0: there is no first frame " +
                std::to_string(options.first) + ".");
  }
  const std::size_t end = options.last == -1 ? frames : std::min(frames, static_cast<std::size_t>(options.last) + 1);
  selection.count = (end - selection.first + selection.stride - 1) / selection.stride;
  return selection;
}

std::unique_ptr<FrameSource> open_source(const std::string& path, const SourceOptions& options) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return std::make_unique<FolderSource>(path, options);
  if (!std::filesystem::exists(path, ignored)) throw Error("There is no folder or bag '" + path + "'.");
#ifdef FRONTIER_SURFELS_WITH_ROS
  return std::make_unique<BagSource>(path, options);
#else
  throw Error(path + " is a file, but this program was built without ROS and cannot read bags: give a folder, or build with ROS.");
#endif
}

}  // namespace frontier_surfels::replay
