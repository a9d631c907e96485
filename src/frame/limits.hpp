/// The numbers of the method that kernels are told: those of the configuration, and those that the paper fixes.
#pragma once

#include "common/shared.h"
#include "frontier_surfels/config.hpp"

namespace frontier_surfels {

Limits make_limits(const Config& config);

}  // namespace frontier_surfels
