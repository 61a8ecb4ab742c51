#!/bin/sh
# The examples that find a robot by its laser say the same, to the last bit, and are right:
#   check_lasers.sh POSTER PROGRAM...
# tests/install/laser_room.h: it begins at (-4, 0) and drives 1.2 m along x.
set -eu
poster=$1
shift
. "$(dirname "$0")/agree.sh"
for program; do
  said=$("$program" "$poster/laser.cairn" "$poster/scans.txt")
  agree "$program" "$said"
done

echo "$first" | awk '
  function near(a, b) { return a - b < 0.06 && b - a < 0.06 }
  NR == 1 && (!near($1, -4) || !near($2, 0) || !near($4, 0.1)) { print "begins elsewhere: " $0; bad = 1 }
  NR == 6 && (!near($1, -2.8) || $6 + 0 < 0.99) { print "ends elsewhere, or is not sure: " $0; bad = 1 }
  $(NF - 1) != "elsewhere" || $NF > 0.5 { print "is lost: " $0; bad = 1 }
  END { exit NR != 6 || bad }' >&2
