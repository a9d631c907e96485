#include "bench/child_process.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

extern char** environ;

namespace frontier_surfels::bench {
namespace {

std::vector<std::string> command_line(const std::string& what, const Options& options, const Input& input) {
  std::vector<std::string> words = {"bench", "--child", what, "--frames", std::to_string(options.frames)};
  words.insert(words.end(), {"--row-seconds", std::to_string(options.row_seconds)});
  if (!options.config_file.empty()) words.insert(words.end(), {"--config", options.config_file});
  if (options.quick) words.push_back("--quick");
  if (!input.path().empty()) words.insert(words.end(), {"--", input.path()});
  return words;
}

std::vector<std::string> environment(const std::string& kernel_cache) {
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const bool replaced = !kernel_cache.empty() && std::strncmp(*variable, "POCL_CACHE_DIR=", 15) == 0;
    if (!replaced) variables.push_back(*variable);
  }
  if (!kernel_cache.empty()) variables.push_back("POCL_CACHE_DIR=" + kernel_cache);
  return variables;
}

/// The words as posix_spawn takes them. The pointers are valid as long as `words`.
std::vector<char*> pointers(std::vector<std::string>& words) {
  std::vector<char*> result;
  for (std::string& word : words) result.push_back(word.data());
  result.push_back(nullptr);
  return result;
}

/// Starts this very program.
/// @param output  gets the file descriptor from which its standard output can be read
/// @return the process
pid_t start(std::vector<std::string> words, std::vector<std::string> variables, int& output) {
  int pipe_ends[2];
  if (pipe2(pipe_ends, O_CLOEXEC) != 0) throw Error(std::string("No pipe could be opened: ") + std::strerror(errno) + ".");
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, pipe_ends[1], STDOUT_FILENO);
  pid_t process = 0;
  const int fault = posix_spawn(&process, "/proc/self/exe", &actions, nullptr, pointers(words).data(), pointers(variables).data());
  posix_spawn_file_actions_destroy(&actions);
  close(pipe_ends[1]);
  output = pipe_ends[0];
  if (fault == 0) return process;
  close(output);
  throw Error(std::string("This program could not start itself: ") + std::strerror(fault) + ".");
}

std::string read_all(int file) {
  std::string text;
  std::array<char, 4096> part;
  for (ssize_t n = 0; (n = read(file, part.data(), part.size())) > 0 || (n < 0 && errno == EINTR);)
    if (n > 0) text.append(part.data(), static_cast<std::size_t>(n));
  return text;
}

}  // namespace

nlohmann::ordered_json run_child(const std::string& what, const Options& options, const Input& input, const std::string& kernel_cache) {
  int output = -1;
  const pid_t process = start(command_line(what, options, input), environment(kernel_cache), output);
  const std::string said = read_all(output);
  close(output);
  int status = 0;
  while (waitpid(process, &status, 0) < 0 && errno == EINTR) continue;
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) throw Error("The process that measures '" + what + "' failed; its message is above.");
  return nlohmann::ordered_json::parse(said);
}

}  // namespace frontier_surfels::bench
