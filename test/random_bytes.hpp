/// Damages files and messages at random, the same way every time, for tests of everything that reads them.
#pragma once

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <new>
#include <random>
#include <string>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Number of inputs of a test: the environment variable FRONTIER_SURFELS_RANDOM_INPUTS, or `usual`.
inline int random_inputs(int usual) {
  const char* wanted = std::getenv("FRONTIER_SURFELS_RANDOM_INPUTS");
  return wanted != nullptr ? std::atoi(wanted) : usual;
}

/// What a random number generator of this seed damages in a text or a binary file.
class Damage {
 public:
  explicit Damage(std::uint32_t seed) : random_(seed) {}

  /// @return `bytes` with one to four faults
  std::string operator()(std::string bytes) {
    for (std::size_t faults = 1 + below(4); faults > 0; --faults) add_fault(bytes);
    return bytes;
  }

  std::size_t below(std::size_t end) { return std::uniform_int_distribution<std::size_t>(0, end - 1)(random_); }

 private:
  void add_fault(std::string& bytes) {
    static const char* const kWords[] = {"nan", "inf", "-1", "0", "1e999", "1e-320", "4294967296", "99999999999999999999",
                                         "#",   " ",   "\n", "x"};
    static const std::uint32_t kNumbers[] = {0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x10000000, 0x7FC00000, 0x7F800000};
    const std::size_t at = below(bytes.size() + 1), left = bytes.size() - at;
    switch (below(8)) {
      case 0:
        if (left > 0) bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
        break;
      case 1:
        if (left > 0) bytes[at] = static_cast<char>(below(256));
        break;
      case 2:
        bytes.insert(at, 1 + below(8), static_cast<char>(below(256)));
        break;
      case 3:
        bytes.erase(at, 1 + below(16));
        break;
      case 4:
        if (below(4) == 0) bytes.resize(at);
        break;
      case 5:
        bytes.insert(at, bytes.substr(below(bytes.size() + 1), 1 + below(64)));
        break;
      case 6:
        bytes.replace(at, std::min(left, below(6)), kWords[below(std::size(kWords))]);
        break;
      default:
        bytes.replace(at, std::min<std::size_t>(left, 4), reinterpret_cast<const char*>(&kNumbers[below(std::size(kNumbers))]), 4);
    }
  }

  std::mt19937 random_;
};

inline volatile sig_atomic_t current_input = 0;

/// Prints the number of the input at which the program crashes or hangs, and lets it die.
inline void name_input(int signal_number) {
  char text[80];
  const int length = std::snprintf(text, sizeof(text), "Signal %d at random input %d\n", signal_number, static_cast<int>(current_input));
  if (write(STDERR_FILENO, text, static_cast<std::size_t>(length)) < 0) _exit(2);
  signal(signal_number, SIG_DFL);
  raise(signal_number);
}

/// Sends SIGPROF after so much CPU time of this program [s]; 0: never. Wall time would depend on what else the machine does.
inline void limit_cpu_time(int seconds) {
  const itimerval limit = {{0, 0}, {seconds, 0}};
  setitimer(ITIMER_PROF, &limit, nullptr);
}

/// Calls read(damage, index) for each input: it must succeed or throw an Error with a sentence. A crash ends the test, and so does an input
/// that takes a minute of CPU time.
template <typename Read>
void expect_sentences(int inputs, Read read) {
  for (const int number : {SIGSEGV, SIGABRT, SIGFPE, SIGBUS, SIGPROF}) signal(number, name_input);
  int refused = 0;
  for (int index = 0; index < inputs; ++index) {
    current_input = index;
    limit_cpu_time(60);
    Damage damage(static_cast<std::uint32_t>(index));
    try {
      read(damage);
    } catch (const Error& error) {
      ++refused;
      ASSERT_GT(std::string(error.what()).size(), 10u) << "input " << index;
    } catch (const std::exception& error) {
      FAIL() << "input " << index << " throws '" << error.what() << "', which is no Error";
    }
  }
  limit_cpu_time(0);
  EXPECT_GT(refused, inputs / 100) << "the inputs are hardly damaged";
  EXPECT_LT(refused, inputs) << "no input could be read";
  std::printf("%d of %d inputs refused\n", refused, inputs);
}

/// Lets the program have 64 MB more than now, or lifts the limit. Damaged sizes then end in std::bad_alloc, as they do where memory is
/// short.
inline void limit_memory([[maybe_unused]] bool limited) {
#ifndef __SANITIZE_ADDRESS__                  // AddressSanitizer ends the program where others get std::bad_alloc
  constexpr rlim_t kMore = rlim_t{64} << 20;  // [byte]
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  rlimit limit;
  getrlimit(RLIMIT_AS, &limit);
  limit.rlim_cur = limited ? std::min(pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + kMore, limit.rlim_max) : limit.rlim_max;
  setrlimit(RLIMIT_AS, &limit);
#endif
}

inline std::string read_bytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

inline void write_bytes(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary | std::ios::trunc).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace frontier_surfels
