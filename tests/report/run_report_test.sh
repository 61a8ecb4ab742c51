#!/usr/bin/env bash
# Compiles a small map with its self-test, and one of images without poses, and opens their reports in headless Chromium:
#   run_report_test.sh CAIRN MAKE_MAP SOURCE_DIR WORK_DIR
set -euo pipefail
cairn=$1 make_map=$2 source=$3 work=$4
for program in chromium chromedriver; do
  command -v "$program" > /dev/null || { echo "$program is not installed: make deps"; exit 1; }
done
mkdir -p "$work"
cd "$work"
cat > tiny.toml <<'RECIPE'
name = "tiny"
[simulate]
width_m = 5.5
depth_m = 6
num_rooms = 2
spacing_m = 0.7
image_width_px = 320
image_height_px = 240
texel_m = 0.008
num_queries = 6
[extract_features]
max_num_features = 300
[filter_visibility]
survey = "driven"
cell_size_m = 0.7
heading_bin_deg = 90
min_num_stations_driven = 2
[decompose_regions]
k = 4
tau = 0
RECIPE
"$cairn" compile tiny.toml -o tiny.cairn --progress none
# A drive of which some images are missing, one has a name that looks like markup, and images of another place with it.
cat > driven.toml <<'OPTIONS'
width_m = 5.5
depth_m = 6
num_rooms = 2
survey = "driven"
step_m = 0.25
image_width_px = 320
image_height_px = 240
horizontal_fov_deg = 75
texel_m = 0.008
num_queries = 0
OPTIONS
rm -rf driven walk
"$cairn" stage simulate driven.toml -o driven --progress none
mkdir -p walk/other
cp driven/images/*.jpg walk/
rm walk/d003[0-9].jpg
mv walk/d0005.jpg 'walk/d0005<img src=x onerror=alert(1)>&".jpg'
for image in $(ls tiny.build/capture/images | head -n 12); do cp "tiny.build/capture/images/$image" walk/other/; done
cat > walk.toml <<'RECIPE'
name = "walk"
[[capture]]
path = "walk"
[extract_features]
max_num_features = 600
contrast_threshold = 0.01
[reconstruct]
mapper = "global"
[filter_visibility]
survey = "driven"
min_num_stations_driven = 2
[decompose_regions]
k = 4
tau = 0
[leave_out]
hold_out = 0
RECIPE
"$cairn" compile walk.toml -o walk.cairn --progress none
# Debian's Python, which has Debian's selenium.
export PYTHONDONTWRITEBYTECODE=1
/usr/bin/python3 "$source/tests/report/report_inputs_test.py" "$cairn" "$work/tiny.cairn"
/usr/bin/python3 "$source/tests/report/report_test.py" "$cairn" "$source/tests/core/map/golden" "$work/tiny.cairn" \
  "$work/screenshots" "$make_map" "$work/walk.cairn"
