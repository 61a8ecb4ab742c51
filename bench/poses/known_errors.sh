#!/usr/bin/env bash
# What stage 3 makes of errors that are known: a rendered drive as it is, through a lens that nobody stated beside the
# same with the true camera, and with poses that drift beside the same with poses as stated.  Prints what was found and
# how well the default maps localize 60 held-out images.
#
#   bench/poses/known_errors.sh [WORK]      about 8 CPU minutes
set -euo pipefail
top=$(cd "$(dirname "$0")/../.." && pwd)
work=${1:-$top/build/bench/poses}
cairn=${CAIRN:-$top/build/release/cairn}
spoil=${SPOIL_SURVEY:-$top/build/release/spoil_survey}
for program in "$cairn" "$spoil"; do
  [ -x "$program" ] || { echo "$program: not built; run 'make bench' first" >&2; exit 3; }
done
rm -rf "$work"
mkdir -p "$work"
cd "$work"

# A focal length of 320 px, and wide enough for the lens.
"$cairn" stage simulate -o exact --survey driven --width-m 8 --depth-m 6 --num-rooms 3 --image-width-px 768 \
  --image-height-px 576 --horizontal-fov-deg 100.388857815 --num-queries 60 --seed 27 --progress none
"$spoil" exact lens lens 320 -0.12 0.03 640 480 1.03 6
mkdir true_camera
cp lens/images.txt lens/queries.txt true_camera/
mv lens/cameras.true.txt true_camera/cameras.txt
ln -s ../lens/images true_camera/images
"$spoil" exact drift drift 1 0.2 27

# row NAME CAPTURE LINES...: compiles the capture with these lines of a recipe.
row() {
  local name=$1
  printf 'name = "%s"\n[capture]\npath = "%s"\n' "$name" "$work/$2" >"$name.toml"
  shift 2
  [ $# -eq 0 ] || printf '%s\n' "$@" >>"$name.toml"
  echo "== $name"
  "$cairn" compile "$name.toml" -o "$name.cairn" --progress none 2>&1 |
    grep -E "^group_classes: (rep|cam|the)|^(localized|median error|90th|after a sim|NEES)"
}
row exact exact
row true_camera true_camera
row lens lens
row drift drift
row drift_as_stated drift '[group_classes]' 'refine_poses = "never"'
row drift_of_cameras drift '[group_classes]' 'refine_camera_offset = false'
