/// Walks whose maps do not fit into memory, for the tests of mappers with a map folder.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>
#include <unistd.h>

#include <filesystem>
#include <tuple>

#include "frontier_surfels/ply.hpp"
#include "map/map_window.hpp"
#include "map/surfel_packing.hpp"
#include "mapper_input.hpp"
#include "storage/map_folder.hpp"
#include "storage/stored_block.hpp"
#include "temporary_folder.hpp"

namespace frontier_surfels {

/// Small images and ranges. Few recent views, so that seen points decide about known space.
inline Config walking() {
  Config config = undecimated();
  config.z_max = 1.5;
  config.recent_views = 12;
  return config;
}

inline Config walking(const std::string& folder) {
  Config config = walking();
  config.map_folder = folder;
  config.eviction_radius = 4.5;
  return config;
}

/// A view of a wall with steps in it. @param metres  position along the wall
inline replay::RecordedFrame wall_frame(double metres, double height) {
  replay::RecordedFrame frame = plane_frame(plain_camera(40, 30, 36), 0, look_along({0, metres, height}, {1, 0.1 * height, 0}));
  for (int v = 0; v < 30; ++v)
    for (int u = 0; u < 40; ++u) frame.depth.at<float>(v, u) = static_cast<float>(1.1 + (u / 10 % 2) * 0.15 + 0.1 * std::sin(metres));
  return frame;
}

/// A walk of `metres` along the wall, with a frame every 25 cm.
inline Frames walk_there(double metres) {
  Frames frames;
  for (double y = 0; y <= metres; y += 0.25) frames.push_back(wall_frame(y, 0));
  return frames;
}

/// The same walk, and back on another path.
inline Frames walk_there_and_back(double metres) {
  Frames frames = walk_there(metres);
  for (double y = metres; y >= 0; y -= 0.25) frames.push_back(wall_frame(y + 0.06, 0.3));
  return frames;
}

/// Sorts surfels by everything but their ids and clears the ids, so that maps can be compared as sets.
inline std::vector<Surfel> sorted(std::vector<Surfel> surfels) {
  const auto key = [](const Surfel& s) {
    return std::make_tuple(s.position.x(), s.position.y(), s.position.z(), s.normal.x(), s.normal.y(), s.normal.z(), s.radius, s.label,
                           s.rgb);
  };
  std::sort(surfels.begin(), surfels.end(), [&](const Surfel& a, const Surfel& b) { return key(a) < key(b); });
  for (Surfel& surfel : surfels) surfel.id = 0;
  return surfels;
}

/// Gives each test its own folder.
class MapperArchive : public testing::Test {
 protected:
  /// All surfels of a mapper, in memory and on disk, by saving and reading a file.
  std::vector<Surfel> saved(const Mapper& mapper) const {
    const std::string file = (root_ / "saved.ply").string();
    mapper.save(file);
    return sorted(read_ply(file));
  }

  /// All surfels in the folder. No mapper may be using it.
  std::vector<Surfel> stored() const {
    const double block_size = block_size_for(walking().z_max);
    const MapFolder folder(path_, block_size);
    std::vector<Surfel> surfels;
    for (const BlockKey& block : folder.keys()) {
      if (is_view(block)) continue;
      for (const Surfel& surfel : unpack_block(parts_of(folder.read(block)).surfels, block, block_size)) surfels.push_back(surfel);
    }
    return sorted(surfels);
  }

  /// Changes the folder's file, which nobody else may be using.
  void change_file(const std::string& sql) const {
    SQLite::Database((std::filesystem::path(path_) / "map.sqlite").string(), SQLite::OPEN_READWRITE).exec(sql);
  }

  const TemporaryFolder temporary_{"mapper_archive"};
  const std::filesystem::path root_ = temporary_.path();
  std::string path_ = (root_ / "map").string();
};

}  // namespace frontier_surfels
