/// Kept programs: whatever happens to the folder and its files, the kernels are built, and damaged files are replaced.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>

#include "opencl/program_cache.hpp"
#include "opencl/programs.hpp"
#include "stages/test_device.hpp"

namespace frontier_surfels {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSource =
    "kernel void one(global int* out) { out[0] = 1; }\n"
    "kernel void two(global int* out) { out[0] = 2; }\n";

std::string contents(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void overwrite(const fs::path& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

class ProgramCache : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  std::size_t files() const { return static_cast<std::size_t>(std::distance(fs::directory_iterator(cache_), {})); }
  fs::path file() const { return program_file(cache_, identity_); }

  const fs::path folder_ = fs::temp_directory_path() / ("program_cache_" + std::to_string(getpid())), cache_ = folder_ / "a/new/one";
  const std::string identity_ = "device\ndriver\nsource\n";
  const StoredProgram program_{{"one", "two"}, std::string("binary\0\n\xff of the driver", 24)};
};

TEST_F(ProgramCache, FilesComeBack) {
  EXPECT_FALSE(read_program(cache_, identity_));
  ASSERT_TRUE(write_program(cache_, identity_, program_)) << "the folder was missing";
  const auto read = read_program(cache_, identity_);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->kernels, program_.kernels);
  EXPECT_EQ(read->binary, program_.binary);
  EXPECT_FALSE(read_program(cache_, identity_ + "other"));
  EXPECT_EQ(files(), 1u) << "nothing unfinished stays";
}

TEST_F(ProgramCache, EveryDamageIsFound) {
  ASSERT_TRUE(write_program(cache_, identity_, program_));
  const std::string sound = contents(file());
  for (std::size_t n = 0; n < sound.size(); ++n) {
    overwrite(file(), sound.substr(0, n));
    EXPECT_FALSE(read_program(cache_, identity_)) << "cut after " << n;
    for (const int bit : {1, 128}) {
      std::string damaged = sound;
      damaged[n] = static_cast<char>(damaged[n] ^ bit);
      overwrite(file(), damaged);
      EXPECT_FALSE(read_program(cache_, identity_)) << "byte " << n;
    }
  }
  overwrite(file(), sound + "x");
  EXPECT_FALSE(read_program(cache_, identity_));
  ASSERT_TRUE(write_program(cache_, identity_, program_));
  EXPECT_EQ(contents(file()), sound);
  fs::copy_file(file(), program_file(cache_, "another"));
  EXPECT_FALSE(read_program(cache_, "another")) << "a foreign file of that name";
}

TEST_F(ProgramCache, FoldersThatCannotBeWritten) {
  overwrite(folder_ / "file", "no folder");
  for (const fs::path& folder : {folder_ / "file", folder_ / "file/below", fs::path("/proc/none"), fs::path()}) {
    EXPECT_FALSE(write_program(folder, identity_, program_)) << folder;
    EXPECT_FALSE(read_program(folder, identity_)) << folder;
  }
  fs::create_directories(file() / "in the way");
  EXPECT_FALSE(write_program(cache_, identity_, program_)) << "a folder of the file's name";
  EXPECT_FALSE(read_program(cache_, identity_));
  EXPECT_EQ(files(), 1u) << "nothing unfinished stays";
}

/// A full disk, as a limit on the size of files, in a process of its own.
TEST_F(ProgramCache, AFullDisk) {
  ASSERT_TRUE(write_program(cache_, identity_, program_));
  const pid_t child = fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit = {1000, 1000};
    setrlimit(RLIMIT_FSIZE, &limit);
    _exit(write_program(cache_, identity_, {{"one"}, std::string(100000, 'x')}) ? 1 : 0);
  }
  int status = -1;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0) << "it was not refused";
  EXPECT_EQ(files(), 1u);
  EXPECT_TRUE(read_program(cache_, identity_)) << "the old file stays";
}

TEST_F(ProgramCache, TwoAtOnce) {
  const StoredProgram other{{"one"}, std::string(100000, 'x')};
  ASSERT_TRUE(write_program(cache_, identity_, program_));
  const pid_t child = fork();
  if (child == 0) {
    for (int n = 0; n < 300; ++n) write_program(cache_, identity_, n % 2 == 0 ? other : program_);
    _exit(0);
  }
  for (int n = 0; n < 300; ++n) {
    const auto read = read_program(cache_, identity_);
    ASSERT_TRUE(read) << "half a file was seen";
    EXPECT_TRUE(read->binary == program_.binary || read->binary == other.binary);
    write_program(cache_, identity_, n % 2 == 0 ? program_ : other);
  }
  waitpid(child, nullptr, 0);
  EXPECT_EQ(files(), 1u);
}

TEST_F(ProgramCache, TheFolderFollowsTheEnvironment) {
  const auto keep = [](const char* name) { return std::getenv(name) == nullptr ? std::string() : std::string(std::getenv(name)); };
  const std::string xdg = keep("XDG_CACHE_HOME"), home = keep("HOME"), own = keep("FRONTIER_SURFELS_CACHE_DIR");
  setenv("FRONTIER_SURFELS_CACHE_DIR", "/a", 1);
  setenv("XDG_CACHE_HOME", "/b", 1);
  setenv("HOME", "/c", 1);
  EXPECT_EQ(program_cache_folder(), "/a");
  unsetenv("FRONTIER_SURFELS_CACHE_DIR");
  EXPECT_EQ(program_cache_folder(), "/b/frontier_surfels");
  unsetenv("XDG_CACHE_HOME");
  EXPECT_EQ(program_cache_folder(), "/c/.cache/frontier_surfels");
  unsetenv("HOME");
  EXPECT_EQ(program_cache_folder(), "");
  if (!home.empty()) setenv("HOME", home.c_str(), 1);
  if (!xdg.empty()) setenv("XDG_CACHE_HOME", xdg.c_str(), 1);
  if (!own.empty()) setenv("FRONTIER_SURFELS_CACHE_DIR", own.c_str(), 1);
}

/// On the real device, whether or not it uses the cache by itself.
class ProgramCacheOnDevice : public ProgramCache {
 protected:
  const Device device_ = test_device();
  const std::string options_ = "-cl-std=CL1.2";
  const fs::path built_ = program_file(cache_, program_identity(device_.device, kSource, options_));

  /// Builds both kernels and runs them. @return whether they came from the cache
  bool build(const fs::path& cache) {
    const BuiltKernels built = build_kernels(device_, kSource, options_, cache);
    EXPECT_EQ(built.kernels.size(), 2u);
    cl::CommandQueue queue(device_.context, device_.device);
    for (cl::Kernel kernel : built.kernels) {
      const cl::Buffer out(device_.context, CL_MEM_READ_WRITE, sizeof(cl_int));
      kernel.setArg(0, out);
      queue.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(1));
      cl_int value = 0;
      queue.enqueueReadBuffer(out, CL_TRUE, 0, sizeof(value), &value);
      EXPECT_EQ(value, kernel.getInfo<CL_KERNEL_FUNCTION_NAME>() == "one" ? 1 : 2);
    }
    return built.from_cache;
  }
};

TEST_F(ProgramCacheOnDevice, TheSecondBuildIsFromTheFile) {
  EXPECT_FALSE(build(""));
  EXPECT_FALSE(build(cache_));
  if (!fs::exists(built_)) GTEST_SKIP() << "The device gives no binaries.";
  EXPECT_TRUE(build(cache_));
  EXPECT_FALSE(build_kernels(device_, std::string(kSource) + "\n", options_, cache_).from_cache) << "another source";
  EXPECT_FALSE(build_kernels(device_, kSource, options_ + " -DOTHER", cache_).from_cache) << "other options";
}

TEST_F(ProgramCacheOnDevice, DamagedFilesAreReplaced) {
  EXPECT_FALSE(build(cache_));
  if (!fs::exists(built_)) GTEST_SKIP() << "The device gives no binaries.";
  const std::string identity = program_identity(device_.device, kSource, options_), sound = contents(built_);
  const auto stored = read_program(cache_, identity);
  ASSERT_TRUE(stored);
  std::string flipped = sound;
  flipped[flipped.size() / 2] ^= 1;
  for (const std::string& damaged : {std::string(), sound.substr(0, sound.size() / 2), flipped, std::string("foreign")}) {
    overwrite(built_, damaged);
    EXPECT_FALSE(build(cache_));
    EXPECT_TRUE(build(cache_)) << "it was not replaced";
  }
}

/// Sound files whose programs are not: refused by the driver, or with a kernel that is missing.
TEST_F(ProgramCacheOnDevice, BinariesThatTheDriverRefusesAreReplaced) {
  EXPECT_FALSE(build(cache_));
  if (!fs::exists(built_)) GTEST_SKIP() << "The device gives no binaries.";
  const std::string identity = program_identity(device_.device, kSource, options_);
  const auto stored = read_program(cache_, identity);
  ASSERT_TRUE(stored);
  std::vector<StoredProgram> all = {{{"one", "three", "two"}, stored->binary}};
  const bool panics = device_.description.find("rusticl") == 0;
  if (!panics) all.insert(all.end(), {{stored->kernels, "no binary"}, {stored->kernels, ""}});
  for (const StoredProgram& wrong : all) {
    ASSERT_TRUE(write_program(cache_, identity, wrong));
    EXPECT_FALSE(build(cache_));
    EXPECT_TRUE(build(cache_)) << "it was not replaced";
  }
  if (panics) GTEST_SKIP() << "rusticl ends the process at a binary that is not its own; only the file's checks keep such from it.";
}

TEST_F(ProgramCacheOnDevice, FoldersThatCannotBeWrittenAreNoError) {
  overwrite(folder_ / "file", "no folder");
  for (const fs::path& folder : {folder_ / "file/below", fs::path("/proc/none")}) EXPECT_FALSE(build(folder));
  EXPECT_THROW(build_kernels(device_, "kernel void broken(", options_, cache_), DeviceError);
  EXPECT_TRUE(!fs::exists(cache_) || files() == 0u) << "what does not build is not kept";
}

}  // namespace
}  // namespace frontier_surfels
