#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <set>
#include <sstream>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {
namespace {

namespace fs = std::filesystem;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

std::string all_problems(const Config& config) {
  std::string text;
  for (const std::string& problem : config.problems()) text += problem + "\n";
  return text;
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// A YAML file that is removed when the test ends.
class ConfigFile : public testing::Test {
 protected:
  void TearDown() override { fs::remove(path_); }

  /// Message of load_config's error for a file with this text; "" without an error.
  std::string fault(const std::string& text) {
    write(text);
    try {
      loaded_ = load_config(path_);
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  }

  void write(const std::string& text) { std::ofstream(path_) << text; }

  const std::string path_ = fs::temp_directory_path() / ("config_" + std::to_string(getpid()) + ".yaml");
  Config loaded_;
};

std::string read_text(const std::string& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(Config, DefaultsHaveNoProblems) { EXPECT_EQ(all_problems(Config()), ""); }

TEST(Config, EveryFieldHasAUniqueNameAndAMeaning) {
  std::set<std::string> names;
  Config config;
  for_each_field(config, [&](const FieldInfo& info, const auto&) {
    EXPECT_TRUE(names.insert(info.name).second) << info.name;
    EXPECT_NE(std::string(info.meaning), "") << info.name;
  });
}

TEST(Config, EveryNumberIsCheckedAtBothEnds) {
  const Config defaults;
  for_each_field(defaults, [&](const FieldInfo& wanted, const auto& value) {
    using Field = std::decay_t<decltype(value)>;
    if constexpr (std::is_same_v<Field, int> || std::is_same_v<Field, double>) {
      std::vector<double> bad = {wanted.lowest - 1, wanted.highest + 1};
      if (std::is_same_v<Field, double>) {
        bad.insert(bad.end(), {kNan, kInf, -kInf, std::nextafter(wanted.lowest, -kInf), std::nextafter(wanted.highest, kInf)});
      }
      for (const double wrong : bad) {
        Config config;
        for_each_field(config, [&](const FieldInfo& info, auto& field) {
          if constexpr (std::is_same_v<std::decay_t<decltype(field)>, Field>) {
            if (std::string(info.name) == wanted.name) field = static_cast<Field>(wrong);
          }
        });
        EXPECT_TRUE(contains(all_problems(config), wanted.name + std::string(" is "))) << wanted.name << " " << wrong;
      }
    }
  });
}

TEST(Config, ProblemNamesValueRangeAndUnit) {
  Config config;
  config.decimation = 65;
  EXPECT_EQ(all_problems(config), "decimation is 65 pixel: it must be from 1 to 64 pixel.\n");
  config = Config();
  config.z_min = kNan;
  EXPECT_EQ(all_problems(config), "z_min is .nan m: it must be from 0.01 to 100 m.\n");
}

TEST(Config, AllProblemsAtOnce) {
  Config config;
  config.threads = -1;
  config.z_min = 4;
  config.median_votes = 0;
  config.device_type = "GPU";
  const std::vector<std::string> problems = config.problems();
  ASSERT_EQ(problems.size(), 4u) << all_problems(config);
  EXPECT_EQ(problems[0], "threads is -1: it must be from 0 to 4096.");
  EXPECT_EQ(problems[1], "median_votes is 0 voxel: it must be from 1 to 27 voxel.");
  EXPECT_EQ(problems[2], "z_max is 3 m, but z_min is 4 m: z_max must be larger.");
  EXPECT_EQ(problems[3], "device_type is 'GPU': it must be any, cpu, gpu or accelerator.");
}

TEST(Config, LanesAreOneOrSixteen) {
  Config config;
  for (int lanes = 0; lanes <= 16; ++lanes) {
    config.lanes = lanes;
    const bool good = lanes == 0 || lanes == 1 || lanes == 16;
    EXPECT_EQ(all_problems(config), good ? "" : "lanes is " + std::to_string(lanes) + ": it must be 0, 1 or 16.\n");
  }
}

TEST(Config, SamplingIsOneOfTwo) {
  Config config;
  config.sampling = "median";
  EXPECT_EQ(all_problems(config), "sampling is 'median': it must be mean or nearest.\n");
  for (const char* sampling : {"mean", "nearest"}) {
    config.sampling = sampling;
    EXPECT_EQ(all_problems(config), "");
  }
}

TEST(Config, EqualDepthsAreAProblem) {
  Config config;
  config.z_max = config.z_min;
  EXPECT_EQ(config.problems().size(), 1u);
}

TEST(Config, SetFieldTakesEveryType) {
  Config config;
  set_field(config, "z_max", "4.5");
  set_field(config, "decimation", "2");
  set_field(config, "carve_no_return", "true");
  set_field(config, "platform", "Portable Computing: \"x\" # no comment");
  EXPECT_EQ(config.z_max, 4.5);
  EXPECT_EQ(config.decimation, 2);
  EXPECT_TRUE(config.carve_no_return);
  EXPECT_EQ(config.platform, "Portable Computing: \"x\" # no comment");
  set_field(config, "platform", "");
  EXPECT_EQ(config.platform, "");
}

std::string set_fault(const std::string& name, const std::string& value) {
  Config config;
  try {
    set_field(config, name, value);
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

TEST(Config, SetFieldRefusesWithASentence) {
  EXPECT_EQ(set_fault("decimaton", "2"), "there is no parameter 'decimaton'; did you mean 'decimation'?");
  EXPECT_EQ(set_fault("Z_MAX", "2"), "there is no parameter 'Z_MAX'; doc/parameters.md lists all parameters.");
  EXPECT_EQ(set_fault("", "2"), "there is no parameter ''; doc/parameters.md lists all parameters.");
  EXPECT_EQ(set_fault("decimation", "4.5"), "decimation is '4.5': it must be a whole number [pixel].");
  EXPECT_EQ(set_fault("th_d", "0.4x"), "th_d is '0.4x': it must be a number.");
  EXPECT_EQ(set_fault("th_d", ""), "th_d is '': it must be a number.");
  EXPECT_EQ(set_fault("carve_no_return", "2"), "carve_no_return is '2': it must be true or false.");
  EXPECT_EQ(set_fault("decimation", "99999999999"), "decimation is '99999999999': it must be a whole number [pixel].");
}

TEST_F(ConfigFile, ReadsOverTheDefaults) {
  EXPECT_EQ(fault("z_max: 5\n# comment\nplatform: pocl\ncarve_no_return: true\n"), "");
  EXPECT_EQ(loaded_.z_max, 5);
  EXPECT_EQ(loaded_.platform, "pocl");
  EXPECT_TRUE(loaded_.carve_no_return);
  EXPECT_EQ(loaded_.z_min, Config().z_min);
  EXPECT_EQ(fault("\xEF\xBB\xBFz_max: 4\n"), "") << "a byte order mark is no text";
  EXPECT_EQ(loaded_.z_max, 4);
}

TEST_F(ConfigFile, EmptyMeansDefaults) {
  for (const char* text : {"", "# only a comment\n", "{}\n", "---\n"}) {
    EXPECT_EQ(fault(text), "") << text;
    EXPECT_EQ(to_yaml(loaded_), to_yaml(Config())) << text;
  }
}

TEST_F(ConfigFile, EveryFaultWithItsLine) {
  EXPECT_EQ(fault("z_mx: 5\nz_min: [1, 2]\n\nthreads: many\nz_max: 4\nz_max: 5\nplatform:\n"),
            path_ + ":1: there is no parameter 'z_mx'; did you mean 'z_max'?\n" +  //
                path_ + ":2: z_min is a list or a map: it must be a number [m].\n" + path_ +
                ":4: threads is 'many': it must be a whole number.\n" +  //
                path_ + ":6: z_max is given twice: keep one.\n" + path_ + ":7: platform is empty: it must be text.");
}

TEST_F(ConfigFile, RefusesFilesThatAreNotOneMap) {
  EXPECT_EQ(fault("- z_max: 5\n"), path_ + ":1: this must be a map of parameters, one 'name: value' a line.");
  EXPECT_TRUE(contains(fault("z_max: 5\n  z_min: {\n"), path_ + ":2: this is not YAML: ")) << fault("z_max: 5\n  z_min: {\n");
  EXPECT_EQ(fault("z_max: 5\n---\nz_max: 6\n"), path_ + " holds several YAML documents: keep one.");
  EXPECT_TRUE(contains(fault("? [a, b]\n: 1\n"), "there is no parameter ''"));
  EXPECT_NE(fault(std::string("z_max: 5\0\x01\xff", 12)), "");
}

TEST_F(ConfigFile, UnreadableFilesAreFileErrors) {
  EXPECT_THROW(load_config(path_ + ".missing"), FileError);
  EXPECT_THROW(load_config(fs::temp_directory_path().string()), FileError);
  try {
    load_config(path_ + ".missing");
  } catch (const FileError& e) {
    EXPECT_EQ(std::string(e.what()), "The configuration " + path_ + ".missing cannot be read: No such file or directory.");
  }
}

TEST_F(ConfigFile, RoundTripIsExact) {
  Config config;
  config.platform = "null: \"quoted\" \\ # ~";
  config.device_type = "true";
  config.z_min = 0.1 + 0.2;
  config.z_max = 1.0 / 3.0 + 5;
  config.th_d = 0.17364817766693033;
  config.peak = std::numeric_limits<double>::max();
  config.thickness = -kInf;
  config.recent_view_distance = 5e-324;
  config.carve_beyond_range = true;
  config.threads = std::numeric_limits<int>::min();
  EXPECT_EQ(fault(to_yaml(config)), "");
  EXPECT_EQ(to_yaml(loaded_), to_yaml(config));
  EXPECT_EQ(loaded_.platform, config.platform);
  EXPECT_EQ(loaded_.device_type, config.device_type);
  EXPECT_EQ(loaded_.z_min, config.z_min);
  EXPECT_EQ(loaded_.z_max, config.z_max);
  EXPECT_EQ(loaded_.th_d, config.th_d);
  EXPECT_EQ(loaded_.peak, config.peak);
  EXPECT_EQ(loaded_.thickness, config.thickness);
  EXPECT_EQ(loaded_.recent_view_distance, config.recent_view_distance);
  EXPECT_EQ(loaded_.threads, config.threads);
  EXPECT_TRUE(loaded_.carve_beyond_range);
  config.z_max = kNan;
  ASSERT_EQ(fault(to_yaml(config)), "");
  EXPECT_TRUE(std::isnan(loaded_.z_max));
}

TEST(Config, NumbersAreWrittenShortly) { EXPECT_TRUE(contains(to_yaml(Config()), "\nz_max: 3\n")) << to_yaml(Config()); }

TEST(ShippedFiles, MapperYamlIsTheDefaults) {
  EXPECT_EQ(to_yaml(load_config(FRONTIER_SURFELS_SOURCE_DIR "/config/mapper.yaml")), to_yaml(Config()));
}

TEST(ShippedFiles, EveryConfigurationCanBeUsed) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(FRONTIER_SURFELS_SOURCE_DIR "/config")) {
    names.insert(entry.path().stem().string());
    EXPECT_EQ(all_problems(load_config(entry.path().string())), "") << entry.path();
  }
  EXPECT_EQ(names, (std::set<std::string>{"explore", "kinect_v1", "mapper", "paper", "realsense_d400", "time_of_flight"}));
}

/// Standard deviations at 2 m: of half a step of a Kinect's disparity, of 0.08 pixel of a stereo camera, of time of flight.
TEST(ShippedFiles, SensorModelsAreThoseOfTheirSources) {
  const auto deviation = [](const char* name) {
    const Config config = load_config(FRONTIER_SURFELS_SOURCE_DIR "/config/" + std::string(name) + ".yaml");
    return config.noise + 4 * config.noise_growth;
  };
  EXPECT_NEAR(deviation("kinect_v1"), 0.5 * 4 * 2.85e-3, 1e-9);
  EXPECT_NEAR(deviation("realsense_d400"), 0.08 * 4 / (424 * 0.05), 2e-4);
  EXPECT_NEAR(deviation("time_of_flight"), 1e-3 * (1.5 + 0.3 * 4), 1e-9);
}

TEST(ShippedFiles, PaperYamlIsTable1) {
  const Config paper = load_config(FRONTIER_SURFELS_SOURCE_DIR "/config/paper.yaml");
  EXPECT_EQ(all_problems(paper), "");
  EXPECT_EQ(paper.recent_views, 0);
  EXPECT_FALSE(paper.remove_buried);
  EXPECT_EQ(paper.min_gap, 0);
  EXPECT_FALSE(paper.refine_surfels);
  EXPECT_EQ(paper.surface_depth, 0);
  EXPECT_DOUBLE_EQ(paper.th_d, std::cos(80 * std::acos(-1) / 180));
  EXPECT_DOUBLE_EQ(paper.thickness, std::sqrt(3));
  EXPECT_EQ(paper.median_votes, 14);
  EXPECT_EQ(paper.sampling, "nearest");
}

TEST(ShippedFiles, ParametersMdHasTheTables) {
  EXPECT_TRUE(contains(read_text(FRONTIER_SURFELS_SOURCE_DIR "/doc/parameters.md"), parameter_table()))
      << "doc/parameters.md is out of date. Renew it with: replay_score --parameters > doc/parameters.md";
}

TEST(ParameterTable, HasAHeadingForEachGroup) {
  ParameterTable table;
  FieldInfo first{"first", "m", "one length", 0.5, 2}, second{"second", "", "whether there is one"};
  first.group = second.group = "Some";
  FieldInfo third{"third", "", "a name"};
  third.group = "Others";
  table(first, 1.0);
  table(second, false);
  table(third, std::string());
  const std::string head = "| parameter | default | unit | range | meaning |\n|---|---|---|---|---|\n";
  EXPECT_EQ(table.text(), "\n## Some\n\n" + head + "| `first` | 1 | m | 0.5 to 2 | one length |\n" +
                              "| `second` | false |  |  | whether there is one |\n" + "\n## Others\n\n" + head +
                              "| `third` | \"\" |  |  | a name |\n");
}

}  // namespace
}  // namespace frontier_surfels
