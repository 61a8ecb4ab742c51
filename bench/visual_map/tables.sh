#!/bin/sh
# Maps of one survey, of all filtered features and of regions with k = 10 and 4 common ones (tau = 0 and 1, rho = 3, B.2
# [Sala06 §VI-B]), each with a visual map; then the tables.
#   [K="10 4"] [TAU="0 1"] [RHO=3] [ALGORITHM=b2] bench/visual_map/tables.sh CAIRN TABLES BUILD CAPTURE OUT [options of TABLES]
# CAIRN and TABLES are programs of build/release (-DCAIRN_BUILD_BENCHMARKS=ON), BUILD the build folder of the survey's map.
# OUT/regions_*.svg show which places belong to which region, and its landmarks.
set -eu
cairn=$1 tables=$2 build=$3 capture=$4 out=$5
shift 5
mkdir -p "$out"
emit() {
  "$cairn" stage emit-map --classes "$build/classes.db" --world "$build/world.db" --vocabulary "$build/vocabulary.db" \
    --regions "$1" --name "$2" --visual-map true --landmarks regions -o "$out/$2.cairn" --log-level error --progress none > /dev/null
  "$cairn" inspect "$out/$2.cairn" --svg "$out/regions_$2.svg" > /dev/null
}
# One region that keeps every feature of the world.
python3 - "$build/world.db" "$out/all.json" <<'EOF'
import json, sqlite3, sys
world = sqlite3.connect(f"file:{sys.argv[1]}?mode=ro", uri=True)
features = world.execute("SELECT count(*) FROM features").fetchone()[0]
stations = world.execute("SELECT count(*) FROM stations").fetchone()[0]
json.dump({"format": "cairn-regions", "version": 1, "algorithm": "all", "k": features, "tau": 0, "rho": 0, "seed": 0,
           "lower_bound": None, "uncovered_limit": 0, "uncovered": [],
           "regions": [{"features": list(range(features)), "poses": list(range(stations))}]}, open(sys.argv[2], "w"))
EOF
emit "$out/all.json" all
maps=$out/all.cairn
for k in ${K:-10 4}; do
  for tau in ${TAU:-0 1}; do
    name=k${k}_tau${tau}
    "$cairn" stage decompose-regions "$build/world.db" --classes "$build/classes.db" --algorithm "${ALGORITHM:-b2}" \
      --k $k --tau $tau --rho "${RHO:-3}" -o "$out/$name.db" --log-level error --progress none > "$out/$name.txt"
    emit "$out/$name.db" $name
    maps="$maps $out/$name.cairn"
  done
done
"$tables" "$capture" $maps "$@"
