#include "ros/arguments.hpp"

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

}  // namespace frontier_surfels
