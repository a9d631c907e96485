#include "replay/report_page.hpp"

#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <regex>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels::replay {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPython = "/usr/bin/python3";  // has the distribution's numpy and matplotlib, which other Pythons on PATH may lack

fs::path own_folder() { return fs::read_symlink("/proc/self/exe").parent_path(); }

/// The script: beside the executable if that is installed, else in the source tree; empty if it is missing.
fs::path find_script(const std::string& name) {
  for (const fs::path& candidate : {own_folder() / name, own_folder() / FRONTIER_SURFELS_SCRIPTS_FROM_BINARY / name}) {
    if (fs::exists(candidate)) return candidate;
  }
  return {};
}

/// The attributes of a process that gets SIGINT blocked. The script unblocks it when it can end without a traceback.
class SpawnAttributes {
 public:
  SpawnAttributes() {
    posix_spawnattr_init(&attributes_);
    sigset_t interrupt;
    sigemptyset(&interrupt);
    sigaddset(&interrupt, SIGINT);
    posix_spawnattr_setsigmask(&attributes_, &interrupt);
    posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETSIGMASK);
  }
  ~SpawnAttributes() { posix_spawnattr_destroy(&attributes_); }
  SpawnAttributes(const SpawnAttributes&) = delete;
  SpawnAttributes& operator=(const SpawnAttributes&) = delete;
  const posix_spawnattr_t* get() const { return &attributes_; }

 private:
  posix_spawnattr_t attributes_;
};

/// @return the status of waitpid(), or -1 if Python could not be started
int run_python(std::string script, std::string directory) {
  std::string python = kPython;
  std::string no_environment = "-E";  // PYTHONPATH may name another Python's modules
  std::string no_bytecode = "-B";     // the folder of an installed script may be read-only
  char* arguments[] = {python.data(), no_environment.data(), no_bytecode.data(), script.data(), directory.data(), nullptr};
  const SpawnAttributes attributes;
  pid_t pid = 0;
  if (posix_spawn(&pid, kPython, nullptr, attributes.get(), arguments, environ) != 0) return -1;
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

/// A word of a shell command that stands for this text.
std::string quoted(const std::string& text) {
  const bool is_plain =
      text.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789/._-+:@%") == std::string::npos;
  if (is_plain && !text.empty()) return text;
  return "'" + std::regex_replace(text, std::regex("'"), R"('\'')") + "'";
}

}  // namespace

void make_page(const std::string& script, const std::string& page, const std::string& directory, const std::string& kept) {
  const std::string others =
      (kept == directory ? "the earlier report stays, and the other files of the new one are in '" : "the other files are in '") + kept +
      "'";
  const fs::path path = find_script(script);
  if (path.empty())
    throw Error(page + " needs the script " + script + ", which is neither beside this program in '" + own_folder().string() +
                "' nor in the source tree: install the package again; " + others + ".");
  if (access(kPython, X_OK) != 0) throw Error(page + " needs " + kPython + ", which is missing; " + others + ".");
  const int status = run_python(path.string(), directory);
  if (status == 0) return;
  const bool interrupted = WIFSIGNALED(status) && WTERMSIG(status) == SIGINT;
  throw Error(page + " " + std::string(interrupted ? "is not made, because of Ctrl-C" : "could not be made") + "; " + others +
              ". Try again with: " + quoted(path.lexically_normal().string()) + " " + quoted(kept));
}

}  // namespace frontier_surfels::replay
