/// What the command-line programs share: usage, error messages and exit codes.
#pragma once

#include <CLI/CLI.hpp>
#include <iostream>
#include <new>
#include <string>

namespace frontier_surfels::replay {

constexpr int kDone = 0;
constexpr int kFailed = 1;
constexpr int kWrongUsage = 2;

/// Runs `read`, which parses the command line, and rethrows what it throws. Prints the usage before: on standard output if help was asked
/// for, on standard error after a mistake.
template <typename Read>
void read_arguments(const CLI::App& app, Read read) {
  try {
    read();
  } catch (const CLI::CallForHelp&) {
    std::cout << app.help();
    throw;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() != 0) std::cerr << app.help() << "\n";
    throw;
  }
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
    std::cerr << name << ": " << error.what() << "\n";
    return kWrongUsage;
  } catch (const std::bad_alloc&) {
    std::cerr << name << ": out of memory: " << if_out_of_memory << "\n";
  } catch (const std::exception& error) {
    std::cerr << name << ": " << error.what() << "\n";
  }
  return kFailed;
}

}  // namespace frontier_surfels::replay
