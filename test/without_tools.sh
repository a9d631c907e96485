#!/usr/bin/env bash
# Builds the mapper alone, without ROS and tools, while CMake cannot find what only the tools need. Then checks what the library links.
# Usage: without_tools.sh BUILD [CMAKE OPTION...]
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
build=$1

not_needed=()
for package in CLI11 OpenCV benchmark nlohmann_json octomap; do
  not_needed+=("-DCMAKE_DISABLE_FIND_PACKAGE_$package=TRUE")  # a find_package(... REQUIRED) of it stops CMake
done
cmake -S "$root" -B "$build" -DFRONTIER_SURFELS_ROS=OFF -DFRONTIER_SURFELS_TOOLS=OFF -DCMAKE_INSTALL_PREFIX="$build/.prefix" \
  "${not_needed[@]}" "${@:2}"
cmake --build "$build" --parallel "$(nproc)"

library=$build/lib/libfrontier_surfels.so
echo "The library links: $(readelf -d "$library" | sed -nE 's/.*NEEDED.*\[(.*)\]/\1/p' | paste -sd ' ')"
if ldd "$library" | grep -E 'libopencv|liboctomap|libpcl|libvtk|libros|libtf2|libcv_bridge'; then
  echo "without_tools: $library needs what only the tools, PCL or ROS need" >&2
  exit 1
fi
[ ! -d "$build/bin" ] || {
  echo "without_tools: programs were built: $(ls "$build/bin")" >&2
  exit 1
}
