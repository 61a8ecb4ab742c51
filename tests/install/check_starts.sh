#!/bin/sh
# The examples that find out where a robot started say the same, to the last bit, and are right:
#   check_starts.sh POSTER PROGRAM...
# The robot drives along wing b, which looks like wing a up to the third place, to h1.
set -eu
poster=$1
shift
. "$(dirname "$0")/agree.sh"
for program; do
  said=$("$program" "$poster/wings.cairn" h1 "$poster"/wing[0-5].pgm)
  agree "$program" "$said"
done

# Before the third picture both wings are likely; then it is wing b, and stays so.
echo "$first" | awk '
  function b() { return $2 == "b0" ? $3 : $5 }
  NR == 1 && ($1 != "follow" || NF != 5 || $3 != 0.5 || $5 != 0.5) { print "the first picture is not of two starts: " $0; bad = 1 }
  NR == 2 && ($1 != "follow" || b() < 0.2 || b() > 0.8) { print "the second picture decides what it cannot: " $0; bad = 1 }
  NR == 3 && ($1 != "switch" || b() < 0.9) { print "the third picture does not decide: " $0; bad = 1 }
  NR > 3 && NR < 7 && ($1 != "follow" || b() < 0.9) { print "wing b is given up: " $0; bad = 1 }
  NR == 7 && $0 != "way b0 b1 b2 b3 h0 h1" { print "another way: " $0; bad = 1 }
  END { exit NR != 7 || bad }' >&2
