/// Does a device compute what kernels/common/arithmetic.cl promises, so that its maps are those of all other devices?
#pragma once

#include <string>
#include <vector>

#include "opencl/commands.hpp"

namespace frontier_surfels {

/// Numbers with which operations go wrong that are contracted or not correctly rounded.
struct ArithmeticInput {
  std::vector<cl_float> a, b, c;
};

/// 256 triples, the same ones on every machine.
ArithmeticInput arithmetic_input();

/// What must come out, correctly rounded: for one operation after the other, the results of all triples.
std::vector<cl_float> right_results(const ArithmeticInput& input);

/// The names of the operations that have given other bits, in the order of the kernel's; -0 counts as 0.
std::vector<std::string> wrong_operations(const std::vector<cl_float>& right, const std::vector<cl_float>& results);

/// Computes on the device. @return "", or a sentence that its maps are not those of other devices, and why. Takes the time of one launch.
std::string arithmetic_fault(Commands& commands);

/// The sentence about a device that does these operations in its own way; "" if there are none.
std::string arithmetic_sentence(const std::string& device, const std::vector<std::string>& operations);

}  // namespace frontier_surfels
