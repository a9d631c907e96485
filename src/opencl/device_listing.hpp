/// The list of OpenCL devices for people.
#pragma once

#include <string>

namespace frontier_surfels {

/// All devices, the fastest first, with what each lacks, and the one that the default configuration takes; what to install if there is
/// none.
std::string device_listing();

}  // namespace frontier_surfels
