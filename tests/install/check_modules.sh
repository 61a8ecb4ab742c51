#!/bin/sh
# The program's modules in an installed tree: FFmpeg's libraries are loaded with the first film and not before, OpenCV's codecs
# with the first image file, from the program's own folder alone, and where something is missing a sentence says so:
#   check_modules.sh BUILD
set -eu
build=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export LC_ALL=C
fail() { echo "$1" >&2; exit 1; }

DESTDIR=$folder/root cmake --install "$build" --prefix /opt/cairn --component program > "$folder/log"
root=$folder/root/opt/cairn program=$folder/root/opt/cairn/bin/cairn module=$folder/root/opt/cairn/lib/cairn/film.so
ffmpeg -v error -f lavfi -i testsrc=size=320x240:rate=10:duration=1 -c:v mpeg4 "$folder/walk.mp4"

# Where nobody asked for it a module is not looked for: the working directory, beside the link that the program is started
# by, where the environment points to.
trap_folder=$folder/trap
mkdir -p "$trap_folder/lib/cairn" "$folder/lib/cairn"
for place in "$trap_folder" "$trap_folder/lib" "$trap_folder/lib/cairn" "$folder/lib/cairn"; do echo trap > "$place/film.so"; done
ln -s "$program" "$trap_folder/cairn"
cd "$trap_folder"
import() {
  rm -rf "$folder/walk"
  LD_LIBRARY_PATH=$trap_folder:$trap_folder/lib/cairn ./cairn import "$1" -o "$folder/walk" --keyframes all --progress none
}
import "$folder/walk.mp4"
[ "$(ls "$folder/walk/images" | wc -l)" = 10 ] || fail "an installed program does not import a film whole"

# FFmpeg comes with the first film.
ffmpeg_libraries='libav(format|codec|util)|libsw'
if ldd "$program" | grep -E "$ffmpeg_libraries"; then fail "the program loads these at each start, films or not"; fi
loaded() { LD_DEBUG=files import "$1" 2>&1 | grep -cE "calling init: .*($ffmpeg_libraries|film\.so)" || true; }
[ "$(loaded "$folder/none.mp4")" = 0 ] || fail "FFmpeg is loaded although there is no film"
[ "$(loaded "$folder/walk.mp4")" -gt 4 ] || fail "LD_DEBUG does not show FFmpeg's libraries any more"

# The module: one name goes out, of cairn's libraries nothing comes in, and it is as protected as the program.
protection() { { readelf -lW "$1" | grep -oE 'GNU_RELRO|GNU_STACK.* RWE?'; readelf -d "$1" | grep -oE 'BIND_NOW'; } | awk '{print $1, $NF}' | sort; }
links() {  # NAME LIBRARIES
  so=$root/lib/cairn/$1.so
  exported=$(nm -D --defined-only "$so" | awk '{print $3}')
  [ "$exported" = "cairn_$1_module" ] || fail "$so exports $exported"
  foreign=$(readelf -d "$so" | sed -n 's/.*NEEDED.*\[\(.*\)\]/\1/p' |
    grep -vE "^($2|libopencv_core|libstdc\+\+|libm|libgcc_s|libc|ld-linux.*)\.so\." || true)
  [ -z "$foreign" ] || fail "$so needs $foreign"
  if readelf -d "$so" | grep -E 'RPATH|RUNPATH'; then fail "$so says where libraries are to be looked for"; fi
  [ "$(protection "$so")" = "$(protection "$program")" ] || fail "$so is protected otherwise than the program"
}
links film 'libav(format|codec|util)|libswscale|libopencv_imgproc|libfmt'
links images libopencv_imgcodecs

# refused CODE WORDS: the import fails so, and says what to do; all else works.
refused() {
  code=0
  import "$folder/walk.mp4" 2> "$folder/err" || code=$?
  cat "$folder/err" >&2
  [ "$code" = "$1" ] || fail "the exit code is $code, expected $1"
  grep -q "walk.mp4: films cannot be read here: .*$2" "$folder/err" || fail "it does not say: $2"
  ./cairn --version > /dev/null
}
mv "$module" "$folder/film.so"
refused 3 'bin/cairn: lib/cairn/film.so is neither beside it nor one folder up; install the program again'
sed 's/libavformat\.so\./libavfarmat.so./g' "$folder/film.so" > "$module"
refused 3 'lib/cairn/film.so: needs FFmpeg.s libraries (libavfarmat.so.*); install them (Debian: apt install libavformat'
version=$(grep -aoE '[0-9.]+-[0-9a-f]{16}' "$folder/film.so")
sed "s/$version/0.0.9-0123456789abcdef/" "$folder/film.so" > "$module"
refused 5 "lib/cairn/film.so: is of cairn 0.0.9-0123456789abcdef, but the program is $version; install both of one build"
mv "$folder/film.so" "$module"

# OpenCV's codecs load 140 libraries: only who reads or writes an image file waits for them.
if ldd "$program" | grep -E 'imgcodecs|gdal'; then fail "the program loads these at each start, images or not"; fi
extract() { ./cairn stage extract-features "$folder/walk" -o "$folder/walk.db" --progress none "$@"; }
import "$folder/walk.mp4"
echo "1 SIMPLE_PINHOLE 320 240 384 160 120" > "$folder/walk/cameras.txt"  # with poses, so that no image says how large it is
for image in $(ls "$folder/walk/images"); do printf '%s 1 0 0 0 0 0 0 1 %s\n\n' "$((id = ${id:-0} + 1))" "$image"; done > "$folder/walk/images.txt"
extract --no-reuse
codecs() { LD_DEBUG=files "$@" 2>&1 | grep -cE 'calling init: .*(imgcodecs|images\.so)' || true; }
[ "$(codecs extract --no-reuse)" = 2 ] || fail "LD_DEBUG does not show OpenCV's codecs any more"
[ "$(codecs ./cairn stage build-vocabulary "$folder/walk.db" -o "$folder/words.db" --progress none)" = 0 ] ||
  fail "OpenCV's codecs are loaded although no image is decoded"
mv "$root/lib/cairn/images.so" "$folder"
code=0
extract --no-reuse 2> "$folder/err" || code=$?
cat "$folder/err" >&2
[ $code = 3 ] || fail "without images.so the exit code is $code"
grep -q 'image files cannot be read and written here: .*lib/cairn/images.so is neither beside it nor one folder up' "$folder/err" ||
  fail "it does not say what is missing"
mv "$folder/images.so" "$root/lib/cairn"
echo "$root: image files and films are read, and neither FFmpeg nor codecs are loaded without one"
