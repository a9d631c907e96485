/// All parameters with their defaults, units, meanings and ranges. This is the only place that states them.
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

  /// Every fault, one sentence each; empty if the configuration can be used.
  std::vector<std::string> problems() const;
};

/// Description of a field.
struct FieldInfo {
  const char* name;
  const char* unit;     ///< "" if there is none
  const char* meaning;  ///< one sentence
  double lowest = 0;    ///< smallest allowed value, for numbers only
  double highest = 0;   ///< largest allowed value, for numbers only
};

/// Calls visit(FieldInfo, field) for every field of `config` (Config or const Config), in order.
/// YAML files, --set, the parameter table and ROS parameters all use this list.
template <typename ConfigT, typename Visitor>
void for_each_field(ConfigT& config, Visitor&& visit) {
  visit(FieldInfo{"platform", "", "part of the OpenCL platform's name, in any case; empty: the first platform with a fitting device"},
        config.platform);
  visit(FieldInfo{"device_type", "", "type of the device: any, cpu, gpu or accelerator"}, config.device_type);
  visit(FieldInfo{"device_index", "", "number of the device among the fitting ones, from 0", 0, 255}, config.device_index);
  visit(FieldInfo{"threads", "", "number of compute units to use, if the device can be divided; 0: all", 0, 4096}, config.threads);

  visit(FieldInfo{"decimation", "pixel", "distance between the pixels of the depth image that are used, in both directions", 1, 64},
        config.decimation);
  visit(FieldInfo{"z_min", "m", "depth at which the grid changes from a cuboid to a pyramid; nearer measurements are ignored", 0.01, 100},
        config.z_min);
  visit(FieldInfo{"z_max", "m", "depth up to which space is mapped", 0.02, 1000}, config.z_max);
  visit(FieldInfo{"padding_i", "voxel", "extent of the grid beyond the image, left and right", 1, 64}, config.padding_i);
  visit(FieldInfo{"padding_j", "voxel", "extent of the grid beyond the image, above and below", 1, 64}, config.padding_j);
  visit(FieldInfo{"padding_k", "voxel", "extent of the grid behind the camera", 1, 64}, config.padding_k);

  visit(FieldInfo{"carve_no_return", "", "a depth of +Inf means free space up to z_max"}, config.carve_no_return);
  visit(FieldInfo{"carve_beyond_range", "", "a depth beyond z_max means free space up to z_max"}, config.carve_beyond_range);

  visit(FieldInfo{"th_d", "", "a surfel counts on a path if the cosine between its normal and the path is larger than this", 0, 0.99},
        config.th_d);
  visit(FieldInfo{"peak", "", "extremes of the sign field that are smaller than this are ignored", 0.01, 10}, config.peak);
  visit(FieldInfo{"thickness", "voxel", "reach of a surfel along its normal in the sign field", 0.5, 4}, config.thickness);
  visit(FieldInfo{"median_votes", "voxel", "a voxel is known if at least this many are known among it and its 26 neighbours", 1, 27},
        config.median_votes);

  visit(
      FieldInfo{"recent_views", "", "maximum number of views kept for the exact test of new surfels; 0: the paper's method alone", 0, 1024},
      config.recent_views);
  visit(FieldInfo{"recent_view_distance", "m",
                  "a view is kept if the camera has moved this far from every kept view, or turned by recent_view_angle", 0, 100},
        config.recent_view_distance);
  visit(FieldInfo{"recent_view_angle", "deg",
                  "a view is kept if the camera has turned this much from every kept view, or moved by recent_view_distance", 0, 180},
        config.recent_view_angle);
  visit(FieldInfo{"remove_buried", "", "also remove surfels whose back side the new frame sees"}, config.remove_buried);
  visit(FieldInfo{"min_gap", "m", "no frontier on sheets of unknown space that are thinner than this; 0: all frontier is kept", 0, 1},
        config.min_gap);
  visit(FieldInfo{"refine_surfels", "",
                  "move new surfels towards the boundary within their voxel, and choose normals that point into known space"},
        config.refine_surfels);
  visit(FieldInfo{"surface_depth", "m",
                  "surfels up to this far behind a measured surface are occupied; 0: only surfels in the voxel where observed space ends",
                  0, 1},
        config.surface_depth);

  visit(FieldInfo{"map_folder", "", "folder that keeps the map on disk, while memory holds only blocks near the camera; empty: no folder"},
        config.map_folder);
  visit(
      FieldInfo{"eviction_radius", "m", "with a map_folder: blocks farther than this from the camera along any axis leave memory", 1, 1e6},
      config.eviction_radius);
}

/// Reads a flat YAML map of fields; fields that it lacks keep their defaults. problems() checks the ranges.
/// @throws FileError  the file cannot be read
/// @throws Error      every unknown, repeated or malformed entry, with file and line
Config load_config(const std::string& path);

/// Sets one field from text, as --set key=value does.
/// @throws Error  there is no such field (the message suggests the nearest name), or the text is not of its type
void set_field(Config& config, const std::string& name, const std::string& value);

/// "; did you mean 'x'?" with the name nearest to `name` among Config's fields and `more`. If none is near, says where to find all names.
std::string suggestion(const std::string& name, const std::vector<std::string>& more = {});

/// The configuration as YAML that load_config reads back.
std::string to_yaml(const Config& config);

/// The table of all parameters in Markdown: name, default, unit, range, meaning.
std::string parameter_table();

}  // namespace frontier_surfels
