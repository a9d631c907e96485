/// PoCL keeps compiled kernels in a folder, and fails without a reason, or ends the process, where it cannot write there.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace frontier_surfels {

/// Space that PoCL needs for this library's kernels, twice over [byte].
constexpr std::uintmax_t kKernelCacheBytes = 4 << 20;

/// The folder that PoCL uses, from its environment variables.
std::filesystem::path kernel_cache_folder();

/// What is wrong with such a folder, and what to do, as a sentence; "" if nothing is. Makes the folder if it is missing, as PoCL does.
std::string kernel_cache_fault(const std::filesystem::path& folder, std::uintmax_t needed = kKernelCacheBytes);

}  // namespace frontier_surfels
