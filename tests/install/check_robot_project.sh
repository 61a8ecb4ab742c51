#!/bin/sh
# A robot's own project against an installed tree, as a robot engineer meets it: CMake's package, pkg-config for C and C++,
# and the Python module:  check_robot_project.sh BUILD EXAMPLE POSTER
set -eu
build=$1 example=$2 poster=$3
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export LC_ALL=C

DESTDIR=$folder/root cmake --install "$build" --prefix /opt/cairn > "$folder/log"
root=$folder/root/opt/cairn
lib=$(dirname "$(find "$root" -name 'libcairn-runtime.so.0')")
test -x "$root/bin/cairn" -a -e "$root/share/man/man1/cairn-localize.1" -a -e "$root/share/doc/cairn/licences.md"
"$root/bin/cairn" --version

expect() {  # a program's answer: the poster's query is at (0.4, 0.1, 1.6)
  answer=$("$@" "$poster/poster.cairn" "$poster/poster.pgm")
  echo "$1: $answer"
  echo "$answer" | awk '{exit !($1 - 0.4 < 0.05 && 0.4 - $1 < 0.05 && $3 - 1.6 < 0.05 && 1.6 - $3 < 0.05)}'
}

# Headers alone: what the C++ header needs must be there, without the sources of cairn in reach.
cp -r "$example" "$folder/robot"
cmake -S "$folder/robot" -B "$folder/robot/build" -DCMAKE_PREFIX_PATH="$root" -DCMAKE_BUILD_TYPE=Release >> "$folder/log"
cmake --build "$folder/robot/build" >> "$folder/log" || { cat "$folder/log"; exit 1; }
expect "$folder/robot/build/where_c"
expect "$folder/robot/build/where_cc"

# Python and what CMake builds find the library by themselves; what pkg-config builds, where the system looks.
module=$(find "$root" -type d -name cairn -path '*-packages/cairn')
PYTHONPATH=$(dirname "$module") expect "$folder/robot/where.py"
export PKG_CONFIG_PATH="$lib/pkgconfig" LD_LIBRARY_PATH="$lib"
cd "$folder/robot"
cc -std=c11 -Wall -Wextra -Werror -pedantic where.c -o where_c $(pkg-config --cflags --libs cairn-runtime)
expect ./where_c
c++ -std=c++20 where.cc -o where_cc $(pkg-config --cflags --libs cairn-runtime)
expect ./where_cc
