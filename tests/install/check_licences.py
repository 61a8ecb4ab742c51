#!/usr/bin/env python3
"""Reads the licences of the Debian packages whose libraries a program or library of this build loads, and fails on one under which
a binary may not be given away together with GPL parts, as Ceres' SuiteSparse and FFmpeg are in Debian.

  check_licences.py BINARY...

What packages state is of their sources: documentation, tests and build scripts too.  JUDGED names those that were read, and why what
is loaded is no conflict."""
import os
import re
import subprocess
import sys

# Of a licence's short name, or of a text where there are no short names.
CONFLICT = re.compile(r"\b(EPL|CDDL|CPL|QPL|SSPL|NPL|Apache-1|MPL-1|BSD-4|(?<!~)OpenSSL|SSLeay|CeCILL-[BC]|CC-BY-NC|GPL-2(\.0)?(-only)?(?![\w.+-]))")
CONFLICT_IN_TEXT = re.compile(r"Eclipse Public|Common Public License|Common Development and Distribution|Mozilla Public License,? [Vv]ersion 1|non-?commercial use only")

JUDGED = {
    "libblkid1": "programs; libblkid is LGPL-2.1+",
    "libbsd0": "a manual page",
    "libcom-err2": "programs and libext2fs; lib/et, which is the library, is MIT's",
    "libcurl3-gnutls": "a server of its tests",
    "libcurl4": "a server of its tests",
    "libde265-0": "getopt of its examples",
    "libgdcm3.0": "getopt of its programs",
    "libgeotiff5": "getopt of its programs",
    "libheif1": "getopt of its examples",
    "libldap-2.5-0": "a header of the University of California, which has withdrawn the fourth clause",
    "liblzma5": "Doxygen's settings",
    "libmariadb3": "the server; libmariadb, which is the client's library, is LGPL-2.1+",
    "libmount1": "programs; libmount is LGPL-2.1+",
    "libnorm1": "simulators of networks",
    "libsasl2-2": "an acknowledgement that Carnegie Mellon asks for, and a shim for old OpenSSL, which Debian's does not need; "
                  "in Debian's GPL programs too; nothing of it is in cairn's packages",
    "libspatialite7": "a header of its tests for Windows",
    "libtirpc3": "the client of encrypting RPC; nothing of it is in cairn's packages",
    "libuuid1": "programs; libuuid is BSD-3-clause",
    "libxxhash0": "the program xxhsum",
    "libzvbi0": "two files of GPL-2 alone, which Debian's FFmpeg loads, and film.so by that: it may be left out (docs/licences.md)",
}


def libraries_of(binary):
    said = subprocess.run(["ldd", binary], capture_output=True, text=True, check=True).stdout
    missing = re.findall(r"(\S+) => not found", said)
    if missing:
        sys.exit(f"{binary}: {', '.join(missing)} not found")
    return re.findall(r"=> (/\S+)", said)


def packages_of(libraries):
    """The package of each; none where it is of none."""
    # As the package has it, before folders of the root became links.
    names = {library: (real, real.removeprefix("/usr"), library) for library in libraries for real in [os.path.realpath(library)]}
    found = subprocess.run(["dpkg-query", "-S", *{name for of_one in names.values() for name in of_one}], capture_output=True, text=True)
    owners = {line.split(": ", 1)[1]: line.split(":")[0] for line in found.stdout.splitlines()}
    return {library: next((owners[name] for name in of_one if name in owners), None) for library, of_one in names.items()}


def conflicts_of(package):
    """Licences of its sources, but of Debian's own files, that conflict."""
    with open(f"/usr/share/doc/{package}/copyright", errors="replace") as file:
        text = file.read()
    if not text.lstrip().startswith("Format"):
        return sorted(set(CONFLICT_IN_TEXT.findall(text)))
    found = set()
    for paragraph in re.split(r"\n\s*\n", text):
        files = re.search(r"^Files:((?:.|\n )*)", paragraph, re.M)
        licence = re.search(r"^License:[ \t]*(\S.*)", paragraph, re.M)
        if not files or not licence or all(name.startswith("debian/") for name in files[1].split()):
            continue
        # A choice among licences is none where one of them is no conflict.
        for part in re.split(r"\band\b|,", licence[1], flags=re.I):
            choices = re.split(r"\bor\b|\|", part, flags=re.I)
            if all(CONFLICT.search(choice) for choice in choices):
                found.add(licence[1].strip())
    return sorted(found)


def main():
    own = {os.path.realpath(binary) for binary in sys.argv[1:]}
    loaded = {}  # library: by which binaries
    for binary in sys.argv[1:]:
        for library in libraries_of(binary):
            if os.path.realpath(library) not in own:
                loaded.setdefault(library, set()).add(os.path.basename(binary))
    packages = {}  # package: the same
    for library, package in packages_of(loaded).items():
        if package is None:
            sys.exit(f"{library}, which {', '.join(sorted(loaded[library]))} loads, is of no package: what is its licence?")
        packages.setdefault(package, set()).update(loaded[library])
    num_faults = 0
    for package in sorted(packages):
        conflicts = conflicts_of(package)
        if conflicts and package not in JUDGED:
            print(f"{package}, which {', '.join(sorted(packages[package]))} loads: {'; '.join(conflicts)}")
            num_faults += 1
    print(f"{len(packages)} packages, {num_faults} faults")
    return 1 if num_faults else 0


if __name__ == "__main__":
    sys.exit(main())
