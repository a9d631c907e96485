#!/usr/bin/env bash
# Installs a build and uses what was installed from another folder: the programs, and the library in the project of another package.
# Usage: install_space.sh BUILD
#   BUILD  a build folder; what is in its CMAKE_INSTALL_PREFIX is deleted
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
build=$(cd "$1" && pwd)

fail() {
  echo "install_space: $*" >&2
  exit 1
}
cached() { sed -n "s/^$1:[A-Z]*=//p" "$build/CMakeCache.txt"; }

prefix=$(cached CMAKE_INSTALL_PREFIX)
tools=$(cached FRONTIER_SURFELS_TOOLS)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

rm -rf "$prefix" "$prefix.moved"  # an earlier run may have been stopped
cmake --install "$build" >install.log
if [ -e "$prefix/.catkin" ]; then
  programs=$prefix/lib/frontier_surfels
  if cmake --install "$build" --prefix "$folder/other" >other.log 2>&1; then fail "another prefix than the configured one was not refused"; fi
  grep -q "the prefix must be known when configuring" other.log || fail "another prefix was refused without a sentence: $(cat other.log)"
  [ ! -e other ] || fail "a refused installation left files behind"
else
  programs=$prefix/bin
  mv "$prefix" "$prefix.moved"  # the programs must work wherever the prefix is
  trap 'rm -rf "$folder" "$prefix.moved"' EXIT
  prefix=$prefix.moved
  programs=$prefix/bin
fi
for file in share/frontier_surfels/config/mapper.yaml share/frontier_surfels/config/paper.yaml include/frontier_surfels/mapper.hpp; do
  [ -f "$prefix/$file" ] || fail "$file is not installed"
done

if [ "$tools" = ON ]; then
  "$programs/make_synthetic" room --frames 4
  "$programs/replay_score" room --config "$prefix/share/frontier_surfels/config/paper.yaml" --report report --octomap-resolution 0.05
  /usr/bin/python3 - <<'PYTHON'
import json
summary = json.load(open("report/summary.json"))
assert summary["input"]["frames"] == 4, summary["input"]
assert summary["surfels"]["total"] > 1000, summary["surfels"]
assert open("report/report.html").read().rstrip().endswith("</html>")
PYTHON
fi

configure_consumer() { cmake -S "$here/consumer" -B "$1" -DCMAKE_PREFIX_PATH="$2" -DCMAKE_BUILD_TYPE=Release "${@:3}" >"$1.log" 2>&1; }
program() { find "$1" -type f -name "$2" -perm -u=x -print -quit; }

# consumer NAME PREFIX_PATH [OPTION...]: builds and runs the programs in test/consumer, in the folder NAME
consumer() {
  configure_consumer "$@" && cmake --build "$1" >>"$1.log" 2>&1 ||
    fail "a project that uses the library does not build: $(tail -20 "$1.log")"
  [ -n "$(ldd "$(program "$1" consumer)" | grep -F "$2")" ] || fail "the project was linked with another library than that of $2"
  "$(program "$1" consumer)" "$1" || fail "a project that uses the library does not run right ($1)"
  for component in scoring pcl; do
    component_program=$(program "$1" consumer_$component)
    [ -z "$component_program" ] || "$component_program" "$1.pcd" || fail "a project that uses the component $component fails ($1)"
  done
  "$(program "$1" example)" | grep -q "surfels are frontier" || fail "the program in README.md does not run right ($1)"
}
if [ "$tools" = ON ]; then
  consumer plain "$prefix" "-DCOMPONENTS=scoring;pcl"
else
  consumer plain "$prefix" -DCOMPONENTS=pcl
  if configure_consumer refused "$prefix" -DCOMPONENTS=scoring; then fail "the component scoring was found, which was not built"; fi
  tr -s ' \n' ' ' <refused.log | grep -q "no component scoring .* FRONTIER_SURFELS_TOOLS=ON" || fail "no sentence: $(cat refused.log)"
  [ ! -e "$prefix/include/frontier_surfels/scoring" ] || fail "headers of the scoring library are installed without it"
fi
if [ -e "$prefix/.catkin" ] && [ "$tools" = ON ]; then
  consumer catkin "$prefix" -DTHROUGH_CATKIN=ON
  consumer devel "$build/devel"
fi
if [ -e "$prefix/.catkin" ]; then
  (
    set +u  # setup.bash reads unset variables
    # shellcheck source=/dev/null
    . "$prefix/setup.bash"
    set -u
    /usr/bin/python3 - "$prefix" <<'PYTHON'
import glob, os, sys
import rospkg
from roslaunch import rlutil
prefix = sys.argv[1]
folder = rospkg.RosPack().get_path("frontier_surfels")
assert folder == os.path.join(prefix, "share/frontier_surfels"), folder
assert os.path.isfile(os.path.join(folder, "nodelet_plugins.xml")), "the nodelet's description is not installed"
assert os.path.isfile(os.path.join(prefix, "lib/libfrontier_surfels_ros.so")), "the nodelet is not installed"
files = glob.glob(os.path.join(folder, "launch/*.launch"))
assert files, "no launch file is installed"
for name in files:
    fault = rlutil.check_roslaunch(name)
    assert not fault or "requires the 'bag' arg" in fault or "arg 'bag' is not defined" in fault, fault
PYTHON
    rosmsg show frontier_surfels/SurfelUpdate >/dev/null || fail "the messages are not installed"
    ! ldd "$programs/mapper_node" "$prefix/lib/libfrontier_surfels_ros.so" | grep "not found" || fail "the node's libraries are not found"
  )
fi
echo "The install space works."
