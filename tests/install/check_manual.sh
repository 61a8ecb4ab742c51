#!/bin/sh
# Every subcommand has a page, and every option of --help stands in it:  check_manual.sh PROGRAM FOLDER
set -eu
program=$1 folder=$2
for page in "$folder"/man1/cairn-*.1; do
  words=$(sed -n 's/^\.B cairn //p' "$page" | sed 's/\\-/-/g')  # "plan locate"
  warnings=$(man --warnings -E UTF-8 -l -Tutf8 "$page" 2>&1 > /dev/null || true)
  if [ -n "$warnings" ]; then
    echo "$page: $warnings" >&2
    exit 1
  fi
  options=$("$program" $words --help-all | grep -oE '^  (-[a-z],)?--[a-z0-9-]+' | grep -oE -- '--.*')
  [ "$(echo "$options" | wc -l)" -ge 8 ] || { echo "cairn $words --help-all lists only: $options" >&2; exit 1; }
  for option in $options; do
    if ! sed 's/\\-/-/g' "$page" | grep -qF -- "$option"; then
      echo "$page does not have $option" >&2
      exit 1
    fi
    grep -F "\"$words \"" "$folder/cairn.bash" | grep -qF -- "$option" || { echo "no completion for $words $option" >&2; exit 1; }
  done
  sed 's/\\-/-/g' "$folder/man1/cairn.1" | grep -q "^.fB$words.fR" || { echo "cairn.1 lacks $words" >&2; exit 1; }
done

# Completion as bash does it:  complete WORDS...
complete() {
  bash -c ". '$folder/cairn.bash'; COMP_WORDS=(\"\$@\"); COMP_CWORD=\$((\$# - 1)); _cairn cairn \"\${@: -1}\"; echo \"\${COMPREPLY[*]}\"" - "$@"
}
expect() {
  [ "$1" = "$2" ] || { echo "completed to '$1', not '$2'" >&2; exit 1; }
}
expect "$(complete cairn localize --est)" --estimator
expect "$(complete cairn locali)" localize
expect "$(complete cairn plan lo)" locate
expect "$(complete cairn plan locate a.db --max-ran)" --max-range-m
