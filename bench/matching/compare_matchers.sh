#!/usr/bin/env bash
# Times cairn's matching kernels, OpenCV's brute force and FLANN beside COLMAP's matcher on the same descriptors, in
# processor time of one thread each, and prints a table per number of features:
#
#   bench/matching/compare_matchers.sh [IMAGES] [WORK]      about five minutes; IMAGES: a folder of overlapping pictures
#
# The first four pictures, their SIFT features the 1,000, 4,000 and 8,000 strongest.  COLMAP matches them twice with a
# limit of inliers that no pair reaches, so that none is verified; the second time all pairs are there already, so that
# the difference of the two runs' processor time is what matching takes.  A third run, not timed, tells its matches.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
images=$(realpath -m "${1:-${DATA:-$top/../shared/data}/lund}")
work=${2:-$top/build/bench/matching}
build=${BUILD:-$top/build/release}
for program in cairn compare_matchers; do
  [[ -x $build/$program ]] || { echo "$build/$program: not built; run 'make bench'" >&2; exit 3; }
done
pictures=("$images"/*.jpg)
[[ -f ${pictures[3]:-} ]] || { echo "$images: no four pictures; the lund capture is not part of this repository: matchers are not compared" >&2; exit 0; }
export QT_QPA_PLATFORM=offscreen
rm -rf "$work"
mkdir -p "$work/images"
ln -s "${pictures[@]:0:4}" "$work/images/"
log=$work/log

# match DATABASE OPTION...: COLMAP's matcher in one thread; prints its processor seconds
match() {
  local TIMEFORMAT='%U %S'
  { time colmap exhaustive_matcher --database_path "$1" --SiftMatching.use_gpu 0 --SiftMatching.num_threads 1 \
      "${@:2}" >>"$log" 2>&1; } 2>&1 | awk '{print $1 + $2}' ||
    { echo "colmap failed; the end of $log:" >&2; tail -n 5 "$log" >&2; return 1; }
}

awk -F ': *' '/^model name/ {print "processor: " $2; exit}' /proc/cpuinfo
for num_features in 1000 4000 8000; do
  features=$work/features_$num_features.db
  colmap=$work/colmap_$num_features.db
  "$build/cairn" stage extract-features "$work/images" --max-num-features "$num_features" --contrast-threshold 0.005 -o "$features" --progress none >>"$log" 2>&1
  cp "$features" "$colmap"
  matching=$(match "$colmap" --SiftMatching.min_num_inliers 1000000)
  reading=$(match "$colmap" --SiftMatching.min_num_inliers 1000000)
  cp "$features" "$colmap"
  match "$colmap" --SiftMatching.min_num_inliers 1 --SiftMatching.max_num_trials 100 >>"$log"
  "$build/compare_matchers" "$features" "$colmap" \
    "$(awk -v a="$matching" -v b="$reading" 'BEGIN {print 1000 * (a - b) / 6}')"
done
