#!/bin/sh
# A robot's own project against an installed tree, as a robot engineer meets it: CMake's package, pkg-config for C and C++,
# and the Python module:  check_robot_project.sh BUILD EXAMPLE POSTER
set -eu
build=$1 example=$2 poster=$3
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export LC_ALL=C

DESTDIR=$folder/root cmake --install "$build" --prefix /opt/cairn > "$folder/log"
root=$folder/root/opt/cairn
lib=$(dirname "$(find "$root" -name 'libcairn-runtime.so.0')")
test -x "$root/bin/cairn" -a -e "$root/share/man/man1/cairn-localize.1" -a -e "$root/share/doc/cairn/licences.md"
"$root/bin/cairn" --version

expect() {  # a program's answer: the poster's query is at (0.4, 0.1, 1.6)
  answer=$("$@" "$poster/poster.cairn" "$poster/poster.pgm")
  echo "$1: $answer"
  echo "$answer" | awk '{exit !($1 - 0.4 < 0.05 && 0.4 - $1 < 0.05 && $3 - 1.6 < 0.05 && 1.6 - $3 < 0.05)}'
}

# Headers alone: what the C++ header needs must be there, without the sources of cairn in reach.
cp -r "$example" "$folder/robot"
cmake -S "$folder/robot" -B "$folder/robot/build" -DCMAKE_PREFIX_PATH="$root" -DCMAKE_BUILD_TYPE=Release >> "$folder/log"
cmake --build "$folder/robot/build" >> "$folder/log" || { cat "$folder/log"; exit 1; }
expect "$folder/robot/build/where_c"
expect "$folder/robot/build/where_cc"

# Python and what CMake builds find the library by themselves; what pkg-config builds, where the system looks.
module=$(find "$root" -type d -name cairn -path '*-packages/cairn')
PYTHONPATH=$(dirname "$module") expect "$folder/robot/where.py"
PYTHONPATH=$(dirname "$module") "$folder/robot/follow.py" "$poster/drive.cairn" "$poster"/[0-4].pgm | grep -q ', track$'
"$folder/robot/build/follow_c" "$poster/drive.cairn" 0.1 "$poster"/[0-4].pgm | grep -q ', track$'
"$(dirname "$0")/check_starts.sh" "$poster" "$folder/robot/build/start_cc" "$folder/robot/build/start_c"
PYTHONPATH=$(dirname "$module") "$(dirname "$0")/check_starts.sh" "$poster" "$folder/robot/start.py"
"$(dirname "$0")/check_steering.sh" "$poster" "$folder/robot/build/steer_cc" "$folder/robot/build/steer_c"
PYTHONPATH=$(dirname "$module") "$(dirname "$0")/check_steering.sh" "$poster" "$folder/robot/steer.py"
"$(dirname "$0")/check_lasers.sh" "$poster" "$folder/robot/build/laser_cc" "$folder/robot/build/laser_c"
PYTHONPATH=$(dirname "$module") "$(dirname "$0")/check_lasers.sh" "$poster" "$folder/robot/laser.py"
export PKG_CONFIG_PATH="$lib/pkgconfig" LD_LIBRARY_PATH="$lib"
cd "$folder/robot"
cc -std=c11 -Wall -Wextra -Werror -pedantic where.c -o where_c $(pkg-config --cflags --libs cairn-runtime)
expect ./where_c
c++ -std=c++20 where.cc -o where_cc $(pkg-config --cflags --libs cairn-runtime)
expect ./where_cc

# Every header that is installed, together, and calls whose types come from several of them; no more than fit on a screen.
# A robot that is lost needs five that no other does: place_belief.h, sure_tracker.h, place_model.h, start_hypotheses.h, and rerank_places.h for a closer look;
# one that has an atlas of many maps: atlas.h, atlas_localizer.h, atlas_route.h, and atlas_file.h with descriptor_code.h;
# what features and cameras are kept in: pooled.h; one that is steered by its camera: image_servo.h, the servo of servo.h with its eyes;
# one that has a laser: scan_locator.h, robot_on_plan.h, and what the second believes: plan_tracker.h, pose_belief.h, image_places.h.
headers=$(cd "$root/include/cairn" && find . -name '*.h' | sed 's,^\./,,' | LC_ALL=C sort -r)
if [ "$(echo "$headers" | wc -l)" -gt 66 ]; then
  echo "more headers are installed than fit on a screen:" $headers >&2
  exit 1
fi
{
  echo "$headers" | sed 's,.*,#include "&",'
  cat << 'END'
int main(int, char** argv) {
  const auto map = cairn::Map::Open(argv[1]);
  if (!map.ok()) return 1;
  const auto name = (*map)->ImageName(0);
  const auto route = cairn::PlanRoute(**map, 0, 0);
  const auto visual = cairn::VisualMap::Load(**map);
  const auto query = cairn::Localizer(*map).QueryFromImage(cv::Mat(), (*map)->head().cameras[0]);
  if (visual.ok() && query.ok()) (void)(*visual)->Match(*query);
  const auto atlas = cairn::Atlas::Open("none.atlas");
  if (atlas.ok()) return 1;
  const auto rolled = cairn::RollBackMap("none.cairn");
  const auto model = cairn::PlaceModel::Make(**map);  // the poster has words, but no appearance graph
  if (model.ok()) return 1;
  const auto plan = (*map)->Plan();  // nor has it a plan
  if (plan.ok()) return 1;
  const auto locator = cairn::ScanLocator::Make(cairn::Views(), {});
  if (locator.ok() || cairn::RobotOnPlan::Make(std::make_shared<const cairn::Views>()).ok()) return 1;
  return !name.ok() || name->empty() || (*map)->num_regions() != 0 || (*map)->num_kept_bytes() <= 0 || route.ok() || rolled.ok();
}
END
} > every_header.cc
c++ -std=c++20 every_header.cc -o every_header $(pkg-config --cflags --libs cairn-runtime)
./every_header "$poster/poster.cairn"
