#!/usr/bin/env bash
# Cross-builds the Debian packages for 64-bit ARM and, in the same build, tests of core, the runtime and the C API:
#   build.sh SOURCES FOLDER TEST...      FOLDER: gets packages, and a link `build` to where they were built; TEST: targets
# Exit 77: skipped, since nobody asked for it (CAIRN_ARM64 in the environment, as `make test-arm64` has it), the compiler or the emulator
# is not installed, or Debian's packages of arm64 are not in reach.
set -euo pipefail
sources=$1 folder=$(realpath -m "$2")
shift 2

rm -f "$folder/build"
[[ -n ${CAIRN_ARM64:-} ]] || { echo "skipped: \`make test-arm64\` builds and runs them"; exit 77; }
for tool in aarch64-linux-gnu-g++ qemu-aarch64-static; do
  command -v $tool > /dev/null || { echo "skipped: no $tool; \`make deps-all\` installs it"; exit 77; }
done
"$sources/scripts/build_packages" "$folder" arm64

build=$(echo "$folder"/cairn-*/build/release)
export CAIRN_SYSROOT=$build/../sysroot/arm64
cmake -S "$(realpath "$build/../..")" -B "$build" -DCAIRN_BUILD_TESTS=ON > "$build/configure.log" 2>&1 ||
  { tail -20 "$build/configure.log" >&2; exit 1; }
cmake --build "$build" --parallel 2 --target "$@" > "$build/build.log" 2>&1 || { grep -A 20 FAILED "$build/build.log" | head -60 >&2; exit 1; }
ln -s "$build" "$folder/build"
