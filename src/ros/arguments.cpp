#include "ros/arguments.hpp"

#include <ros/init.h>

#include <algorithm>
#include <iostream>

namespace frontier_surfels {

std::string fault_of_arguments(const std::vector<std::string>& arguments, const std::string& program) {
  if (arguments.empty()) return {};
  const std::string& first = arguments.front();
  const std::size_t sign = first.find('=');
  const std::string what = "There is no argument '" + first + "'";
  if (sign != std::string::npos && sign > 0 && first[0] != '-')
    return what + ": topics are remapped and parameters set with := instead of =, so write " + first.substr(0, sign) + ":" +
           first.substr(sign) + ".";
  return what + ": topics are remapped with TOPIC:=OTHER_TOPIC, and parameters set with _PARAMETER:=VALUE; `" + program +
         " --help` lists them.";
}

std::optional<int> answer_arguments(int argc, char** argv, const std::string& program, const std::function<std::string()>& help) {
  const auto is_help = [](const std::string& argument) { return argument == "--help" || argument == "-h"; };
  if (std::any_of(argv + 1, argv + argc, is_help)) {
    std::cout << help();
    return 0;
  }
  std::vector<std::string> arguments;
  ros::removeROSArgs(argc, argv, arguments);
  arguments.erase(arguments.begin());
  const std::string fault = fault_of_arguments(arguments, program);
  if (fault.empty()) return std::nullopt;
  std::cerr << fault << std::endl;
  return 2;
}

}  // namespace frontier_surfels
