/// Text that is read and written is in the C locale, whatever locale the program that uses the library has.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <locale>
#include <sstream>

#include "config/config_text.hpp"
#include "frontier_surfels/map_file.hpp"
#include "frontier_surfels/mapper.hpp"
#include "frontier_surfels/number_text.hpp"
#include "locale_input.hpp"

namespace frontier_surfels {
namespace {

namespace fs = std::filesystem;

/// Everything that the library says and writes, as one text.
std::string all_texts(const fs::path& folder) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  std::ostringstream said;
  said.imbue(std::locale::classic());
  const auto fault = [&](auto&& call) {
    try {
      call();
      said << "no fault\n";
    } catch (const std::exception& error) {
      said << error.what() << "\n";
    }
  };
  Config config;
  set_field(config, "z_max", "2.5");
  set_field(config, "z_min", "3e-1");
  set_field(config, "recent_views", "1000");
  set_field(config, "map_folder", "1,5");
  set_field(config, "eviction_radius", "1234567.5");
  set_field(config, "carve_no_return", "true");
  said << to_yaml(config) << parameter_table() << fixed_text(1234567.125, 2) << to_text(-0.5) << to_text(12345) << "\n";
  for (const char* value : {"2,5", "1.000.000", "", "x", "1000 m"}) fault([&] { set_field(config, "z_max", value); });
  for (const char* value : {"1.000", "1,000", "2.5"}) fault([&] { set_field(config, "recent_views", value); });
  const std::string yaml = (folder / "config.yaml").string();
  std::ofstream(yaml) << to_yaml(config);
  said << to_yaml(load_config(yaml));
  Config bad = config;
  bad.z_max = 1234.5;
  bad.recent_views = 1234567;
  for (const std::string& problem : bad.problems()) said << problem << "\n";

  std::vector<Surfel> surfels(1234);
  for (std::size_t n = 0; n < surfels.size(); ++n) {
    surfels[n].position = {1234.5F, 0.25F * static_cast<float>(n), -0.125F};
    surfels[n].radius = 0.0125F;
  }
  for (const char* name : {"map.ply", "map.pcd"}) {
    const std::string path = (folder / name).string();
    write_map(path, surfels);
    std::ifstream file(path, std::ios::binary);
    said << file.rdbuf() << read_map(path).size() << "\n";
  }
  const std::string ascii = (folder / "ascii.pcd").string();
  std::ofstream(ascii) << "VERSION .7\nFIELDS x y z normal_x normal_y normal_z radius confidence\nSIZE 4 4 4 4 4 4 4 4\n"
                          "TYPE F F F F F F F F\nCOUNT 1 1 1 1 1 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA ascii\n"
                          "1.5 2 -3.25 0 0 1 0.0125 1\n";
  const std::vector<Surfel> read = read_map(ascii);
  said << read.front().position.transpose() << " " << read.front().radius << "\n";
  surfels.back().radius = -1;
  fault([&] { write_map((folder / "map.ply").string(), surfels); });

  config = Config();
  config.z_max = 2.5;
  config.map_folder = (folder / "blocks").string();
  {
    Mapper mapper(config);
    said << mapper.device() << "\n";
    DepthFrame frame;
    const std::vector<float> depth(100 * 100, 1.0F);
    frame.depth = {100, 100, 400, DepthImage::Encoding::kMetresF32, depth.data(), false};
    frame.intrinsics = {0.02, 0.02, 50, 50, 100, 100};
    frame.T_world_camera.setIdentity();
    fault([&] { mapper.integrate(frame); });
    frame.intrinsics = {1e8, 1e8, 50, 50, 100, 100};
    fault([&] { mapper.integrate(frame); });
  }
  config.z_max = 20;
  config.eviction_radius = 1234.5;
  fault([&] { Mapper mapper(config); });
  config.device_type = "accelerator";
  fault([&] { Mapper mapper(config); });
  return said.str();
}

TEST_F(LocaleTest, OfStreamsChangesNoText) {
  const fs::path folder = folder_ / "texts";
  compare_with_streams([&] { return all_texts(folder); });
}

TEST_F(LocaleTest, OfTheCLibraryChangesNoText) {
  const fs::path folder = folder_ / "texts";
  compare_with_the_c_library([&] { return all_texts(folder); });
}

}  // namespace
}  // namespace frontier_surfels
