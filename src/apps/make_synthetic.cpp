/// make_synthetic OUT: writes a recording of a synthetic furnished room as a folder of images, and what an ideal sensor would have seen.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/command.hpp"
#include "apps/sequence_writer.hpp"
#include "config/config_text.hpp"
#include "frontier_surfels/paths.hpp"
#include "recordings/frame_source.hpp"
#include "recordings/objects_file.hpp"
#include "synthetic/synthetic_room.hpp"
#include "synthetic/synthetic_sensor.hpp"

namespace fs = std::filesystem;
namespace replay = frontier_surfels::replay;
using replay::CameraPath;
using replay::Scene;

namespace {

constexpr double kLargestPositionNoise = 0.1;  // [m]
constexpr double kLargestRotationNoise = 5;    // [degree]

struct Options {
  std::string output;
  std::string recording;  ///< that gets the errors instead of the room; empty: none
  int frames = 0;
  int width = 640;
  int height = 480;
  double focal = 0;  ///< [pixel]; 0: that of a Kinect
  Scene scene = Scene::kRoom;
  CameraPath path = CameraPath::kOrbit;
  replay::SensorModel sensor;
};

struct NamedPath {
  const char* name;
  CameraPath path;
};

/// With the path and the number of frames that it has unless others are chosen.
struct NamedScene {
  const char* name;
  Scene scene;
  CameraPath path;
  int frames;
};

constexpr NamedPath kPaths[] = {{"orbit", CameraPath::kOrbit}, {"explore", CameraPath::kExplore}, {"turn", CameraPath::kTurn},
                                {"walk", CameraPath::kWalk},   {"close", CameraPath::kClose},     {"arc", CameraPath::kArc},
                                {"watch", CameraPath::kWatch}};
constexpr NamedScene kScenes[] = {{"room", Scene::kRoom, CameraPath::kOrbit, 60},
                                  {"box_appears", Scene::kBoxAppears, CameraPath::kArc, 240},
                                  {"box_vanishes", Scene::kBoxVanishes, CameraPath::kArc, 240},
                                  {"box_returns", Scene::kBoxReturns, CameraPath::kArc, 240},
                                  {"person_walks", Scene::kPersonWalks, CameraPath::kWatch, 240}};

template <typename Named>
std::vector<std::string> names_of(const Named& list) {
  std::vector<std::string> names;
  for (const auto& named : list) names.emplace_back(named.name);
  return names;
}

/// @param name  of one in the list
template <typename Named>
const auto& named(const Named& list, const std::string& name) {
  return *std::find_if(std::begin(list), std::end(list), [&](const auto& one) { return one.name == name; });
}

/// Reads a size such as "640x480". @return an empty text, or what is wrong, as CLI11 validators do
std::string read_size(const std::string& text, int& width, int& height) {
  char rest = 0;
  const bool well_formed = std::sscanf(text.c_str(), "%dx%d%c", &width, &height, &rest) == 2;
  const bool fits = well_formed && std::min(width, height) >= 8 && std::max(width, height) <= 8192;
  return fits ? "" : "must be WIDTHxHEIGHT with 8 to 8192 pixels each, such as 640x480, not '" + text + "'.";
}

/// Reads "METRES,DEGREES", such as "0.003,0.2". @return as read_size()
std::string read_pose_noise(const std::string& text, replay::SensorModel& sensor) {
  const auto comma = text.find(',');
  double metres = -1, degrees = -1;
  const bool fits = comma != std::string::npos && frontier_surfels::from_text(text.substr(0, comma), metres) &&
                    frontier_surfels::from_text(text.substr(comma + 1), degrees) && metres >= 0 && metres <= kLargestPositionNoise &&
                    degrees >= 0 && degrees <= kLargestRotationNoise;
  if (!fits) return "must be METRES,DEGREES of at most 0.1,5, such as 0.003,0.2, not '" + text + "'.";
  sensor.position_noise = metres;
  sensor.rotation_noise = degrees * M_PI / 180;
  return "";
}

/// The folder of the recording, and truth/ in it.
class Output {
 public:
  Output(const fs::path& folder, const frontier_surfels::Intrinsics& camera)
      : folder_(folder), measured_(folder, camera), ideal_(folder / "truth", camera) {}

  void add(replay::SensedFrame frame) {
    measured_.add(frame.measured);
    frame.ideal.color.release();
    ideal_.add(frame.ideal);
    ++frames_;
  }

  void close(const std::vector<replay::SceneThing>& things) {
    measured_.close();
    ideal_.close();
    std::vector<frontier_surfels::scoring::SceneObject> objects;
    for (const replay::SceneThing& thing : things) objects.push_back(thing.object);
    if (!objects.empty()) replay::write_text(folder_ / "truth" / "objects.json", replay::objects_text(objects));
    std::printf("%d frames are in %s.\n", frames_, folder_.c_str());
  }

 private:
  fs::path folder_;
  replay::SequenceWriter measured_, ideal_;
  int frames_ = 0;
};

void write_room(const Options& options) {
  auto camera = replay::synthetic_camera(options.width, options.height);
  if (options.focal > 0) camera.fx = camera.fy = options.focal;
  Output output(frontier_surfels::absolute_path(options.output), camera);
  const replay::Room room(options.scene, options.frames);
  for (int index = 0; index < options.frames; ++index) output.add(room.sense(index, options.frames, camera, options.sensor, options.path));
  output.close(room.things());
}

void write_spoilt(const Options& options) {
  const auto source = replay::open_source(frontier_surfels::absolute_path(options.recording));
  std::optional<Output> output;
  int index = 0;
  while (const auto frame = source->next()) {
    if (!output) output.emplace(frontier_surfels::absolute_path(options.output), frame->intrinsics);
    output->add(replay::spoilt(*frame, options.sensor, index++));
  }
  if (!output) throw frontier_surfels::Error("No frame of '" + options.recording + "' could be used: check the recording.");
  output->close({});
}

void declare_errors(CLI::App& app, replay::SensorModel& sensor) {
  app.add_flag("--noise", sensor.noise, "depth noise like that of a Kinect: standard deviation 1.425e-3 z^2 [m], whole steps of disparity");
  app.add_option("--dropouts", sensor.dropouts,
                 "share of pixels that are lost in blobs; above 0, most pixels at edges and at grazing angles are lost as well")
      ->check(replay::number(0, 0.9));
  app.add_option("--outliers", sensor.outliers, "share of pixels with a random depth from 0.5 to 3 m")->check(replay::number(0, 1));
  app.add_flag("--flying", sensor.flying,
               "pixels beside an edge lie anywhere between foreground and background, as with structured light and time of flight");
  app.add_option_function<std::string>(
         "--pose-noise", [](const std::string&) {},
         "standard deviations of the recorded poses, along and about each axis, such as 0.003,0.2; the images are those of the true poses")
      ->type_name("METRES,DEGREES")
      ->check([&](const std::string& text) { return read_pose_noise(text, sensor); });
  app.add_option("--seed", sensor.seed, "seed of all these errors");
}

/// @throws CLI::ValidationError if an option is given that a recording has no use for
void refuse_room_options(const CLI::App& app) {
  for (const char* name : {"--scene", "--frames", "--path", "--focal", "--size"}) {
    if (app.count(name) > 0) throw CLI::ValidationError(name, "is for the room: leave it out, or leave out --from.");
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app(
      "Writes a synthetic sequence of depth and colour images with poses: depth/, color/, poses.txt, camera.txt. What an ideal sensor "
      "would have seen goes to truth/, for replay_score --truth: depth in floats, true poses, and in scenes with things that come and go "
      "objects.json, which says what stands where.",
      "make_synthetic");
  app.option_defaults()->always_capture_default();
  app.add_option("OUT", options.output, "folder to write")->required()->check(replay::not_empty());
  std::string scene = "room", path;
  app.add_option(
         "--scene", scene,
         "what happens: room (nothing), box_appears (a box is put on the table in the middle of the recording), box_vanishes (it is "
         "taken away), box_returns (it is away in the middle third) or person_walks (somebody comes in, walks along the table and "
         "leaves)")
      ->check(replay::one_of(names_of(kScenes)));
  app.option_defaults()->always_capture_default(false);
  app.add_option("--frames", options.frames, "number of frames along the whole path; default: 60, or 240 where something happens")
      ->check(replay::whole_number(1, 999999));
  app.add_option(
         "--path", path,
         "path of the camera: orbit (around the table; default of the room), explore (around the table, looking everywhere), turn (on "
         "the spot), walk (into the corridor), close (near the furniture), arc (to and fro around a corner of the table; default of "
         "the box) or watch (looks at the door and the table; default of person_walks)")
      ->check(replay::one_of(names_of(kPaths)));
  app.option_defaults()->always_capture_default();
  app.add_option("--focal", options.focal, "focal length [pixel]; 0: fx and fy of a Kinect")->check(replay::number(0, 1e5));
  declare_errors(app, options.sensor);
  app.add_option("--from", options.recording, "a bag or folder that gets these errors, instead of the room; truth/ is what it has recorded")
      ->type_name("RECORDING")
      ->check(replay::not_empty());
  std::string size = "640x480";
  app.add_option("--size", size, "width and height of the images [pixel]")->check([&](const std::string& text) {
    return read_size(text, options.width, options.height);
  });
  return replay::run_command("make_synthetic", "make smaller images (--size).", [&] {
    replay::parse_arguments(app, argc, argv);
    const NamedScene& chosen = named(kScenes, scene);
    options.scene = chosen.scene;
    options.path = path.empty() ? chosen.path : named(kPaths, path).path;
    if (options.frames == 0) options.frames = chosen.frames;
    if (options.recording.empty()) {
      write_room(options);
    } else {
      refuse_room_options(app);
      write_spoilt(options);
    }
  });
}
