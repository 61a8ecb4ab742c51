#!/usr/bin/env bash
# Prints what every way of choosing pairs tries and finds: the recall of pairs with at least 20 verified inliers, against
# matching all pairs.  The demo's 161,028 pairs take long: SAMPLE=N matches one pair in N, chosen by a hash, and states
# the recall with its 95 % interval [Wilson 1927].
#
#   [SAMPLE=N] bench/pairs/pair_selection.sh [redkitchen | demo | corridor]...      all of them by default
#
# Databases stay in WORK [build/bench/pairs]; what is there already is not computed again.
set -euo pipefail
top=$(cd "$(dirname "$0")/../.." && pwd)
cairn=${CAIRN:-$top/build/release/cairn}
data=${DATA:-$top/../shared/data}
work=${WORK:-$top/build/bench/pairs}
sample=${SAMPLE:-1}
[[ -x $cairn ]] || { echo "$cairn: not built; run 'make' first" >&2; exit 3; }
mkdir -p "$work"

# extract NAME: sets capture and features.
extract() {
  features=$work/$1.db
  if [[ $1 == demo ]]; then
    capture=$work/demo.build/capture features=$work/demo.build/features.db
    [[ -f $features ]] || "$cairn" compile "$top/maps/demo/recipe.toml" -o "$work/demo.cairn" \
      --build-dir "$work/demo.build" --until extract_features --progress none > /dev/null
    return
  fi
  capture=$data/$1
  [[ -d $capture ]] || { echo "$capture: not here; this capture is no part of the repository" >&2; exit 3; }
  [[ -f $features ]] || "$cairn" stage extract-features "$capture" -o "$features" --progress none --log-level error > /dev/null
}

# match OUTPUT OPTION...: seconds to OUTPUT.seconds, pairs tried to OUTPUT.tried.
match() {
  local output=$1 begin end
  shift
  [[ -f $output ]] && return
  begin=$(date +%s.%N)
  "$cairn" stage match-features "$features" "${poses[@]}" -o "$output.new" --progress none --log-level error "$@" > "$output.txt"
  end=$(date +%s.%N)
  echo "$begin $end" | awk '{printf "%.0f\n", $2 - $1}' > "$output.seconds"
  sed -E 's/.* ([0-9]+) pairs tried.*/\1/' "$output.txt" > "$output.tried"
  mv "$output.new" "$output"
}

# One pair in `sample`, by a multiplicative hash of both image ids, as a list of pairs of names.
list_sample() {
  sqlite3 -separator ' ' "file:$features?immutable=1" "
    WITH i AS (SELECT image_id, name FROM images JOIN keypoints USING (image_id) WHERE rows > 0)
    SELECT a.name, b.name FROM i a JOIN i b ON a.image_id < b.image_id
    WHERE ((a.image_id * 7919 + b.image_id) * 2654435761 >> 16) % $sample = 0"
}

# row METHOD OUTPUT: one line of the table.
row() {
  sqlite3 -separator ' ' "file:$all?immutable=1" "ATTACH 'file:$2?immutable=1' AS chosen" "
    WITH q AS (SELECT pair_id FROM main.two_view_geometries WHERE rows >= 20)
    SELECT (SELECT count(*) FROM q),
      (SELECT count(*) FROM q JOIN chosen.two_view_geometries USING (pair_id) WHERE rows >= 20)" |
    awk -v method="$1" -v tried="$(< "$2.tried")" -v seconds="$(< "$2.seconds")" -v num_all="$num_all" -v n="$sample" '{
      p = $2 / $1; z = 1.96; d = 1 + z * z / $1; m = (p + z * z / 2 / $1) / d
      h = z / d * sqrt(p * (1 - p) / $1 + z * z / 4 / $1 / $1)
      printf "| %s | %d | %.1f %% | %.2f | %.2f %%%s | %d |\n", method, tried, 100 * tried / num_all, tried / ($1 * n),
        100 * p, (n > 1 ? sprintf(" (%.2f to %.2f)", 100 * (m - h), 100 * (m + h)) : ""), seconds }'
}

for name in "${@:-redkitchen demo corridor}"; do
  for capture_name in $name; do
    extract "$capture_name"
    poses=()
    methods=("retrieval --num-retrieved 10" "retrieval --num-retrieved 20" "retrieval" "sequence --num-loop-candidates 0"
      "sequence")
    if [[ -f $capture/images.txt ]]; then
      poses=(--capture "$capture")
      methods=("retrieval" "frustum --num-frustum-seeds 0" "frustum --min-num-expected-matches 40" "frustum")
    fi
    num_all=$(sqlite3 "file:$features?immutable=1" "SELECT count(*) * (count(*) - 1) / 2 FROM keypoints WHERE rows > 0")
    all=$work/$capture_name.all_$sample.db
    if ((sample > 1)); then
      list_sample > "$all.list"
      match "$all" --pair-list "$all.list"
    else
      match "$all" --pairs exhaustive
    fi
    echo
    echo "| $capture_name | pairs tried | of all | x qualifying | recall | seconds |"
    echo "|---|---|---|---|---|---|"
    row "$( ((sample > 1)) && echo "one pair in $sample" || echo exhaustive)" "$all"
    for method in "${methods[@]}"; do
      output=$work/$capture_name.$(tr -c 'a-z0-9\n' _ <<< "$method").db
      # shellcheck disable=SC2086  # the method's options are words
      match "$output" --pairs $method
      row "\`--pairs $method\`" "$output"
    done
  done
done
