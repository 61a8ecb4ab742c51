#!/usr/bin/env bash
# Compiles a capture (by default redkitchen) with cairn and with the installed COLMAP in one run and prints both as tables:
# seconds of every step, keypoints an image, verified pairs and inliers under one test (count_inliers.cc), bytes, registered queries and their
# errors.  Everything is computed anew.  COLMAP gets what cairn gets: known poses and intrinsics of the survey; its
# queries are matched against every survey image and registered one after the other: in the survey as stated, and as
# COLMAP's bundle_adjuster leaves it with the camera refined (as stated, with one and with four coefficients of distortion),
# aligned again to the stated camera centres.
#
#   bench/redkitchen/compare_colmap.sh [CAPTURE] [WORK]      about 25 minutes on 2 cores, most of them COLMAP's matching
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
capture=$(realpath "${1:-$top/../shared/data/redkitchen}")
work=${2:-$top/build/bench/redkitchen}
cairn=${CAIRN:-$top/build/release/cairn}
[ -f "$capture/images.txt" ] || { echo "$capture: no images.txt; the redkitchen capture is not part of this repository" >&2; exit 3; }
count_inliers=${COUNT_INLIERS:-$top/build/release/count_inliers}
[ -x "$cairn" ] || { echo "$cairn: not built; run 'make' first" >&2; exit 3; }
if [ ! -x "$count_inliers" ]; then
  cmake -S "$top" -B "$top/build/release" -DCAIRN_BUILD_BENCHMARKS=ON >/dev/null
  cmake --build "$top/build/release" --target count_inliers >/dev/null
fi
export QT_QPA_PLATFORM=offscreen
rm -rf "$work"
mkdir -p "$work"/{known,triangulated}
log=$work/colmap.log

# seconds NAME COMMAND...: runs it, remembers its wall-clock seconds in $work/NAME.s
seconds() {
  local name=$1 start end
  shift
  start=$(date +%s.%N)
  "$@" >>"$log" 2>&1 || { echo "$name failed; the end of $log:" >&2; tail -n 20 "$log" >&2; exit 1; }
  end=$(date +%s.%N)
  echo "$end $start" | awk '{printf "%.1f\n", $1 - $2}' >"$work/$name.s"
}
of() { cat "$work/$1.s"; }
names() { awk '!/^#/ && NF >= 10 {print $10}' "$1"; }

echo "== cairn: $("$cairn" --version)"
# Step by step for the seconds of each, by default, but all pairs, as COLMAP matches them; then the whole line once more, for
# its sum, with the pairs that it chooses; and its map with the landmarks of all classes, as COLMAP's model has all points.
options=$work/cairn.build/options
recipe=$work/recipe.toml
printf 'name = "compared"\n[capture]\npath = "%s"\n' "$capture" >"$recipe"
"$cairn" stage configure "$recipe" -o "$work/cairn.cairn" --build-dir "$work/cairn.build" >>"$log" 2>&1
seconds cairn_extract "$cairn" stage extract-features "$capture" --options "$options/extract_features.toml" \
  -o "$work/features.db" --progress none
seconds cairn_match "$cairn" stage match-features "$work/features.db" --capture "$capture" \
  --options "$options/match_features.toml" --pairs exhaustive -o "$work/matches.db" --progress none
seconds cairn_group "$cairn" stage group-classes "$work/matches.db" --capture "$capture" \
  --options "$options/group_classes.toml" -o "$work/classes.db" --progress none
seconds cairn_compile "$cairn" compile "$recipe" -o "$work/cairn.cairn" --build-dir "$work/cairn.build" --progress none
"$cairn" check "$work/cairn.cairn" --queries "$capture/queries.txt" --progress none | tee "$work/cairn.txt"
echo "== cairn, all classes"
{ cat "$recipe"; printf '[emit_map]\nlandmarks = "all"\n'; } >"$work/all.toml"
"$cairn" compile "$work/all.toml" -o "$work/all.cairn" --build-dir "$work/cairn.build" --progress none >>"$log" 2>&1
"$cairn" check "$work/all.cairn" --queries "$capture/queries.txt" --progress none | tee "$work/all.txt"

echo "== $(colmap help | head -n 1)"
camera=$(awk '!/^#/ && NF {print; exit}' "$capture/cameras.txt")
model=$(echo "$camera" | awk '{print $2}')
params=$(echo "$camera" | cut -d' ' -f5- | tr ' ' ',')
names "$capture/images.txt" >"$work/survey.list"
names "$capture/queries.txt" >"$work/queries.list"
database=$work/colmap.db
extract() {
  colmap feature_extractor --database_path "$database" --image_path "$capture/images" --image_list_path "$1" \
    --ImageReader.single_camera 1 --ImageReader.camera_model "$model" --ImageReader.camera_params "$params" \
    --SiftExtraction.use_gpu 0
}
seconds colmap_extract extract "$work/survey.list"
seconds colmap_match colmap exhaustive_matcher --database_path "$database" --SiftMatching.use_gpu 0
sqlite3 "$database" ".backup $work/survey.db"  # before the queries join it
database_bytes=$(stat -c %s "$database")
echo "$camera" >"$work/known/cameras.txt"
: >"$work/known/points3D.txt"
sqlite3 -separator ' ' "$database" 'SELECT name, image_id FROM images' |
  awk 'NR == FNR {id[$1] = $2; next} !/^#/ && NF >= 10 && ($10 in id) {$1 = id[$10]; $9 = 1; print; print ""}' - \
    "$capture/images.txt" >"$work/known/images.txt"
seconds colmap_triangulate colmap point_triangulator --database_path "$database" --image_path "$capture/images" \
  --input_path "$work/known" --output_path "$work/triangulated"
model_bytes=$(du -sb "$work/triangulated" | cut -f1)
# Queries: the same camera, matched with every survey image, then registered.
seconds colmap_query_extract colmap feature_extractor --database_path "$database" --image_path "$capture/images" \
  --image_list_path "$work/queries.list" --ImageReader.existing_camera_id 1 --SiftExtraction.use_gpu 0
while read -r query; do sed "s|^|$query |" "$work/survey.list"; done <"$work/queries.list" >"$work/pairs.list"
seconds colmap_query_match colmap matches_importer --database_path "$database" --match_list_path "$work/pairs.list" \
  --match_type pairs --SiftMatching.use_gpu 0
# register MODEL: registers the queries in $work/MODEL and prints their errors.
register() {
  mkdir -p "$work/$1.registered" "$work/$1.text"
  colmap image_registrator --database_path "$database" --input_path "$work/$1" --output_path "$work/$1.registered"
  colmap model_converter --input_path "$work/$1.registered" --output_path "$work/$1.text" --output_type TXT
}
print_errors() {
  echo "COLMAP, $2: $(awk '!/^#/ && NF {$1 = $3 = $4 = ""; print; exit}' "$work/$1.text/cameras.txt")"
  python3 "$here/pose_errors.py" "$capture/queries.txt" "$work/$1.text/images.txt"
}
seconds colmap_register register triangulated
print_errors triangulated "survey as stated" | tee "$work/colmap.txt"
# The stated camera centres: where R c + t = 0.
PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=$here python3 - "$capture/images.txt" >"$work/centres.txt" <<'EOF'
import sys
from pose_errors import read_poses, rotate_back
for name, (rotation, translation) in read_poses(sys.argv[1]).items():
    print(name, *(f"{-x:.9f}" for x in rotate_back(rotation, translation)))
EOF
# adjust CAMERA_MODEL EXTRA_PARAMETERS FREE_CENTRE: the survey with this model of its camera, adjusted and aligned, in
# $work/adjusted_MODEL, and the queries registered in it.
adjust() {
  local to=$work/adjusted_$1
  rm -rf "$to"
  mkdir -p "$to" "$to.stated" "$to.free"
  colmap model_converter --input_path "$work/triangulated" --output_path "$to.stated" --output_type TXT
  # A pinhole's f, cx, cy begin the words of the models with distortion as well; OPENCV has two focal lengths.
  awk -v model="$1" -v extra="$2" '!/^#/ && NF {
      if (model == "OPENCV" && $2 == "SIMPLE_PINHOLE") $5 = $5 " " $5
      $2 = model; print $0 extra; next} {print}' "$to.stated/cameras.txt" >"$to.words"
  mv "$to.words" "$to.stated/cameras.txt"
  colmap bundle_adjuster --input_path "$to.stated" --output_path "$to.free" --BundleAdjustment.refine_principal_point "$3"
  colmap model_aligner --input_path "$to.free" --output_path "$to" --ref_images_path "$work/centres.txt" --ref_is_gps 0 \
    --robust_alignment_max_error 0.05
  register "adjusted_$1"
}
for words in "$model||0" "SIMPLE_RADIAL| 0|0" "OPENCV| 0 0 0 0|1"; do
  IFS='|' read -r adjusted extra free_centre <<<"$words"
  [ "$adjusted" = "$model" ] || [ "${model/SIMPLE_/}" = PINHOLE ] || continue  # what has distortion already is refined as it is
  [ "$adjusted" != SIMPLE_RADIAL ] || [ "$model" = SIMPLE_PINHOLE ] || continue
  seconds "colmap_adjust_$adjusted" adjust "$adjusted" "$extra" "$free_centre"
  print_errors "adjusted_$adjusted" "survey adjusted" | tee -a "$work/colmap.txt"
done

echo
echo "== verified matches under one test: those of each program within N px of the essential matrix fitted to them"
"$count_inliers" "$work/matches.db" "$work/survey.db" | tee "$work/inliers.txt"

num_queries=$(wc -l <"$work/queries.list")
echo
echo "== both, $(nproc) cores, $(wc -l <"$work/survey.list") survey images, $num_queries queries"
echo "cairn : extract $(of cairn_extract) + match $(of cairn_match) + group and triangulate $(of cairn_group) s"
echo "cairn : survey to map, all stages $(of cairn_compile) s; map $(stat -c %s "$work/cairn.cairn") bytes"
echo "COLMAP: survey $(of colmap_extract) + $(of colmap_match) + $(of colmap_triangulate) s (extract + match + triangulate);" \
  "database $database_bytes + model $model_bytes bytes"
echo "COLMAP: queries $(of colmap_query_extract) + $(of colmap_query_match) + $(of colmap_register) s," \
  "$(cat "$work"/colmap_query_extract.s "$work"/colmap_query_match.s "$work"/colmap_register.s |
    awk -v n="$num_queries" '{s += $1} END {printf "%.2f s a query", s / n}')"
steps_of() { awk '{s += $1} END {print s}' "${@/#/$work/}"; }
echo "extract + match + triangulate, COLMAP over cairn: $(echo "$(steps_of colmap_extract.s colmap_match.s colmap_triangulate.s)" \
  "$(steps_of cairn_extract.s cairn_match.s cairn_group.s)" | awk '{printf "%.1f x", $1 / $2}')"
echo "survey, COLMAP over cairn's whole line: $(cat "$work"/colmap_extract.s "$work"/colmap_match.s "$work"/colmap_triangulate.s |
  awk -v c="$(of cairn_compile)" '{s += $1} END {printf "%.1f x", s / c}')"
