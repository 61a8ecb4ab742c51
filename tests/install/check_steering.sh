#!/bin/sh
# The examples that steer a robot say the same, to the last bit, and are right:
#   check_steering.sh POSTER PROGRAM...
# The robot comes from 80 cm behind r2 on; once it sees nothing; at last it is there.
set -eu
poster=$1
shift
. "$(dirname "$0")/agree.sh"
for program; do
  said=$("$program" "$poster/room.cairn" r2 "$poster/room0.pgm" "$poster/room4.pgm" "$poster/room8.pgm" "$poster/blank.pgm" "$poster/room10.pgm" \
    "$poster/room16.pgm" "$poster/room0.pgm")
  agree "$program" "$said"
done
echo "$first" | awk '
  NR != 4 && NR < 6 && ($1 != "approaching" || $2 <= 0 || $6 < 40) { print "it does not come nearer: " $0; bad = 1 }
  NR == 4 && $0 != "lost 0 m/s 0 rad/s, 0 matches" { print "it drives where it sees nothing: " $0; bad = 1 }
  NR == 6 && ($1 != "arrived" || $2 != 0 || $4 != 0) { print "it has not arrived: " $0; bad = 1 }
  END { if (NR != 6) print "not as many commands as images up to the last: " NR; exit NR != 6 || bad }' >&2
