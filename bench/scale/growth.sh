#!/usr/bin/env bash
# Time and memory of stages 2 to 9 for surveys of more and more images (synthetic_building.cc), with the exponents p of
# growth ~ images^p between the smallest and the largest.  CPU seconds are user + system.
#
#   bench/scale/growth.sh [IMAGES...]     default: 1000 3000 10000; about an hour on 2 cores, 4 GB on the disk in
#                                         WORK [build/bench/scale]; FEATURES [400]: most features of an image
set -euo pipefail
top=$(cd "$(dirname "$0")/../.." && pwd)
cairn=${CAIRN:-$top/build/release/cairn}
synthetic_building=${SYNTHETIC_BUILDING:-$top/build/release/synthetic_building}
work=${WORK:-$top/build/bench/scale}
num_features=${FEATURES:-400}
[[ $# -gt 0 ]] && sizes=("$@") || sizes=(1000 3000 10000)
[[ -x $cairn ]] || { echo "$cairn: not built; run 'make' first" >&2; exit 3; }
if [[ ! -x $synthetic_building ]]; then
  cmake -S "$top" -B "$top/build/release" -DCAIRN_BUILD_BENCHMARKS=ON > /dev/null
  cmake --build "$top/build/release" --target synthetic_building > /dev/null
fi
mkdir -p "$work"
rows=$work/rows.tsv
: > "$rows"

# stage IMAGES NAME ARGUMENT...: runs it, adds a row: images, stage, seconds, CPU seconds, peak KiB, bytes written
stage() {
  local num_images=$1 name=$2 log=$work/time.log output
  shift 2
  output=${*: -1}
  rm -f "$output"
  /usr/bin/time -o "$log" -f '%e %U %S %M' "$cairn" stage "$name" --progress none --log-level error "$@" >&2
  tail -n 1 "$log" | awk -v n="$num_images" -v s="$name" -v b="$(stat -c %s "$output")" \
      '{printf "%d\t%s\t%.1f\t%.1f\t%d\t%d\n", n, s, $1, $2 + $3, $4, b}' >> "$rows"
}

for n in "${sizes[@]}"; do
  survey=$work/building_${n}_$num_features
  [[ -f $survey/images.txt ]] || "$synthetic_building" "$survey" "$n" "$num_features" >&2
  stage "$n" match-features "$survey/features.db" --capture "$survey" -o "$survey/matches.db"
  stage "$n" group-classes "$survey/matches.db" --capture "$survey" -o "$survey/classes.db"
  stage "$n" filter-visibility "$survey/classes.db" --min-num-stations 4 --min-block-side 1 --min-num-neighbours 0 \
      -o "$survey/world.db"
  stage "$n" decompose-regions "$survey/world.db" --classes "$survey/classes.db" --k 40 -o "$survey/regions.db"
  stage "$n" build-vocabulary "$survey/features.db" -o "$survey/vocabulary.db"
  stage "$n" link-appearance "$survey/matches.db" "$survey/vocabulary.db" --capture "$survey" --classes "$survey/classes.db" \
      -o "$survey/appearance.db"
  stage "$n" emit-map --matches "$survey/matches.db" --classes "$survey/classes.db" --world "$survey/world.db" \
      --regions "$survey/regions.db" --vocabulary "$survey/vocabulary.db" --appearance "$survey/appearance.db" --name building \
      -o "$survey/map.cairn"
done

awk -F '\t' -v sizes="${sizes[*]}" '
  function exponent(a, b) { return a > 0 && b > 0 ? sprintf("%.2f", log(b / a) / log(n[count] / n[1])) : "" }
  { seconds[$2, $1] = $3; cpu[$2, $1] = $4; peak[$2, $1] = $5 / 1024; bytes[$2, $1] = $6 / 1e6
    if (!($2 in known)) { known[$2]; stages[++num_stages] = $2 } }
  END {
    count = split(sizes, n, " ")
    printf "| stage |"
    for (i = 1; i <= count; ++i) printf " %d: CPU s (elapsed), peak MiB, MB written |", n[i]
    printf " exponent of CPU, memory |\n|---|"
    for (i = 1; i <= count; ++i) printf "---|"
    printf "---|\n"
    for (s = 1; s <= num_stages; ++s) {
      name = stages[s]
      printf "| %s |", name
      for (i = 1; i <= count; ++i)
        printf " %.1f (%.1f), %.0f, %.1f |", cpu[name, n[i]], seconds[name, n[i]], peak[name, n[i]], bytes[name, n[i]]
      printf " %s, %s |\n", exponent(cpu[name, n[1]], cpu[name, n[count]]), exponent(peak[name, n[1]], peak[name, n[count]])
    }
  }' "$rows"
