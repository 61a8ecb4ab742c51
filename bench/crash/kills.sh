#!/usr/bin/env bash
# Kills the stages of a small compile with SIGKILL COUNT times (200), by turns at a named call and at any time, and compares
# the bytes after each rerun with those of a clean build:  bench/crash/kills.sh [COUNT [BUILD]]
set -euo pipefail
cd "$(dirname "$0")/../.."
CAIRN_NUM_KILLS=${1:-200} exec "${2:-build/release}/end_to_end_test" --gtest_filter='Kill.*'
