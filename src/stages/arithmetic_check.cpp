#include "stages/arithmetic_check.hpp"

#include <cmath>

#include "opencl/test_numbers.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kTriples = 256;

struct Operation {
  const char* name;
  float (*result)(float a, float b, float c);
};

/// In the order of check_arithmetic's results. This library is compiled without contraction, see CMakeLists.txt.
constexpr Operation kOperations[] = {
    {"a * b + c", [](float a, float b, float c) { return a * b + c; }},
    {"dot products", [](float a, float b, float c) { return a * b + b * c + c * a; }},
    {"fma()", [](float a, float b, float c) { return std::fma(a, b, c); }},
    {"division", [](float a, float b, float) { return a / b; }},
    {"reciprocals", [](float, float b, float) { return 1.0F / b; }},
    {"square roots", [](float a, float, float) { return std::sqrt(std::abs(a)); }},
    {"rounding down", [](float a, float, float) { return std::floor(a); }},
    {"rounding up", [](float a, float, float) { return std::ceil(a); }},
};
constexpr std::size_t kCount = sizeof(kOperations) / sizeof(kOperations[0]);

}  // namespace

ArithmeticInput arithmetic_input() {
  TestNumbers numbers;
  ArithmeticInput input;
  for (std::size_t n = 0; n < kTriples; ++n) {
    float a = numbers.any(), b = numbers.any(), c = numbers.any();
    if (n % 4 == 1) c = -(a * b);                                                                       // contraction leaves what is lost
    if (n % 4 == 2) c = std::round(a * b) + 0.5F - a * b;                                               // the border between two voxels
    if (n % 4 == 3) a = static_cast<float>(static_cast<int>(numbers.next() % 512) - 256);               // whole
    if (n % 8 == 7) a = std::nextafter(a, numbers.next() & 1 ? 1000.0F : -1000.0F);                     // nearly
    if (n % 16 == 4) b = std::nextafter(std::ldexp(1.0F, static_cast<int>(numbers.next() % 8)), 0.0F);  // the digits are all ones
    input.a.push_back(a);
    input.b.push_back(b);
    input.c.push_back(c);
  }
  return input;
}

std::vector<cl_float> right_results(const ArithmeticInput& input) {
  std::vector<cl_float> results;
  for (const Operation& operation : kOperations)
    for (std::size_t n = 0; n < input.a.size(); ++n) results.push_back(operation.result(input.a[n], input.b[n], input.c[n]));
  return results;
}

std::vector<std::string> wrong_operations(const std::vector<cl_float>& right, const std::vector<cl_float>& results) {
  const std::size_t each = right.size() / kCount;
  std::vector<std::string> names;
  for (std::size_t operation = 0; operation < kCount; ++operation)
    for (std::size_t n = operation * each; n < (operation + 1) * each; ++n)
      if (!(results[n] == right[n])) {
        names.emplace_back(kOperations[operation].name);
        break;
      }
  return names;
}

std::string arithmetic_sentence(const std::string& device, const std::vector<std::string>& operations) {
  if (operations.empty()) return "";
  std::string list;
  for (const std::string& operation : operations) list += (list.empty() ? "" : ", ") + operation;
  return "The device " + device + " computes in a way of its own (" + list +
         "), so that its maps differ a little from those of other devices, and so do their checksums: choose another device where they "
         "must be the same.";
}

std::string arithmetic_fault(Commands& commands) {
  const ArithmeticInput input = arithmetic_input();
  const std::vector<cl_float> right = right_results(input);
  DeviceArray<cl_float> a(commands), b(commands), c(commands), results(commands);
  a.send(input.a);
  b.send(input.b);
  c.send(input.c);
  results.resize(right.size());
  const std::size_t chunks = commands.chunks(input.a.size());
  commands.run("arithmetic", "check_arithmetic", chunks, 1, a(), b(), c(), static_cast<cl_int>(chunks), results());
  const std::vector<cl_float> found = results.read(right.size());
  commands.forget_times();
  return arithmetic_sentence(commands.device().description, wrong_operations(right, found));
}

}  // namespace frontier_surfels
