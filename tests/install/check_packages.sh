#!/bin/bash
# Makes releases, compares and verifies them, lets lintian judge the Debian packages, installs them in a fresh system, upgrades, uses and
# removes them:
#   check_packages.sh SOURCES FOLDER POSTER
# MIRROR=http://... names another mirror than Debian's own.  Where it is out of reach, the part in a fresh system is skipped.
set -euo pipefail
sources=$1 folder=$2 poster=$3
if [ "$(id -u)" != 0 ]; then
  echo "skipped: only root can make a fresh Debian system with debootstrap; run this test as root"
  exit 77
fi

rm -rf "$folder"  # what an earlier run compiled against other headers, too
mkdir -p "$folder"
folder=$(realpath "$folder")
fail() { echo "$*" >&2; exit 1; }

# The sources as they are, a repository of two commits.
snapshot() {  # FOLDER
  "$sources/scripts/copy_sources" "$1"
  git init -q "$1"
  commit() {
    GIT_AUTHOR_DATE=@1795824000 GIT_COMMITTER_DATE=@1795824000 git -C "$1" -c user.name=Test -c user.email=test@cairn.example commit -q "${@:2}"
  }
  git -C "$1" add -A
  commit "$1" -m "All before"
  commit "$1" --allow-empty -m "What is tested, and this line is so long that the changelog has to break it into two"
}
GNUPGHOME=$(mktemp -d)
export GNUPGHOME
trap 'gpgconf --kill all; rm -rf "$GNUPGHOME"' EXIT
gpg --batch --quiet --passphrase '' --quick-generate-key 'Test <test@cairn.example>' ed25519 sign never 2> /dev/null
key=$(gpg --batch --list-keys --with-colons 2> /dev/null | awk -F: '/^fpr/ {print $10; exit}')
maintainer='Some Body <somebody@cairn.example>'
release() {  # CHECKOUT FOLDER [VERSION]
  KEY=$key MAINTAINER=$maintainer "$1/scripts/make_release" "${@:2}" > "$folder/release.log" 2>&1 || { cat "$folder/release.log" >&2; exit 1; }
}

# Twice, with other folders, times, umasks and time zones: the same bytes, but of signatures and what names them.
snapshot "$folder/sources"
(umask 077 && snapshot "$folder/elsewhere/and/deeper")
version=$(cd "$sources" && dpkg-parsechangelog -S Version)
arch=$(dpkg --print-architecture)
release "$folder/sources" "$folder/first"
(umask 077 && TZ=Asia/Kathmandu release "$folder/elsewhere/and/deeper" "$folder/elsewhere/again")
num_same=0
for file in "$folder/first/apt"/*.{deb,tar.xz,json} "$folder/first/apt/Packages"; do
  cmp "$file" "$folder/elsewhere/again/apt/${file##*/}"
  num_same=$((num_same + 1))
done
unsigned() { sed '1,/^$/d; /^-----BEGIN PGP SIGNATURE/,$d' "$1"; }
cmp <(unsigned "$folder/first/apt/cairn_$version.dsc") <(unsigned "$folder/elsewhere/again/apt/cairn_$version.dsc")
((num_same == 7)) || fail "$num_same files were compared: four packages, source, bill of materials and apt's list were expected"
echo "$num_same files of two releases are the same"
"$sources/tests/install/check_spdx.py" "$folder/first/apt" "$version" "$arch"
(cd "$folder/first/apt" && sha256sum --quiet -c SHA256SUMS && gpg --batch --quiet --verify SHA256SUMS.asc SHA256SUMS 2> /dev/null &&
  gpg --batch --quiet --verify InRelease 2> /dev/null && gpg --batch --quiet --verify "cairn_$version.dsc" 2> /dev/null)
[[ $(dpkg-deb -f "$folder/first/apt/cairn_${version}_$arch.deb" Maintainer) == "$maintainer" ]]
# The source package has what the commit has, but what dpkg-source leaves out.
(cd "$folder" && dpkg-source --no-check -x "first/apt/cairn_$version.dsc" unpacked > /dev/null)
diff -r --exclude=.git --exclude=.gitignore --exclude=control "$folder/sources" "$folder/unpacked"
(($(diff "$folder/sources/debian/control" "$folder/unpacked/debian/control" | grep -c '^[<>]') == 2))  # its maintainer

# The next version has the words of the commits.
next=${version%.*}.$((${version##*.} + 1))
release "$folder/sources" "$folder/next" "$next"
changelog=$(dpkg-deb --fsys-tarfile "$folder/next/apt/libcairn-runtime0_${next}_$arch.deb" | tar -xO ./usr/share/doc/libcairn-runtime0/changelog.gz | gunzip)
grep -qx '  \* What is tested, and this line is so long that the changelog has to break' <<< "$changelog" || fail "the changelog lacks a commit: $(head -5 <<< "$changelog")"
grep -qx '    it into two' <<< "$changelog"
[[ $changelog == "cairn ($next) "* ]] || fail "the changelog begins with another version: $(head -1 <<< "$changelog")"

# What cannot be released is refused, and nothing is lost.
refused() {  # WORDS COMMAND...
  if "${@:2}" > "$folder/refused" 2>&1 || ! grep -q -- "$1" "$folder/refused"; then fail "not refused with '$1': $(cat "$folder/refused")"; fi
}
refused 'not newer' "$folder/sources/scripts/make_release" "$folder/first" 0.0.9
refused 'three numbers' "$folder/sources/scripts/make_release" "$folder/first" 1.0-rc
refused 'no such secret key' env KEY=0123456789ABCDEF "$folder/sources/scripts/make_release" "$folder/first"
refused 'NAME <MAIL>' env MAINTAINER=nobody "$folder/sources/scripts/make_release" "$folder/first"
refused 'something else' "$folder/sources/scripts/make_release" "$folder/unpacked"
refused 'no git checkout' "$folder/unpacked/scripts/make_release" "$folder/first"
echo >> "$folder/sources/README.md"
refused 'M README.md' "$folder/sources/scripts/make_release" "$folder/first"
[[ -e $folder/first/apt/InRelease ]]

cp "$folder/first/apt"/*.deb "$folder/first/$arch"/*.{changes,buildinfo} "$folder"
export LC_ALL=C DEBIAN_FRONTEND=noninteractive  # only now: what is compiled depends on the locale, and so ccache's keys
lintian --allow-root --fail-on warning "$folder"/*.changes

# What the -dev package says about itself, where Debian puts it: a C program by pkg-config, C and C++ by CMake.
root=$folder/root
for name in libcairn-runtime0 libcairn-runtime-dev; do dpkg-deb -x "$folder/${name}"_*.deb "$root"; done
lib=$(dirname "$root"/usr/lib/*/libcairn-runtime.so)
example=$sources/runtime/examples/robot
PKG_CONFIG_PATH=$lib/pkgconfig
export PKG_CONFIG_PATH
cc -std=c11 "$example/where.c" -o "$folder/where_c" $(pkg-config --cflags --libs cairn-runtime)
cmake -S "$example" -B "$folder/robot" -DCMAKE_PREFIX_PATH="$root/usr" -DCMAKE_BUILD_TYPE=Release > "$folder/robot.log"
cmake --build "$folder/robot" >> "$folder/robot.log" || { cat "$folder/robot.log" >&2; exit 1; }
for program in "$folder/where_c" "$folder/robot/where_c" "$folder/robot/where_cc"; do
  LD_LIBRARY_PATH=$lib "$program" "$poster/poster.cairn" "$poster/poster.pgm" | grep -q 'm, [0-9]* inliers' ||
    { echo "$program gives no fix" >&2; exit 1; }
done

mirror=${MIRROR:-http://deb.debian.org/debian}
wget -q --tries=2 --timeout=30 -O /dev/null "$mirror/dists/bookworm/Release" || {
  reached=$?
  ((reached == 4)) || fail "$mirror: no mirror of bookworm (wget: $reached)"
  echo "skipped, after the packages were made, compared and judged: $mirror is not in reach (network, proxy, or set MIRROR); a fresh system needs it"
  exit 77
}
system=$(mktemp -d)
trap 'gpgconf --kill all; rm -rf "$GNUPGHOME"; rm -rf --one-file-system "$system"' EXIT
debootstrap --variant=minbase bookworm "$system" "$mirror" > "$folder/debootstrap.log" 2>&1 ||
  { tail -5 "$folder/debootstrap.log" >&2; echo "debootstrap failed" >&2; exit 1; }
inside() { chroot "$system" "$@"; }

# Nothing of this outlives the test: no need to wait for the disk.
echo force-unsafe-io > "$system/etc/dpkg/dpkg.cfg.d/unsafe"
mkdir "$system/packages"
cp "$folder"/*.deb "$poster/poster.cairn" "$poster/poster.pgm" "$example/where.py" "$example/pgm.py" "$system/packages"
inside find / -xdev -path /packages -prune -o -path '*cairn*' -print > "$folder/before"

# A folder of a release, which apt reads and whose signature it checks.
chmod 755 "$system"
cp -r "$folder/first/apt" "$system/apt"
echo "deb [signed-by=/apt/cairn-archive-keyring.gpg] file:/apt ./" > "$system/etc/apt/sources.list.d/cairn.list"
update() { inside apt-get update -q -o APT::Update::Error-Mode=any > "$folder/update.log" 2>&1; }
sed -i 's/^Origin: cairn/Origin: crane/' "$system/apt/InRelease"
if update; then fail "apt takes a release that somebody changed"; fi
cp "$folder/first/apt/InRelease" "$system/apt"
update || { cat "$folder/update.log" >&2; exit 1; }

install() {  # names of packages
  inside apt-get install -y -q --no-install-recommends "$@" > "$folder/install.log" 2>&1 ||
    { tail -20 "$folder/install.log" >&2; exit 1; }
}

# A robot: the library and Python, without the compiler.
install libcairn-runtime0 python3-cairn
answer=$(inside python3 /packages/where.py /packages/poster.cairn /packages/poster.pgm)
echo "python3-cairn in a fresh system: $answer"
echo "$answer" | grep -q '^0\.[0-9]* 0\.[0-9]* 1\.[0-9]* m, [0-9]* inliers' || exit 1
inside dpkg-query -W -f '${Package}\n' > "$folder/robot_packages"
echo "$(wc -l < "$folder/robot_packages") packages on the robot"
if grep -E 'imgcodecs|colmap|ceres|geos|glpk|cbc|spdlog|toml' "$folder/robot_packages"; then
  echo "the runtime brought these, which no robot needs" >&2
  exit 1
fi

# Who makes maps.
install cairn libcairn-runtime-dev
inside cairn --version
inside cairn localize /packages/poster.cairn /packages/poster.pgm --log-level off | grep -q '"fix":true'
[[ $(inside cairn --version) == *"$version"* ]] || fail "not version $version: $(inside cairn --version)"
# The release after it takes its place, and reads its maps.
rm -r "$system/apt"
cp -r "$folder/next/apt" "$system/apt"
update || { cat "$folder/update.log" >&2; exit 1; }
inside apt-get upgrade -y -q > "$folder/upgrade.log" 2>&1 || { tail -20 "$folder/upgrade.log" >&2; exit 1; }
[[ $(inside cairn --version) == *"$next"* ]] || fail "not upgraded to $next: $(inside cairn --version)"
(($(inside dpkg-query -W -f '${Version}\n' cairn libcairn-runtime0 libcairn-runtime-dev python3-cairn | grep -cx "$next") == 4))
inside cairn localize /packages/poster.cairn /packages/poster.pgm --log-level off | grep -q '"fix":true'
echo "upgraded from $version to $next"
inside test -e /usr/share/man/man1/cairn-localize.1.gz -o -e /usr/share/man/man1/cairn-localize.1

# Films need FFmpeg, which is recommended: without it the program says what to install, and that is enough.
if inside dpkg-query -W -f '${Package}\n' | grep -E '^lib(av(format|codec|util)|swscale)'; then
  echo "FFmpeg's libraries came although nobody asked for films" >&2
  exit 1
fi
for library in libavformat libavcodec libavutil libswscale; do
  dpkg-deb -f "$folder"/cairn_*.deb Recommends | grep -q "$library" || { echo "cairn does not recommend $library" >&2; exit 1; }
done
# A program finds its own files by /proc, which is there for it alone.
inside_with_proc() { unshare --mount sh -c 'mount -t proc proc "$0/proc" && exec chroot "$0" "$@"' "$system" "$@"; }
import() { inside_with_proc cairn import /packages/walk.mp4 -o /packages/walk --keyframes all --progress none; }
if inside_with_proc true 2> /dev/null; then
  ffmpeg -v error -f lavfi -i testsrc=size=320x240:rate=10:duration=1 -c:v mpeg4 "$system/packages/walk.mp4"
  if import 2> "$folder/films"; then
    echo "a film was read without FFmpeg's libraries" >&2
    exit 1
  fi
  cat "$folder/films"
  said=$(sed -n 's/.*install them (Debian: apt install \(.*\))$/\1/p' "$folder/films")
  inside apt-get install -y -q --no-install-recommends $said > "$folder/install.log" 2>&1 ||
    { tail -20 "$folder/install.log" >&2; exit 1; }
  import
else
  echo "films were not tried: /proc cannot be mounted here"
fi

rm -r "$system/apt" "$system/etc/apt/sources.list.d/cairn.list"
inside apt-get purge -y -q cairn libcairn-runtime0 libcairn-runtime-dev python3-cairn > "$folder/purge.log" 2>&1 ||
  { tail -20 "$folder/purge.log" >&2; exit 1; }
inside find / -xdev -path /packages -prune -o -path /proc -prune -o -path '*cairn*' -print > "$folder/after"
if ! diff "$folder/before" "$folder/after"; then
  echo "these files stayed when the packages were removed" >&2
  exit 1
fi
