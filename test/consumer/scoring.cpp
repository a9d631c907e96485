// Asks the exact test what one frame has seen. Exit code 0 if its answers are right.
#include <frontier_surfels/config.hpp>
#include <frontier_surfels/scoring/exact_test.hpp>

#include "wall.hpp"

int main() {
  frontier_surfels::Config config;
  config.decimation = 1;
  frontier_surfels::scoring::ExactTest test(config);
  test.add(Wall().frame);
  return test.known({0, 0, 1}) && !test.known({0, 0, 1.6}) ? 0 : 1;
}
