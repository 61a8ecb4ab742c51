#!/usr/bin/env python3
"""Checks a release's bill of materials against the release:  check_spdx.py FOLDER VERSION ARCH"""
import glob
import hashlib
import json
import os
import re
import sys

folder, version, arch = sys.argv[1:]
with open(f"{folder}/cairn_{version}_{arch}.spdx.json") as file:
    document = json.load(file)


def expect(holds, what):
    if not holds:
        sys.exit(f"{file.name}: {what}")


# What SPDX 2.3 demands.
expect(document["spdxVersion"] == "SPDX-2.3" and document["dataLicense"] == "CC0-1.0", "not SPDX 2.3")
expect(re.fullmatch(r"\d{4}(-\d\d){2}T(\d\d:){2}\d\dZ", document["creationInfo"]["created"]), "no date of creation")
expect(all(re.match(r"(Tool|Organization|Person): ", creator) for creator in document["creationInfo"]["creators"]), "creators")
expect(re.match(r"https://\S+$", document["documentNamespace"]), "no namespace")
packages = {package["SPDXID"]: package for package in document["packages"]}
expect(len(packages) == len(document["packages"]), "an id stands for two packages")
for name, package in packages.items():
    expect(re.fullmatch(r"SPDXRef-[A-Za-z0-9.-]+", name), f"{name} is no id")
    expect(all(package.get(key) for key in ("name", "versionInfo", "downloadLocation", "licenseConcluded", "licenseDeclared")), f"{name} is not whole")
relations = {(of["spdxElementId"], of["relationshipType"], of["relatedSpdxElement"]) for of in document["relationships"]}
for of, kind, to in relations:
    expect(of in packages or of == "SPDXRef-DOCUMENT", f"{of}, which {kind} {to}, is unknown")
    expect(to in packages, f"{to}, which {of} {kind}, is unknown")

# What is in the folder.
files = {package["packageFileName"]: package for package in packages.values() if "packageFileName" in package}
there = {os.path.basename(path) for path in glob.glob(f"{folder}/*_{arch}.deb") + glob.glob(f"{folder}/*.tar.xz")}
expect(set(files) == there, f"describes {sorted(files)}, there are {sorted(there)}")
for name, package in files.items():
    with open(f"{folder}/{name}", "rb") as deb:
        expect(package["checksums"] == [{"algorithm": "SHA256", "checksumValue": hashlib.sha256(deb.read()).hexdigest()}], f"the hash of {name}")
    expect(("SPDXRef-DOCUMENT", "DESCRIBES", package["SPDXID"]) in relations, f"{name} is not described")


def all_that(name):
    found, todo = set(), [name]
    while todo:
        of = todo.pop()
        more = {to for by, kind, to in relations if by == of and kind == "DEPENDS_ON"} - found
        found |= more
        todo += more
    return {packages[of]["name"] for of in found}


program, runtime = all_that("SPDXRef-cairn"), all_that("SPDXRef-libcairn-runtime0")
expect({"libglpk40", "libcholmod3", "libc6"} <= program, "the program does not need what it links")
expect({"libsqlite3-0", "libopencv-core406", "libc6"} <= runtime, "the runtime does not need what it links")
expect(not {"libglpk40", "libcholmod3"} & runtime, "the runtime needs what it does not link")
expect(packages["SPDXRef-cairn"]["licenseConcluded"] == "GPL-3.0-or-later", "the program's licence")
expect(packages["SPDXRef-libcairn-runtime0"]["licenseConcluded"] == "Apache-2.0", "the runtime's licence")
films = {packages[of]["name"] for of, kind, to in relations if kind == "OPTIONAL_DEPENDENCY_OF" and to == "SPDXRef-cairn"}
expect("libavformat59" in films and "libavformat59" not in program, "films are optional")
within = {(packages[of]["name"], kind, packages[to]["name"]) for of, kind, to in relations if of in packages}
expect({("cairn", "STATIC_LINK", "libceres-dev"), ("cairn", "CONTAINS", "libjs-leaflet")} <= within, "the program has what is compiled in")
stated = [package for package in packages.values() if package["SPDXID"].startswith("SPDXRef-deb-") and "licenseComments" in package]
print(f"{len(packages)} packages, {len(relations)} relations, licences stated of {len(stated)}; {len(program)} behind the program, {len(runtime)} behind the runtime")
