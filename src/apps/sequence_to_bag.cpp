/// sequence_to_bag FOLDER OUT.bag: writes a recording in a folder as a bag.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "apps/command.hpp"
#include "frontier_surfels/paths.hpp"
#include "recordings/bag_writer.hpp"
#include "recordings/frame_source.hpp"

namespace replay = frontier_surfels::replay;

int main(int argc, char** argv) {
  std::string folder, output;
  replay::SourceOptions source_options;
  replay::BagOptions options;
  bool no_slashes = false;

  CLI::App app("Writes a recorded sequence as a bag, with the topics and tf frames of the TUM RGB-D benchmark's bags.", "sequence_to_bag");
  app.option_defaults()->always_capture_default();
  app.add_option("FOLDER", folder, "folder of the recording: depth/ + poses.txt + camera.txt, or TUM RGB-D layout")
      ->required()
      ->check(replay::not_empty());
  app.add_option("OUT.bag", output, "bag to write")->required()->check(replay::not_empty());
  app.add_option("--encoding", options.encoding, "encoding of the depth images")->check(replay::one_of({"32FC1", "16UC1"}));
  app.add_option("--depth-unit", options.depth_unit, "one step of the folder's 16-bit depth images [m]; TUM RGB-D layout has its own")
      ->check(replay::positive_number());
  app.add_flag("--compressed", options.compressed,
               "write compressedDepth and JPEG images instead of raw ones; depth as 32FC1 is then quantised");
  app.add_option("--compression", options.compression, "compression of the bag")->check(replay::one_of({"none", "lz4", "bz2"}));
  app.add_flag("--no-slashes", no_slashes, "write the names of tf frames without leading slashes");
  app.add_flag("--static-tf", options.static_transforms, "write constant transforms to /tf_static (latched) instead of to /tf");
  app.add_option("--depth-topic", options.depth_topic, "topic of the depth images")->check(replay::not_empty());
  app.add_option("--info-topic", options.depth_info_topic, "topic of the depth camera's camera_info")->check(replay::not_empty());
  app.add_option("--color-topic", options.color_topic, "topic of the colour images")->check(replay::not_empty());
  app.add_option("--color-info-topic", options.color_info_topic, "topic of the colour camera's camera_info")->check(replay::not_empty());
  app.add_option("--first", source_options.first, "index of the first frame")->check(replay::whole_number(0));
  app.add_option("--last", source_options.last, "index of the last frame; -1: the end");
  app.add_option("--stride", source_options.stride, "use every N-th frame")->check(replay::whole_number(1));
  return replay::run_command("sequence_to_bag", "the images are too large for this machine.", [&] {
    replay::parse_arguments(app, argc, argv);
    options.leading_slashes = !no_slashes;
    for (std::string* path : {&folder, &output}) *path = frontier_surfels::absolute_path(*path);
    const auto source = replay::open_source(folder, source_options);
    const replay::BagSummary summary = replay::write_bag(*source, output, options);
    for (const std::string& sentence : source->notes()) std::printf("%s\n", sentence.c_str());
    for (const std::string& sentence : source->skipped()) std::printf("%s\n", sentence.c_str());
    if (summary.stamp_shift != 0) std::printf("All stamps are shifted by %.0f s, because ROS has no time 0.\n", summary.stamp_shift);
    std::printf("%zu frames are in %s.\n", summary.frames, output.c_str());
  });
}
