#include "replay/report_page.hpp"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels::replay {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPython = "/usr/bin/python3";  // has the distribution's numpy and matplotlib, which other Pythons on PATH may lack
constexpr const char* kScript = "replay_report.py";

/// The script: beside the executable if that is installed, else in the source tree.
fs::path find_script() {
  const fs::path folder = fs::read_symlink("/proc/self/exe").parent_path();
  for (const fs::path& candidate : {folder / kScript, folder / FRONTIER_SURFELS_SCRIPTS_FROM_BINARY / kScript}) {
    if (fs::exists(candidate)) return candidate;
  }
  throw Error(std::string("report.html: the script ") + kScript + " is neither beside this program in '" + folder.string() +
              "' nor in the source tree: install the package again.");
}

/// @return the exit code, or -1 if there is none
int run_python(std::string script, std::string directory) {
  std::string python = kPython;
  std::string no_environment = "-E";  // PYTHONPATH may name another Python's modules
  std::string no_bytecode = "-B";     // the folder of an installed script may be read-only
  char* arguments[] = {python.data(), no_environment.data(), no_bytecode.data(), script.data(), directory.data(), nullptr};
  pid_t pid = 0;
  if (posix_spawn(&pid, kPython, nullptr, nullptr, arguments, environ) != 0) return -1;
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace

void make_report_page(const std::string& directory) {
  const fs::path script = find_script();
  if (access(kPython, X_OK) != 0) {
    throw Error(std::string("report.html needs ") + kPython + ", which is missing; the other files are in '" + directory + "'.");
  }
  if (run_python(script.string(), directory) != 0) {
    throw Error("report.html could not be made; the other files are in '" + directory +
                "'. Try again with: " + script.lexically_normal().string() + " " + directory);
  }
}

}  // namespace frontier_surfels::replay
