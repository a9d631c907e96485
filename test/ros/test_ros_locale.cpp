/// What the node says is in the C locale, whatever locale the program around it has, which may be a nodelet manager.
#include <diagnostic_updater/DiagnosticStatusWrapper.h>

#include <sstream>
#include <vector>

#include "locale_input.hpp"
#include "ros/bag_input.hpp"
#include "ros/input/conversions.hpp"
#include "ros/input/frame_remarks.hpp"
#include "ros/input/parameters.hpp"
#include "ros/output/mapping_status.hpp"

namespace frontier_surfels {
namespace {

void say_diagnostics(std::ostream& said) {
  MappingStatus status("device", "/depth");
  FrameReport report;
  report.result = FrameReport::INTEGRATED;
  report.total_ms = 1.5;
  const auto now = MappingStatus::Clock::now();
  for (int n = 0; n < 1234; ++n) status.add(report, now);
  Statistics map;
  map.surfels = 1234567;
  map.map_bytes = map.device_bytes = 1234567890;
  status.set_map(map, 0);
  diagnostic_updater::DiagnosticStatusWrapper filled;
  status.fill(filled, now);
  for (const auto& entry : filled.values) said << entry.key << ": " << entry.value << "\n";
}

void say_faults(std::ostream& said) {
  NodeConfig config;
  config.tf_timeout = 12.5;
  config.marker_limit = 12345678;
  for (const std::string& problem : config.problems()) said << problem << "\n";
  try {
    messages::depth_pixels({nullptr, boost::make_shared<sensor_msgs::CompressedImage>(replay::compressed_depth(1, 0, 0.5F))});
  } catch (const BadFrame& fault) {
    said << fault.what() << "\n";
  }
}

void say_remarks(std::ostream& said) {
  FrameRemarks remarks(Config(), [](const std::string&) {});
  const std::vector<float> pixels(64, 0.125F);
  DepthFrame frame;
  frame.depth = {8, 8, 32, DepthImage::Encoding::kMetresF32, pixels.data(), false};
  said << remarks.on(frame, 1, replay::info_message(1), {}) << "\n";
}

std::string all_texts() {
  std::ostringstream said;
  said.imbue(std::locale::classic());
  say_diagnostics(said);
  say_faults(said);
  say_remarks(said);
  return said.str();
}

TEST_F(LocaleTest, OfStreamsChangesNoTextOfTheNode) { compare_with_streams(all_texts); }

TEST_F(LocaleTest, OfTheCLibraryChangesNoTextOfTheNode) { compare_with_the_c_library(all_texts); }

}  // namespace
}  // namespace frontier_surfels
