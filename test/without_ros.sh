#!/usr/bin/env bash
# Builds everything without ROS and checks that nothing links ROS. Usage: without_ros.sh BUILD [CMAKE OPTION...]
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
# replay_score then refuses a bag, with a sentence that says why.
touch "$build/empty.bag"
if said=$("$build/bin/replay_score" "$build/empty.bag" --report "$build/report" 2>&1); then
  echo "without_ros: a bag was read without ROS" >&2
  exit 1
fi
grep -q ROS <<<"$said" || {
  echo "without_ros: a bag is refused without saying why: $said" >&2
  exit 1
}
