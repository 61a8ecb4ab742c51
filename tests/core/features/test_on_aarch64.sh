#!/usr/bin/env bash
# Compiles the kernels of matching and of SIFT and their tests for 64-bit ARM and runs them in an emulator, as a processor with dot
# products and as one without:  test_on_aarch64.sh SOURCE EIGEN WORK
# Exit 77: skipped, since the cross compiler, the emulator or GoogleTest's sources are not installed.
set -euo pipefail
source=$1
eigen=$2
work=$3
googletest=/usr/src/googletest/googletest

compiler=$(command -v aarch64-linux-gnu-g++) || { echo "skipped: no aarch64-linux-gnu-g++ (g++-aarch64-linux-gnu)"; exit 77; }
emulator=$(command -v qemu-aarch64-static || command -v qemu-aarch64) || { echo "skipped: no qemu-aarch64 (qemu-user-static)"; exit 77; }
[[ -f $googletest/src/gtest-all.cc ]] || { echo "skipped: no $googletest (googletest)"; exit 77; }

mkdir -p "$work"
compile() { "$compiler" -std=c++20 -O2 -ffp-contract=off -I"$source" -isystem "$eigen" -isystem "$googletest/include" "${@:2}" -c "$1" -o "$work/$(basename "$1").o"; }
rm -f "$work"/*.o
compile "$source/core/features/best_two_neon_dot.cc" -march=armv8.2-a+dotprod -Wall -Wextra -Werror
for file in core/base/pooled.cc core/features/best_two_portable.cc core/features/descriptor_distance.cc core/features/descriptor_matcher.cc core/features/packed_descriptors.cc \
  tests/core/features/best_two_sweep_test.cc tests/core/features/descriptor_matcher_test.cc; do
  compile "$source/$file" -Wall -Wextra -Werror
done
sift_flags=(-O3 -fno-math-errno -fno-trapping-math -Wall -Wextra -Werror)
compile "$source/core/sift/sift_kernels_neon.cc" "${sift_flags[@]}" -fno-predictive-commoning
for file in core/sift/sift_kernels_portable.cc core/sift/choose_kernels.cc core/sift/gaussian.cc tests/core/sift/wide_kernels.cc \
  tests/core/sift/sift_kernels_test.cc tests/core/sift/gaussian_test.cc; do
  compile "$source/$file" "${sift_flags[@]}"
done
for file in gtest-all gtest_main; do compile "$googletest/src/$file.cc" -I"$googletest"; done
"$compiler" -static "$work"/*.o -o "$work/matcher_test"

"$emulator" -cpu max "$work/matcher_test" --gtest_brief=1 | tee "$work/max.log"
"$emulator" -cpu max "$work/matcher_test" --gtest_filter='*neon_dot*' > "$work/neon.log"
if grep -q SKIPPED "$work/neon.log" || ! grep -q 'PASSED.*[1-9] test' "$work/neon.log"; then
  echo "the emulated processor has dot products, but they were not used:" >&2
  cat "$work/neon.log" >&2
  exit 1
fi
"$emulator" -cpu cortex-a72 "$work/matcher_test" --gtest_filter='*neon_dot*' > "$work/without.log"
grep -q 'SKIPPED' "$work/without.log" || { echo "dot products were used where there are none" >&2; exit 1; }
"$emulator" -cpu cortex-a72 "$work/matcher_test" --gtest_brief=1
