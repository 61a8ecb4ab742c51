#!/usr/bin/env bash
# Compares what is in the Debian packages for 64-bit ARM, and what they need, with this machine's, unpacks them over Debian's own
# packages and uses them in an emulator:  check_packages.sh SOURCES FOLDER POSTER      FOLDER: that of build.sh
set -euo pipefail
sources=$1 folder=$(realpath -m "$2") poster=$3
[[ -e $folder/build ]] || { echo "skipped: nothing was built"; exit 77; }
sysroot=$(realpath "$folder/build/../sysroot/arm64")
export LC_ALL=C
names=(cairn libcairn-runtime0 libcairn-runtime-dev python3-cairn)

# All that is machine code is the other machine's, and stripped.
root=$folder/root
rm -rf "$root" "${names[@]/#/$folder/}"
cp -al "$sysroot" "$root"
for name in "${names[@]}"; do
  [[ $(dpkg-deb -f "$folder/${name}"_*.deb Architecture) == arm64 ]]
  dpkg-deb -x "$folder/${name}"_*.deb "$folder/$name"
  dpkg-deb --fsys-tarfile "$folder/${name}"_*.deb | tar -x --keep-directory-symlink -C "$root"
done
num_binaries=0
while read -r file; do
  said=$(file -b "$file")
  [[ $said == ELF* ]] || continue
  [[ $said == *aarch64* && $said == *", stripped"* ]] || { echo "$file: $said" >&2; exit 1; }
  num_binaries=$((num_binaries + 1))
done < <(find "${names[@]/#/$folder/}" -type f)
((num_binaries == 5)) || { echo "$num_binaries programs and libraries, expected the program, its modules for images and films, the library, Python's module" >&2; exit 1; }
[[ -f $folder/python3-cairn/usr/lib/python3/dist-packages/cairn/_cairn.cpython-311-aarch64-linux-gnu.so ]]
! grep -rn "$(dirname "$folder")" "$folder/libcairn-runtime-dev" || { echo "a path of the build is in the headers' package" >&2; exit 1; }

# The same files and the same needs, where this machine's packages are there and of the same sources.
native=$(dirname "$folder")/deb-test
contents() { dpkg-deb -c "$1" | awk '{print $6}' | sed 's/x86_64-linux-gnu/aarch64-linux-gnu/' | sort; }
needs() { dpkg-deb -f "$1" "$2" | tr ',' '\n' | awk '{print $1}' | sort; }
is_newer() { [[ -n $(find "$sources" \( -path "$sources/build" -o -path "$sources/.git" \) -prune -o -newer "$1" -type f -print -quit) ]]; }
for name in "${names[@]}"; do
  if ! ls "$native/${name}"_*_amd64.deb > /dev/null 2>&1 || is_newer "$native/${name}"_*_amd64.deb; then continue; fi
  diff <(contents "$native/${name}"_*_amd64.deb) <(contents "$folder/${name}"_*.deb)
  for field in Depends Recommends; do
    diff <(needs "$native/${name}"_*_amd64.deb $field) <(needs "$folder/${name}"_*.deb $field)
  done
  echo "$name: files and needs of amd64's"
done
dpkg-deb -f "$folder"/libcairn-runtime0_*.deb Depends | grep -q 'libopencv-core406.*libstdc++6' ||
  { echo "the library does not say what it needs" >&2; exit 1; }

# As on a robot.
emulated() { qemu-aarch64-static -L "$root" "$@"; }
emulated "$root/usr/bin/cairn" --version
emulated "$root/usr/bin/cairn" localize "$poster/poster.cairn" "$poster/poster.pgm" --log-level off | grep -q '"fix":true'
answer=$(PYTHONDONTWRITEBYTECODE=1 emulated "$root/usr/bin/python3" "$sources/runtime/examples/robot/where.py" "$poster/poster.cairn" "$poster/poster.pgm")
echo "python3-cairn: $answer"
grep -q '^0\.[0-9]* 0\.[0-9]* 1\.[0-9]* m, [0-9]* inliers' <<< "$answer"
rm -rf "$root"
