#!/bin/sh
# Every subcommand has a page, and every option of --help stands in it:  check_manual.sh PROGRAM FOLDER
set -eu
program=$1 folder=$2
for page in "$folder"/man1/cairn-*.1; do
  command=$(basename "$page" .1)
  command=${command#cairn-}
  warnings=$(man --warnings -E UTF-8 -l -Tutf8 "$page" 2>&1 > /dev/null || true)
  if [ -n "$warnings" ]; then
    echo "$page: $warnings" >&2
    exit 1
  fi
  for option in $("$program" "$command" --help | grep -oE '^ +(-[a-z],)?--[a-z0-9-]+' | grep -oE -- '--.*'); do
    if ! sed 's/\\-/-/g' "$page" | grep -qF -- "$option"; then
      echo "$page does not have $option" >&2
      exit 1
    fi
    grep -qF -- "$option" "$folder/cairn.bash" || { echo "no completion for $command $option" >&2; exit 1; }
  done
  sed 's/\\-/-/g' "$folder/man1/cairn.1" | grep -q "^.fB$command.fR" || { echo "cairn.1 lacks $command" >&2; exit 1; }
done

# Completion as bash does it.
completed=$(bash -c ". '$folder/cairn.bash'; COMP_WORDS=(cairn localize --est); COMP_CWORD=2; _cairn cairn --est localize
  echo \"\${COMPREPLY[*]}\"")
[ "$completed" = --estimator ] || { echo "cairn localize --est completes to '$completed'" >&2; exit 1; }
completed=$(bash -c ". '$folder/cairn.bash'; COMP_WORDS=(cairn locali); COMP_CWORD=1; _cairn cairn locali cairn
  echo \"\${COMPREPLY[*]}\"")
[ "$completed" = localize ] || { echo "cairn locali completes to '$completed'" >&2; exit 1; }
