#!/usr/bin/env bash
# Prints the memory that matching takes for 2,000 synthetic images of 2,000 features (synthetic_survey.cc), by budget:
# pairs chosen by poses, neighbours with loop candidates, and pairs scattered over all images, one in 2,000 of all, where
# every stretch of pairs wants other images.
#
#   bench/pairs/memory.sh [IMAGES] [FEATURES]      a few minutes on 2 cores, 2 GB on the disk in WORK [build/bench/pairs]
set -euo pipefail
top=$(cd "$(dirname "$0")/../.." && pwd)
cairn=${CAIRN:-$top/build/release/cairn}
synthetic_survey=${SYNTHETIC_SURVEY:-$top/build/release/synthetic_survey}
work=${WORK:-$top/build/bench/pairs}
images=${1:-2000} num_features=${2:-2000}
[[ -x $cairn ]] || { echo "$cairn: not built; run 'make' first" >&2; exit 3; }
if [[ ! -x $synthetic_survey ]]; then
  cmake -S "$top" -B "$top/build/release" -DCAIRN_BUILD_BENCHMARKS=ON > /dev/null
  cmake --build "$top/build/release" --target synthetic_survey > /dev/null
fi
mkdir -p "$work"
survey=$work/synthetic_${images}_$num_features
features=$survey/features.db
[[ -f $survey/images.txt ]] || "$synthetic_survey" "$survey" "$images" "$num_features"
list=$work/scattered_$images.txt
sqlite3 -separator ' ' "file:$features?immutable=1" "
  SELECT a.name, b.name FROM images a JOIN images b ON a.image_id < b.image_id
  WHERE ((a.image_id * 7919 + b.image_id) * 2654435761 >> 16) % 2000 = 0 OR b.image_id = a.image_id + 1" > "$list"

# row LABEL BUDGET OPTION...
row() {
  local label=$1 budget=$2 log=$work/memory.log tried
  shift 2
  rm -f "$work/memory.db"
  /usr/bin/time -o "$log" -f '%M %e' "$cairn" stage match-features "$features" -o "$work/memory.db" --memory "$budget" \
    --progress none --log-level error "$@" > "$log.txt"
  tried=$(sed -E 's/.* ([0-9]+) pairs tried.*/\1/' "$log.txt")
  echo "$(tail -n 1 "$log") $(sha256sum "$work/memory.db" | cut -c1-12)" |
    awk -v l="$label" -v b="$budget" -v t="$tried" '{printf "| %s | %d | %d | %d | %d | %s |\n", l, t, b, $1 / 1024, $2, $3}'
}

echo "| $images images x $num_features features | pairs | \`--memory\`, MiB | peak, MiB | seconds | SHA-256 of matches.db |"
echo "|---|---|---|---|---|---|"
row "\`--pairs frustum\`" 1024 --pairs frustum --capture "$survey"
row "\`--pairs sequence\`" 1024 --pairs sequence
for budget in 64 256 512 1024 2048; do
  row "scattered (\`--pair-list\`)" "$budget" --pair-list "$list"
done
rm -f "$work/memory.db"
