/// All parameters of the mapper. Defaults, units, meanings and ranges are stated here and nowhere else.
#pragma once

#include <string>
#include <vector>

namespace frontier_surfels {

struct Config {
  // Device
  std::string platform;
  std::string device_type = "any";
  int device_index = 0;
  int threads = 0;
  int lanes = 0;
  int stage_times_every = 0;

  // Working image and grid (paper 3.1)
  double depth_unit = 0.001;
  int decimation = 4;
  std::string sampling = "mean";
  double z_min = 0.5;
  double z_max = 3.0;
  int padding_i = 5;
  int padding_j = 5;
  int padding_k = 2;

  // Sensor (ours)
  double noise = 0;
  double noise_growth = 0.0015;
  double quantisation = 0.003;
  double agreement = 0.03;

  // Poses (ours)
  bool correct_poses = true;

  // Observed space (paper 3.3)
  bool carve_no_return = false;
  bool carve_beyond_range = false;

  // Known space from the surfels (paper 3.2)
  double th_d = 0.4;
  double peak = 0.5;
  double thickness = 1.7320508;
  int median_votes = 14;

  // Recent views (ours)
  int recent_views = 250;
  double recent_view_distance = 0.005;
  double recent_view_angle = 0.4;
  bool seen_points = true;
  double seen_spacing = 0;
  bool take_back = true;

  // Removal, creation and labels (paper 3.4, 3.5)
  bool remove_buried = true;
  double min_gap = 0.005;
  bool refine_surfels = true;
  double surface_depth = 0.03;

  // Maps larger than memory (ours)
  std::string map_folder;
  double eviction_radius = 20;

  /// A sentence for every fault; empty if the configuration can be used.
  std::vector<std::string> problems() const;
};

/// Description of a field.
struct FieldInfo {
  const char* name;
  const char* unit;        ///< "" if there is none
  const char* meaning;     ///< one sentence
  double lowest = 0;       ///< smallest allowed value, for numbers only
  double highest = 0;      ///< largest allowed value, for numbers only
  const char* group = "";  ///< heading in the table of parameters
};

/// Calls visit(FieldInfo, field) for every field of `config` (Config or const Config), in order.
/// YAML files, --set, the table of parameters and ROS parameters all use this list.
template <typename ConfigT, typename Visitor>
void for_each_field(ConfigT& config, Visitor&& visit) {
  const char* group = "Device";
  const auto field = [&visit, &group](FieldInfo info, auto& value) {
    info.group = group;
    visit(info, value);
  };
  field(FieldInfo{"platform", "", "part of the name of the OpenCL platform, in any case; empty: any"}, config.platform);
  field(FieldInfo{"device_type", "", "type of the OpenCL device: any, cpu, gpu or accelerator; any: the fastest"}, config.device_type);
  field(FieldInfo{"device_index", "",
                  "number of the device to use, from 0, among those that fit platform and device_type, fastest first: `replay_score "
                  "--devices` lists them",
                  0, 255},
        config.device_index);
  field(FieldInfo{"threads", "", "number of compute units to use, if the device can be divided; 0: all", 0, 4096}, config.threads);
  field(FieldInfo{"lanes", "", "points that one work item handles at once: 16 or 1; 0: 16 on a CPU with PoCL, 1 on other devices", 0, 16},
        config.lanes);
  field(FieldInfo{"stage_times_every", "",
                  "the device's time of each stage is measured in one frame of so many; 0: in every frame on a CPU, in one of 32 on other "
                  "devices, where measuring costs more than launching",
                  0, 1000000},
        config.stage_times_every);

  group = "Working image and grid";
  field(FieldInfo{"depth_unit", "m", "one step of a 16-bit depth image; images of 32 bits and folders in TUM's layout are in metres anyway",
                  1e-6, 1},
        config.depth_unit);
  field(FieldInfo{"decimation", "pixel", "the working image has every n-th column and row of the depth image", 1, 64}, config.decimation);
  field(FieldInfo{"sampling", "",
                  "a depth of the working image is the mean of the pixels around it that measure the same surface, or that of the nearest "
                  "pixel: mean or nearest"},
        config.sampling);
  field(FieldInfo{"z_min", "m", "smallest depth that is used; nearer measurements are ignored", 0.01, 100}, config.z_min);
  field(FieldInfo{"z_max", "m", "depth up to which space is mapped", 0.02, 1000}, config.z_max);
  field(FieldInfo{"padding_i", "voxel", "width of the grid beyond the left and right edges of the image", 1, 64}, config.padding_i);
  field(FieldInfo{"padding_j", "voxel", "height of the grid beyond the upper and lower edges of the image", 1, 64}, config.padding_j);
  field(FieldInfo{"padding_k", "voxel", "depth of the grid behind the camera", 1, 64}, config.padding_k);

  group = "Sensor";
  field(FieldInfo{"noise", "m", "standard deviation of a pixel's depth at z = 0: it is noise + noise_growth z^2", 0, 1}, config.noise);
  field(FieldInfo{"noise_growth", "1/m", "growth of a pixel's standard deviation with the square of its depth", 0, 1}, config.noise_growth);
  field(FieldInfo{"quantisation", "1/m", "step between two depths at 1 m; it grows with the square of the depth", 0, 1},
        config.quantisation);
  field(FieldInfo{"agreement", "",
                  "with sampling: mean, pixels around a pixel measure the same surface if their depths differ by at most this share, or by "
                  "three standard deviations and a step",
                  0.001, 0.5},
        config.agreement);

  group = "Poses";
  field(
      FieldInfo{
          "correct_poses", "",
          "whether jitter of the given poses from frame to frame is taken out, by aligning each frame with the last frames of its camera"},
      config.correct_poses);

  group = "Observed space";
  field(FieldInfo{"carve_no_return", "", "whether a depth of +Inf means that space is free up to z_max"}, config.carve_no_return);
  field(FieldInfo{"carve_beyond_range", "", "whether a depth beyond z_max means that space is free up to z_max"},
        config.carve_beyond_range);

  group = "Known space from the surfels, once a view was forgotten and if seen_points is false";
  field(FieldInfo{"th_d", "", "a surfel counts on a path if the cosine between its normal and the path is larger than this", 0, 0.99},
        config.th_d);
  field(FieldInfo{"peak", "", "extremes of the sign field smaller than this do not count", 0.01, 10}, config.peak);
  field(FieldInfo{"thickness", "voxel", "reach of a surfel along its normal in the sign field", 0.5, 4}, config.thickness);
  field(FieldInfo{"median_votes", "voxel", "a voxel is known if at least this many are known among it and its 26 neighbours", 1, 27},
        config.median_votes);

  group = "Recent views";
  field(FieldInfo{"recent_views", "", "maximum number of kept views", 0, 1024}, config.recent_views);
  field(FieldInfo{"recent_view_distance", "m",
                  "a view is kept if the camera has moved this far from every kept view, or turned by recent_view_angle", 0, 100},
        config.recent_view_distance);
  field(FieldInfo{"recent_view_angle", "deg",
                  "a view is kept if the camera has turned this much from every kept view, or moved by recent_view_distance", 0, 180},
        config.recent_view_angle);

  field(FieldInfo{"seen_points", "",
                  "whether what views have seen is remembered when they are no longer kept; false: the paper's known space decides then"},
        config.seen_points);
  field(
      FieldInfo{
          "seen_spacing", "m",
          "largest distance of the points that are remembered; 0: 2.5 voxels at z_min, or at z_max / 6 if that is farther; a map that "
          "is loaded or reopened keeps its own",
          0, 1},
      config.seen_spacing);

  field(FieldInfo{"take_back", "",
                  "whether a surface that stands where space was seen to be free makes the space behind it unknown again, so that things "
                  "that are put down appear; only with seen_points"},
        config.take_back);

  group = "Removal, creation and labels";
  field(FieldInfo{"remove_buried", "", "whether surfels whose back is seen by the new frame are removed as well"}, config.remove_buried);
  field(FieldInfo{"min_gap", "m", "no frontier on sheets of unknown space that are thinner than this; 0: all frontier is kept", 0, 1},
        config.min_gap);
  field(FieldInfo{"refine_surfels", "",
                  "whether new surfels move from the centre of their voxel to the boundary, and turn if known space before them is thin"},
        config.refine_surfels);
  field(
      FieldInfo{"surface_depth", "m",
                "a surfel at most this far behind a measured surface is occupied; 0: only a surfel at the end of an observed column", 0, 1},
      config.surface_depth);

  group = "Maps larger than memory";
  field(FieldInfo{"map_folder", "", "folder on disk that keeps the map, including the parts that are not in memory; empty: none"},
        config.map_folder);
  field(FieldInfo{"eviction_radius", "m",
                  "with a map_folder: parts of the map farther than this from the camera, along any axis, leave memory", 1, 1e6},
        config.eviction_radius);
}

/// Reads a flat YAML map of fields; the others keep their defaults. Ranges are not checked here, but by problems().
/// @throws FileError  if the file cannot be read
/// @throws Error      names every unknown, repeated or malformed entry with file and line
Config load_config(const std::string& path);

/// Sets one field from text, as --set key=value does.
/// @throws Error  there is no such field (the message suggests the most similar name), or the text is not of its type
void set_field(Config& config, const std::string& name, const std::string& value);

/// "; did you mean 'x'?" with the name most similar to `name` among the fields of Config and `more`. If none is similar, says where to
/// find all names.
std::string suggestion(const std::string& name, const std::vector<std::string>& more = {});

/// The configuration as YAML that load_config reads back.
std::string to_yaml(const Config& config);

/// A table of parameters in Markdown, with a heading for each group: a visitor for for_each_field.
class ParameterTable {
 public:
  void operator()(const FieldInfo& info, bool value);
  void operator()(const FieldInfo& info, int value);
  void operator()(const FieldInfo& info, double value);
  void operator()(const FieldInfo& info, const std::string& value);

  const std::string& text() const { return text_; }

 private:
  void add_row(const FieldInfo& info, const std::string& value, const std::string& range);

  std::string group_;
  std::string text_;
};

/// The table of the parameters of Config: name, default, unit, range, meaning.
std::string parameter_table();

}  // namespace frontier_surfels
