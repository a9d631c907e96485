/// Writes recordings as folders of images.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "recordings/recorded_frame.hpp"

namespace frontier_surfels::replay {

/// A folder with depth/, poses.txt, camera.txt and, if the frames have colour, color/. All functions throw FileError.
class SequenceWriter {
 public:
  /// Makes the folder. Refuses one that has depth images already.
  SequenceWriter(const std::filesystem::path& folder, const Intrinsics& camera);

  /// Writes depth as PNG (CV_16UC1) or TIFF (CV_32FC1).
  void add(const RecordedFrame& frame);

  /// Ends the text files.
  void close();

 private:
  std::filesystem::path folder_;
  std::ofstream poses_;
};

/// Writes a text file.
void write_text(const std::filesystem::path& path, const std::string& text);

}  // namespace frontier_surfels::replay
