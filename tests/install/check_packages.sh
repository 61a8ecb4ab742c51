#!/bin/sh
# Builds the Debian packages, lets lintian judge them, installs them in a fresh system, uses and removes them:
#   check_packages.sh SOURCES FOLDER POSTER
# MIRROR=http://... names another mirror than Debian's own.
set -eu
sources=$1 folder=$2 poster=$3
if [ "$(id -u)" != 0 ]; then
  echo "skipped: only root can make a fresh Debian system with debootstrap; run this test as root"
  exit 77
fi

rm -rf "$folder"  # what an earlier run compiled against other headers, too
"$sources/scripts/build_packages" "$folder"
export LC_ALL=C DEBIAN_FRONTEND=noninteractive  # only now: what is compiled depends on the locale, and so ccache's keys
lintian --allow-root --fail-on warning "$folder"/*.changes

# What the -dev package says about itself, where Debian puts it: a C program by pkg-config, C and C++ by CMake.
root=$folder/root
for name in libcairn-runtime0 libcairn-runtime-dev; do dpkg-deb -x "$folder/${name}"_*.deb "$root"; done
lib=$(dirname "$root"/usr/lib/*/libcairn-runtime.so)
example=$sources/runtime/examples/robot
PKG_CONFIG_PATH=$lib/pkgconfig
export PKG_CONFIG_PATH
cc -std=c11 "$example/where.c" -o "$folder/where_c" $(pkg-config --cflags --libs cairn-runtime)
cmake -S "$example" -B "$folder/robot" -DCMAKE_PREFIX_PATH="$root/usr" -DCMAKE_BUILD_TYPE=Release > "$folder/robot.log"
cmake --build "$folder/robot" >> "$folder/robot.log" || { cat "$folder/robot.log" >&2; exit 1; }
for program in "$folder/where_c" "$folder/robot/where_c" "$folder/robot/where_cc"; do
  LD_LIBRARY_PATH=$lib "$program" "$poster/poster.cairn" "$poster/poster.pgm" | grep -q 'm, [0-9]* inliers' ||
    { echo "$program gives no fix" >&2; exit 1; }
done

system=$(mktemp -d)
trap 'rm -rf --one-file-system "$system"' EXIT
debootstrap --variant=minbase bookworm "$system" "${MIRROR:-http://deb.debian.org/debian}" > "$folder/debootstrap.log" 2>&1 ||
  { tail -5 "$folder/debootstrap.log" >&2; echo "debootstrap failed; is the mirror in reach?" >&2; exit 1; }
inside() { chroot "$system" "$@"; }

# Nothing of this outlives the test: no need to wait for the disk.
echo force-unsafe-io > "$system/etc/dpkg/dpkg.cfg.d/unsafe"
mkdir "$system/packages"
cp "$folder"/*.deb "$poster/poster.cairn" "$poster/poster.pgm" "$example/where.py" "$example/pgm.py" "$system/packages"
inside find / -xdev -path /packages -prune -o -path '*cairn*' -print > "$folder/before"

install() {  # names of packages
  for name; do set -- "$@" "/packages/$(basename "$folder/${name}"_*.deb)"; shift; done
  inside apt-get install -y -q --no-install-recommends "$@" > "$folder/install.log" 2>&1 ||
    { tail -20 "$folder/install.log" >&2; exit 1; }
}

# A robot: the library and Python, without the compiler.
install libcairn-runtime0 python3-cairn
answer=$(inside python3 /packages/where.py /packages/poster.cairn /packages/poster.pgm)
echo "python3-cairn in a fresh system: $answer"
echo "$answer" | grep -q '^0\.[0-9]* 0\.[0-9]* 1\.[0-9]* m, [0-9]* inliers' || exit 1
inside dpkg-query -W -f '${Package}\n' > "$folder/robot_packages"
echo "$(wc -l < "$folder/robot_packages") packages on the robot"
if grep -E 'imgcodecs|colmap|ceres|geos|glpk|cbc|spdlog|toml' "$folder/robot_packages"; then
  echo "the runtime brought these, which no robot needs" >&2
  exit 1
fi

# Who makes maps.
install cairn libcairn-runtime-dev
inside cairn --version
inside cairn localize /packages/poster.cairn /packages/poster.pgm --log-level off | grep -q '"fix":true'
inside test -e /usr/share/man/man1/cairn-localize.1.gz -o -e /usr/share/man/man1/cairn-localize.1

# Films need FFmpeg, which is recommended: without it the program says what to install, and that is enough.
if inside dpkg-query -W -f '${Package}\n' | grep -E '^lib(av(format|codec|util)|swscale)'; then
  echo "FFmpeg's libraries came although nobody asked for films" >&2
  exit 1
fi
for library in libavformat libavcodec libavutil libswscale; do
  dpkg-deb -f "$folder"/cairn_*.deb Recommends | grep -q "$library" || { echo "cairn does not recommend $library" >&2; exit 1; }
done
# A program finds its own files by /proc, which is there for it alone.
inside_with_proc() { unshare --mount sh -c 'mount -t proc proc "$0/proc" && exec chroot "$0" "$@"' "$system" "$@"; }
import() { inside_with_proc cairn import /packages/walk.mp4 -o /packages/walk --keyframes all --progress none; }
if inside_with_proc true 2> /dev/null; then
  ffmpeg -v error -f lavfi -i testsrc=size=320x240:rate=10:duration=1 -c:v mpeg4 "$system/packages/walk.mp4"
  if import 2> "$folder/films"; then
    echo "a film was read without FFmpeg's libraries" >&2
    exit 1
  fi
  cat "$folder/films"
  said=$(sed -n 's/.*install them (Debian: apt install \(.*\))$/\1/p' "$folder/films")
  inside apt-get install -y -q --no-install-recommends $said > "$folder/install.log" 2>&1 ||
    { tail -20 "$folder/install.log" >&2; exit 1; }
  import
else
  echo "films were not tried: /proc cannot be mounted here"
fi

inside apt-get purge -y -q cairn libcairn-runtime0 libcairn-runtime-dev python3-cairn > "$folder/purge.log" 2>&1 ||
  { tail -20 "$folder/purge.log" >&2; exit 1; }
inside find / -xdev -path /packages -prune -o -path /proc -prune -o -path '*cairn*' -print > "$folder/after"
if ! diff "$folder/before" "$folder/after"; then
  echo "these files stayed when the packages were removed" >&2
  exit 1
fi
