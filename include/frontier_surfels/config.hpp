/// Every parameter of the method: the only place with defaults, units, meanings and ranges.
#pragma once

#include <string>
#include <vector>

namespace frontier_surfels {

struct Config {
  // Device
  std::string platform;  // part of its name
  std::string device_type = "any";
  int device_index = 0;
  int threads = 0;
  int lanes = 0;

  // Working image and grid (paper 3.1)
  int decimation = 4;
  double z_min = 0.5;
  double z_max = 3.0;
  int padding_i = 5;
  int padding_j = 5;
  int padding_k = 2;

  // Observed space (paper 3.3)
  bool carve_no_return = false;
  bool carve_beyond_range = false;

  // Known space from the surfels (paper 3.2)
  double th_d = 0.4;
  double peak = 0.5;
  double thickness = 1.7320508;
  int median_votes = 14;

  // Recent views (ours)
  int recent_views = 700;
  double recent_view_distance = 0.005;
  double recent_view_angle = 0.4;

  // Removal, creation and labels (paper 3.4, 3.5)
  bool remove_buried = true;
  double min_gap = 0.005;
  bool refine_surfels = true;
  double surface_depth = 0.03;

  // Maps larger than memory (ours)
  std::string map_folder;
  double eviction_radius = 20;

  /// Every fault, one sentence each; empty when the configuration can be used.
  std::vector<std::string> problems() const;
};

/// What is known of a field beside its value.
struct FieldInfo {
  const char* name;
  const char* unit;     ///< "" where there is none
  const char* meaning;  ///< one sentence
  double lowest = 0;    ///< numbers only; both ends allowed
  double highest = 0;
};

/// Calls visit(FieldInfo, field) for every field of `config` (Config or const Config), in order.
/// YAML files, --set, the parameter table and ROS parameters all go through this list.
template <typename ConfigT, typename Visitor>
void for_each_field(ConfigT& config, Visitor&& visit) {
  visit(FieldInfo{"platform", "", "OpenCL platform: part of its name, any case; empty: the first with a fitting device"}, config.platform);
  visit(FieldInfo{"device_type", "", "any, cpu, gpu or accelerator"}, config.device_type);
  visit(FieldInfo{"device_index", "", "which of the fitting devices", 0, 255}, config.device_index);
  visit(FieldInfo{"threads", "", "compute units to use, where the device can be divided; 0: all", 0, 4096}, config.threads);
  visit(FieldInfo{"lanes", "", "points that one work item handles at once: 16 or 1; 0: 16 on a CPU, 1 elsewhere", 0, 16}, config.lanes);

  visit(FieldInfo{"decimation", "pixel", "every so many pixels of the depth image are used, in both directions", 1, 64}, config.decimation);
  visit(FieldInfo{"z_min", "m", "depth below which the grid is a cuboid; nearer measurements are ignored", 0.01, 100}, config.z_min);
  visit(FieldInfo{"z_max", "m", "depth up to which space is mapped", 0.02, 1000}, config.z_max);
  visit(FieldInfo{"padding_i", "voxel", "grid beyond the image, left and right", 1, 64}, config.padding_i);
  visit(FieldInfo{"padding_j", "voxel", "grid beyond the image, above and below", 1, 64}, config.padding_j);
  visit(FieldInfo{"padding_k", "voxel", "grid behind the camera", 1, 64}, config.padding_k);

  visit(FieldInfo{"carve_no_return", "", "a depth of +Inf observes free space up to z_max"}, config.carve_no_return);
  visit(FieldInfo{"carve_beyond_range", "", "a depth beyond z_max observes free space up to z_max"}, config.carve_beyond_range);

  visit(FieldInfo{"th_d", "", "a surfel counts on a path if the cosine between its normal and the path is larger", 0, 0.99}, config.th_d);
  visit(FieldInfo{"peak", "", "extremes of the sign field smaller than this do not count", 0.01, 10}, config.peak);
  visit(FieldInfo{"thickness", "voxel", "reach of a surfel along its normal in the sign field", 0.5, 4}, config.thickness);
  visit(FieldInfo{"median_votes", "voxel", "known voxels among 27 that make the middle one known", 1, 27}, config.median_votes);

  visit(FieldInfo{"recent_views", "", "views kept for the exact test of new surfels; 0: the paper's method alone", 0, 1024},
        config.recent_views);
  visit(FieldInfo{"recent_view_distance", "m", "a view is kept if the camera is so far from every kept one, or ...", 0, 100},
        config.recent_view_distance);
  visit(FieldInfo{"recent_view_angle", "deg", "... turned so much against it", 0, 180}, config.recent_view_angle);
  visit(FieldInfo{"remove_buried", "", "surfels whose back side the new frame sees are removed as well"}, config.remove_buried);
  visit(FieldInfo{"min_gap", "m", "frontier on a sheet of unknown thinner than this is left out; 0: all is kept", 0, 1}, config.min_gap);
  visit(FieldInfo{"refine_surfels", "", "new surfels stand near the boundary within their voxel, and their normals end in known space"},
        config.refine_surfels);
  visit(
      FieldInfo{"surface_depth", "m", "a surfel so little behind a measured surface is occupied; 0: only where a column ends at it", 0, 1},
      config.surface_depth);

  visit(FieldInfo{"map_folder", "", "folder that keeps the map on disk, and what is far from the camera only there; empty: none"},
        config.map_folder);
  visit(FieldInfo{"eviction_radius", "m", "with a map_folder: blocks of the map further from the camera, along an axis, leave memory", 1,
                  1e6},
        config.eviction_radius);
}

/// Reads a flat YAML map of fields over the defaults. Values out of range are left to problems().
/// @throws FileError  the file cannot be read
/// @throws Error      every unknown, repeated or malformed entry, with file and line
Config load_config(const std::string& path);

/// Sets one field from text, as --set key=value does. @throws Error  no such field (with the nearest name), or not of its type
void set_field(Config& config, const std::string& name, const std::string& value);

/// "; did you mean 'x'?" with the name nearest to `name` among Config's fields and `more`, or where to find all names if none is near.
std::string suggestion(const std::string& name, const std::vector<std::string>& more = {});

/// The configuration as YAML that load_config reads back.
std::string to_yaml(const Config& config);

/// The table of all parameters in Markdown: name, default, unit, range, meaning.
std::string parameter_table();

}  // namespace frontier_surfels
