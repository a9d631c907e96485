/// The method's numbers for the kernels: parameters of the configuration, and constants.
#pragma once

#include "common/shared.h"
#include "frontier_surfels/config.hpp"

namespace frontier_surfels {

Limits make_limits(const Config& config);

}  // namespace frontier_surfels
