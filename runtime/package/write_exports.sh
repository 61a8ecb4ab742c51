#!/bin/sh
# Writes the shared library's version script:  write_exports.sh C_SYMBOLS CXX_NODE HEADERS ARCHIVE...
#
# C_SYMBOLS is the version script of the C API, by hand and append-only.  To it comes a node for C++: of all that the
# archives define in namespace cairn, what one of the public headers (HEADERS: a file that lists them) names.  Everything
# else stays inside of the library.  The node's name changes with every release, since the C++ API makes no promise across
# them: a program built with another release's headers is refused by the loader, and does not crash later.
set -eu
c_symbols=$1 node=$2 headers=$3
shift 3

cat "$c_symbols"
echo "$node {"
echo "  global:"
{
  # Lines of "=word", one per identifier of the public headers.
  xargs cat < "$headers" | grep -v '^ *//' | grep -oE '[A-Za-z_][A-Za-z_0-9]*' | LC_ALL=C sort -u | sed 's/^/=/'
  # Lines of "asMANGLED demangled" (c++filt leaves words alone that do not begin as its own do).  Inline functions and templates (W) are in whatever uses them.
  nm --defined-only --extern-only "$@" | awk 'NF == 3 && $2 ~ /^[TDRBV]$/ && $3 ~ /^_Z/ {print "as" $3, $3}' | LC_ALL=C sort -u | c++filt
} | awk '
  /^=/ {named[substr($0, 2)] = 1; next}
  {
    name = substr($0, length($1) + 2)
    sub(/^(vtable|typeinfo|typeinfo name) for /, "", name)
    if (name !~ /^cairn::/ || name ~ /anonymous namespace/) next
    gsub(/\[abi:[a-z0-9]*\]/, "", name)
    sub(/\(.*/, "", name)
    count = split(name, parts, "::")
    for (i = 2; i <= count; ++i) {
      part = parts[i]
      sub(/^~/, "", part)
      sub(/^operator[^A-Za-z_].*/, "operator", part)
      if (!(part in named)) next
    }
    print "    " substr($1, 3) ";"
  }'
echo "  local:"
echo "    *;"
echo "};"
