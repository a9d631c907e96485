/// Arguments that the node does not know.
#include <gtest/gtest.h>

#include "ros/arguments.hpp"

namespace frontier_surfels {
namespace {

void expect(const std::vector<std::string>& arguments, const std::string& part) {
  const std::string fault = fault_of_arguments(arguments);
  EXPECT_NE(fault.find("There is no argument '" + arguments[0] + "': "), std::string::npos) << fault;
  EXPECT_NE(fault.find(part), std::string::npos) << fault;
}

TEST(Arguments, NoneIsRight) { EXPECT_EQ(fault_of_arguments({}), ""); }

TEST(Arguments, TheFirstOneIsNamedWithTheRemedy) {
  expect({"depth/image=foo", "--hlep"}, "write depth/image:=foo.");
  expect({"_z_max=2"}, "write _z_max:=2.");
  for (const char* argument : {"--hlep", "--z_max=2", "depth/image", "=foo", "", "--no-bond"}) expect({argument}, "`mapper_node --help`");
}

}  // namespace
}  // namespace frontier_surfels
