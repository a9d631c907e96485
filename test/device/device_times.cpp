/// device_times FRAMES [NAME=VALUE...]: what a frame costs on an OpenCL device, and the map that comes of it.
///
/// FRAMES is a file of raw frames (raw_frames.hpp). The other arguments are parameters of the mapper, such as platform=NVIDIA. With a
/// decimation among them, only that one is measured. Needs no library but the mapper's own, so that it can be carried to any machine.
///
/// device_times --platforms: the OpenCL platforms that have a graphics processor or an accelerator, a line each.
#include <CL/opencl.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <map>
#include <string>
#include <vector>

#include "device/raw_frames.hpp"
#include "frontier_surfels/map_checksum.hpp"
#include "frontier_surfels/mapper.hpp"

namespace frontier_surfels {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kWarmUp = 20;     // frames
constexpr std::size_t kLongRun = 2000;  // frames
constexpr std::size_t kRow = 200;       // frames that a row of the long run stands for
constexpr int kLongRunViews = 50;       // kept: all others are remembered as seen points

double ms_since(Clock::time_point start) { return std::chrono::duration<double, std::milli>(Clock::now() - start).count(); }

/// @param share  .5: the median
double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const std::size_t n = std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(n), values.end());
  return values[n];
}

/// Forth and back, so that the camera does not jump.
std::size_t frame_at(std::size_t n, std::size_t frames) {
  const std::size_t there_and_back = std::max<std::size_t>(1, 2 * (frames - 1));
  return std::min(n % there_and_back, there_and_back - n % there_and_back);
}

/// Times of successive frames of a map.
struct Times {
  std::vector<double> wall_ms, device_ms;
  std::map<std::string, std::vector<double>> stages_ms;

  void add(const Report& report) {
    wall_ms.push_back(report.total_ms);
    if (report.stages.empty()) return;  // Config::stage_times_every
    device_ms.push_back(0);
    for (const StageTime& stage : report.stages) {
      device_ms.back() += stage.ms;
      stages_ms[stage.name].push_back(stage.ms);
    }
  }
};

void print_row(const char* what, const Times& times, const Report& last) {
  std::printf("%-24s median %7.2f ms, p95 %7.2f ms, on the device %7.2f ms; %zu surfels, %.0f MiB on the device\n", what,
              quantile(times.wall_ms, 0.5), quantile(times.wall_ms, 0.95), quantile(times.device_ms, 0.5), last.surfels,
              static_cast<double>(last.device_bytes) / (1 << 20));
  std::fflush(stdout);
}

/// Maps all frames once.
Times map_all(const RawFrames& frames, Mapper& mapper, Report* last) {
  Times times;
  for (std::size_t n = 0; n < frames.frames.size(); ++n) {
    *last = mapper.integrate(frames.view(n));
    if (n >= std::min(kWarmUp, frames.frames.size() / 2)) times.add(*last);
  }
  return times;
}

/// Times of whole frames as the mapper is used; and where it times the stages of few frames, once more with all of them timed.
void measure(const RawFrames& frames, Config config) {
  Mapper mapper(config);
  Report report;
  Times times = map_all(frames, mapper, &report);
  const std::string size = std::to_string(frames.intrinsics.width / config.decimation) + " x " +
                           std::to_string(frames.intrinsics.height / config.decimation) + " pixels";
  print_row(size.c_str(), times, report);
  if (times.device_ms.size() < times.wall_ms.size()) {
    config.stage_times_every = 1;
    Mapper timed(config);
    times = map_all(frames, timed, &report);
    print_row("    each stage timed", times, report);
  }
  std::printf("    checksum of the map          %s\n", checksum_text(map_checksum(mapper.surfels())).c_str());
  for (const auto& [stage, ms] : times.stages_ms) std::printf("    %-28s %7.3f ms\n", stage.c_str(), quantile(ms, 0.5));
}

/// The whole image for as long as it takes to use the memory of seen points.
void measure_long(const RawFrames& frames, Config config) {
  config.decimation = 1;
  config.recent_views = kLongRunViews;
  Mapper mapper(config);
  Times times;
  for (std::size_t n = 0; n < kLongRun; ++n) {
    DepthFrame frame = frames.view(frame_at(n, frames.frames.size()));
    frame.stamp = static_cast<double>(n) / 30;
    const Report report = mapper.integrate(frame);
    times.add(report);
    if ((n + 1) % kRow != 0) continue;
    print_row(("long run, frame " + std::to_string(n + 1)).c_str(), times, report);
    times = {};
  }
}

/// The second mapper finds what the first one has left in caches.
void measure_start(const Config& config) {
  for (const char* which : {"first", "second"}) {
    const auto start = Clock::now();
    const Mapper mapper(config);
    std::printf("start-up, %-6s mapper   %.2f s\n", which, ms_since(start) / 1000);
  }
}

int print_platforms() {
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {  // there is none
  }
  for (const cl::Platform& platform : platforms) {
    cl_uint devices = 0;
    const cl_device_type type = CL_DEVICE_TYPE_GPU | CL_DEVICE_TYPE_ACCELERATOR;
    if (clGetDeviceIDs(platform(), type, 0, nullptr, &devices) == CL_SUCCESS && devices > 0)
      std::printf("%s\n", platform.getInfo<CL_PLATFORM_NAME>().c_str());
  }
  return 0;
}

int run(const std::vector<std::string>& arguments) {
  if (arguments == std::vector<std::string>{"--platforms"}) return print_platforms();
  Config config;
  config.depth_unit = kRawDepthUnit;
  bool one_size = false;
  std::string file;
  for (const std::string& argument : arguments) {
    const std::size_t equals = argument.find('=');
    if (equals == std::string::npos) {
      file = argument;
    } else {
      set_field(config, argument.substr(0, equals), argument.substr(equals + 1));
      one_size |= argument.substr(0, equals) == "decimation";
    }
  }
  if (file.empty()) throw Error("usage: device_times FRAMES [NAME=VALUE...]");
  const RawFrames frames = read_raw_frames(file);
  measure_start(config);
  for (const int decimation : {4, 2, 1}) {
    if (!one_size) config.decimation = decimation;
    measure(frames, config);
    if (one_size) return 0;
  }
  measure_long(frames, config);
  return 0;
}

}  // namespace
}  // namespace frontier_surfels

int main(int argc, char** argv) {
  try {
    return frontier_surfels::run({argv + 1, argv + argc});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "device_times: %s\n", error.what());
    return 1;
  }
}
