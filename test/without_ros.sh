#!/usr/bin/env bash
# Builds everything without ROS and proves that no ROS is in it. Usage: without_ros.sh BUILD [CMAKE OPTION...]
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
build=$1

cmake -S "$root" -B "$build" -DFRONTIER_SURFELS_ROS=OFF "${@:2}"
cmake --build "$build" --parallel "$(nproc)"

for file in "$build"/lib/*.so "$build"/bin/*; do
  if ldd "$file" | grep -E 'libros|libtf2|libcv_bridge'; then
    echo "without_ros: $file needs ROS" >&2
    exit 1
  fi
done
# What is a bag's is then refused with a sentence, not half done.
touch "$build/empty.bag"
if said=$("$build/bin/replay_score" "$build/empty.bag" --report "$build/report" 2>&1); then
  echo "without_ros: a bag was read without ROS" >&2
  exit 1
fi
grep -q ROS <<<"$said" || {
  echo "without_ros: a bag is refused without saying why: $said" >&2
  exit 1
}
