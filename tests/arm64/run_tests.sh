#!/usr/bin/env bash
# Runs tests for 64-bit ARM in an emulator:  run_tests.sh BUILD TEST...
# With the environment variable CAIRN_ALL_ARM64 also those that take minutes there.
set -euo pipefail
build=$1
shift
[[ -e $build ]] || { echo "skipped: nothing was built"; exit 77; }
export build=$(realpath "$build")
export folder=$build/tests_tmp/arm64 LC_ALL=C
rm -rf "$folder"
mkdir -p "$folder"

# A program that starts `cairn` finds it as one of this machine's.
"$(dirname "$0")/write_program.sh" "$build" "$folder/bin"

# Left out: in an emulator /proc/self/exe is the emulator where a program opens it, and the program where it reads the link.
left_out=(ProgramPath.IsThisProgramsOwnFile)
# What repeats a check for each byte of a file, and statistics of hundreds of poses.  What they check is checked by others once.
[[ -n ${CAIRN_ALL_ARM64:-} ]] || left_out+=(
  HostileMap.EveryChangedByteIsRefusedOrChangesNothing HostileMap.OtherTypesOfColumnsAreRefused MapFindings.DamagedRowsAreRefused
  MapSeal.EverySingleFlippedBitIsFound PackedMap.DamagedBlocksAreRefusedOrDecoded PackedMaps.RowsOfAnUnsignedDeltaMaySayAnything
  UpdateMapTest.TruncatedAndFlippedDeltasMakeNothing VisualMap.ADamagedPartIsAnErrorWhereItIsNeeded
  EstimateVisualPose.NoiseMakesErrorsThatTheCovarianceKnows Localizer.CovarianceIsRight Refine.NormalisedErrorSquaredHasMeanSix
  Localizer.TheErrorOfTheMapsScaleIsInTheCovariance Localizer.ALookAlikeForWhichNoWorkIsLeftIsNotExcluded
  ModelLandmarks.LearnsHowFarATurnMovesTheImage ModelLandmarks.LevelsTheHeightsOfACarriedSurvey
  ModelLandmarks.LevelsWhatTiltedCamerasSaw PosteriorOnLattice.IsThatOfBruteForce
  CPlaces.* CServo.* CStarts.* CAtlas.*
  CTrackers.OnTheFloor* CTrackers.AfterAnErrorTheyAreAsBefore CTrackers.OptionsAreThoseThatTheTrackerReadsAndBeginAnew
  Steady.ByImages Steady.ByAllFeaturesOfImages Steady.ByGivenFeatures Steady.WithinABudget Steady.EachThreadForItself Steady.BySureTracker)
filter=-$(IFS=:; echo "${left_out[*]}")
export filter

run() {
  local name=$1
  mkdir -p "$folder/$name"
  if TEST_TMPDIR=$folder/$name qemu-aarch64-static -L "$build/../sysroot/arm64" "$build/$name" --gtest_brief=1 "--gtest_filter=$filter" > "$folder/$name.log" 2>&1; then
    echo "$name: $(sed -n 's/.*PASSED *\] //p' "$folder/$name.log")"
  else
    cat "$folder/$name.log"
    echo "$name failed"
    return 1
  fi
}
export -f run
printf '%s\n' "$@" | xargs -P 2 -I{} bash -c 'run {}'
