# Read by scripts that ask several programs the same: agree PROGRAM SAID ends with 1 where a program says something else
# than the first did, which is left in $first and printed.
first=
agree() {
  if [ -z "$first" ]; then
    first=$2
    echo "$2"
  elif [ "$2" != "$first" ]; then
    echo "$1 says something else: $2" >&2
    exit 1
  fi
}
