/// What the command-line programs share: usage, error messages and exit codes.
#pragma once

#include <CLI/CLI.hpp>
#include <iostream>
#include <limits>
#include <new>
#include <string>
#include <vector>

namespace frontier_surfels::replay {

constexpr int kDone = 0;
constexpr int kFailed = 1;
constexpr int kWrongUsage = 2;

/// Checks that all long options are known, before anything else that may be wrong. The sentence names the nearest known option.
/// @throws CLI::ExtrasError
void check_option_names(const CLI::App& app, const std::vector<std::string>& arguments);

// Checks of an option's text, for CLI::Option::check(). What they say follows the name of the option and a colon.

/// Text that is not empty, as that of a path must be.
CLI::Validator not_empty();

/// A whole number from `least` to `most`.
CLI::Validator whole_number(int least, int most = std::numeric_limits<int>::max());

/// A finite number above 0.
CLI::Validator positive_number();

/// A number from `least` to `most`.
CLI::Validator number(double least, double most);

/// One of these words.
CLI::Validator one_of(const std::vector<std::string>& words);

/// An error whose message is whole sentences, which may be several lines; unlike CLI::ValidationError(name, message), it has no name.
CLI::ValidationError wrong_usage(std::string sentences);

/// What is wrong with a command line, for people.
std::string sentence_of(const CLI::ParseError& error);

/// Runs `read`, which parses the command line, and rethrows what it throws. Prints the help on standard output if it was asked for.
/// @param arguments  of the program, without its name, in any order
template <typename Read>
void read_arguments(const CLI::App& app, const std::vector<std::string>& arguments, Read read) {
  try {
    check_option_names(app, arguments);
    read();
  } catch (const CLI::CallForHelp&) {
    std::cout << app.help();
    throw;
  }
}

/// Parses the command line of a program that has nothing else to check. @throws CLI::Error (also for help, with exit code 0)
inline void parse_arguments(CLI::App& app, int argc, char** argv) {
  read_arguments(app, {argv + 1, argv + argc}, [&] { app.parse(argc, argv); });
}

/// Runs a command. Prints one sentence if it throws.
/// @param if_out_of_memory  what the user is told to do when memory has run out
/// @return the exit code
template <typename Command>
int run_command(const std::string& name, const std::string& if_out_of_memory, Command command) {
  try {
    command();
    return kDone;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return kDone;
    std::cerr << name << ": " << sentence_of(error) << "\nUsage: " << name << " --help lists the arguments.\n";
    return kWrongUsage;
  } catch (const std::bad_alloc&) {
    std::cerr << name << ": out of memory: " << if_out_of_memory << "\n";
  } catch (const std::exception& error) {
    std::cerr << name << ": " << error.what() << "\n";
  }
  return kFailed;
}

}  // namespace frontier_surfels::replay
