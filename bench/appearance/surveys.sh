#!/bin/sh
# Surveys that the sparse appearance graph is measured on: rendered, matched and checked, each in a folder of the place
# named first.  SURVEYS chooses some of them; what is matched already is only checked again.
#
#   SURVEYS="office home" bench/appearance/surveys.sh /tmp/appearance
#
# office     lattice of about 234 stations, four headings fused to one node [Booij06: 234 panoramas of an office]
# home       two runs through a hallway and two rooms in poor light, panoramas: the first is the survey, the second is
#            located [Booij06: 253 and 300 images; of 11 kept ones 7 in the hallway, 2 in each room]
# kitchen    7-Scenes RedKitchen, its 57 queries located
# corridor   two laps of a corridor without poses: the second is located
set -eu
place=${1:?folder to work in}
cairn=${CAIRN:-build/release/cairn}
data=${DATA:-../shared/data}
mkdir -p "$place"

match() {  # SURVEY OPTION...: $place/SURVEY/capture to matches.db
  survey=$1; shift
  [ -f "$place/$survey/matches.db" ] && return
  "$cairn" stage extract-features "$place/$survey/capture" -o "$place/$survey/features.db" --progress none
  "$cairn" stage match-features "$place/$survey/features.db" --capture "$place/$survey/capture" "$@" \
      -o "$place/$survey/matches.db" --progress none
}
check() {  # SURVEY OPTION...
  survey=$1; shift
  echo "$survey, $*"
  "$cairn" stage link-appearance "$place/$survey/matches.db" --capture "$place/$survey/capture" --svg "$place/$survey/graph.svg" \
      -o "$place/$survey/appearance.db" ${FUSE:-}
  "$cairn" stage check-appearance "$place/$survey/matches.db" ${FUSE:-} "$@" --progress none
}

for survey in ${SURVEYS:-office home kitchen corridor}; do
  mkdir -p "$place/$survey"
  FUSE=
  case $survey in
  office)
    [ -d "$place/office/capture" ] || "$cairn" stage simulate --width-m 13 --depth-m 9 --num-rooms 3 --corridor-width-m 2 \
        --num-queries 0 -o "$place/office/capture" --progress none
    match office
    FUSE='--fuse name'
    check office
    ;;
  home)
    if [ ! -d "$place/home/capture" ]; then
      for run in '0 0.242' '1 0.2248'; do
        set -- $run
        "$cairn" stage simulate --width-m 9.5 --depth-m 7.5 --num-rooms 2 --corridor-width-m 1.6 --survey driven --run "$1" \
            --step-m "$2" --camera-model EQUIRECTANGULAR --panorama-width-px 1024 --light-ratio 0.25 --image-noise 3 \
            --num-queries 0 -o "$place/home/run$1" --progress none
      done
      "$cairn" join run0="$place/home/run0" run1="$place/home/run1" -o "$place/home/capture"
    fi
    match home
    echo run1/ > "$place/home/held_out"
    check home --held-out "$place/home/held_out" --num-kept 11
    ;;
  kitchen)
    if [ ! -d "$place/kitchen/capture" ]; then
      mkdir "$place/kitchen/capture"
      ln -s "$(realpath "$data/redkitchen/images")" "$place/kitchen/capture/images"
      cp "$data/redkitchen/cameras.txt" "$place/kitchen/capture/"
      cat "$data/redkitchen/images.txt" "$data/redkitchen/queries.txt" > "$place/kitchen/capture/images.txt"
    fi
    match kitchen
    check kitchen --held-out "$data/redkitchen/queries.txt"
    ;;
  corridor)
    [ -d "$place/corridor/capture" ] || { mkdir "$place/corridor/capture" &&
        ln -s "$(realpath "$data/corridor")"/*.jpg "$place/corridor/capture/"; }
    match corridor --pairs exhaustive
    (cd "$place/corridor/capture" && ls | sort -n | tail -n +41) > "$place/corridor/held_out"
    check corridor --held-out "$place/corridor/held_out"
    ;;
  *) echo "surveys.sh: no survey is called $survey" >&2; exit 2 ;;
  esac
done
