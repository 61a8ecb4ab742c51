#!/usr/bin/env python3
"""Compiles one survey by this machine's program and by that for 64-bit ARM, and localizes held-out images in both maps by both.

  same_maps.py CAIRN BUILD FOLDER      the program, the cross build, a folder that is made anew

Features, words, regions and links have the same bytes, matches are the same, and so is what a robot reads of the map.  What Eigen,
OpenCV or LAPACK compute in floating point may differ in its last bits, as they fuse products and sums on ARM: models of two views,
landmarks before they are rounded for the map, the map's own report about itself, a fix."""
import json
import os
import pathlib
import shutil
import sqlite3
import subprocess
import sys

# Of a fix; 2e-11 m were found, and a fix is off by millimetres.
MAX_DIFFERENCE_M = 1e-6

RECIPE = """name = "tiny"
[[capture]]
path = "survey"
[extract_features]
max_num_features = 300
[filter_visibility]
survey = "driven"
cell_size_m = 1
heading_bin_deg = 90
min_num_stations_driven = 2
[decompose_regions]
k = 4
tau = 0
[emit_map]
landmarks = "all"
"""
SURVEY = """width_m = 5.5
depth_m = 6
num_rooms = 2
spacing_m = 1
image_width_px = 320
image_height_px = 240
texel_m = 0.008
num_queries = 6
"""
SAME_FILES = ["features.db", "world.db", "regions.db", "vocabulary.db", "appearance.db"]


# Of a map: its signed hash, its report about itself, and the hashes of files that it was made from.
DIFFERENT_TABLES = {"seal", "self_test", "self_test_regions", "inputs"}


def rows_of_map(path):
    """The rows of each table that a robot reads."""
    with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as map:
        tables = [name for name, in map.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")]
        rows = {name: sorted(map.execute(f"SELECT * FROM {name}"), key=repr) for name in tables if name not in DIFFERENT_TABLES}
    rows["meta"] = [row for row in rows["meta"] if row[0] != "findings"]  # a hash of self_test
    return rows


def matches_of(path):
    with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as database:
        return [list(database.execute(query)) for query in
                ("SELECT pair_id, data FROM matches ORDER BY 1", "SELECT pair_id, config, data FROM two_view_geometries ORDER BY 1")]


def run(*words, path=None):
    environment = dict(os.environ, LC_ALL="C", PATH=(f"{path}:" if path else "") + os.environ["PATH"])
    said = subprocess.run(words, capture_output=True, text=True, env=environment)
    if said.returncode != 0:
        sys.exit(f"{' '.join(map(str, words))} ends with {said.returncode}:\n{said.stdout}{said.stderr}")
    return said.stdout


def distance(fix, other):
    return sum((a - b) ** 2 for a, b in zip(fix["center_m"], other["center_m"])) ** 0.5


def main():
    native, build, folder = sys.argv[1], pathlib.Path(sys.argv[2]).resolve(), pathlib.Path(sys.argv[3]).resolve()
    if not build.exists():
        print("skipped: nothing was built")
        sys.exit(77)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    os.chdir(folder)
    scripts = pathlib.Path(__file__).parent
    run(scripts / "write_program.sh", build, "bin")
    programs = {"x86-64": (native, None), "arm64": (str(folder / "bin/cairn"), folder / "bin")}
    pathlib.Path("survey.toml").write_text(SURVEY)
    pathlib.Path("tiny.toml").write_text(RECIPE)
    run(native, "stage", "simulate", "survey.toml", "-o", "survey", "--progress", "none")
    for name, (program, path) in programs.items():
        run(program, "compile", "tiny.toml", "-o", f"{name}.cairn", "--progress", "none", path=path)

    faults = []
    def bytes_of(name):
        return [pathlib.Path(f"{processor}{name}").read_bytes() for processor in programs]
    for file in SAME_FILES:
        first, second = bytes_of(f".build/{file}")
        if first != second:
            faults.append(f"{file} differs")
    if len({repr(matches_of(f"{processor}.build/matches.db")) for processor in programs}) > 1:
        faults.append("matches differ")
    rows, others = (rows_of_map(f"{processor}.cairn") for processor in programs)
    for table in sorted(rows.keys() | others.keys()):
        if rows.get(table) != others.get(table):
            faults.append(f"the maps' table {table} differs")
    first, second = bytes_of(".cairn")
    print(f"maps of {len(first):,} bytes:", "the same" if first == second else "the same but for their reports about themselves")

    lines = pathlib.Path("survey/queries.txt").read_text().splitlines()
    images = [f"survey/images/{line.split()[9]}" for line in lines if len(line.split()) == 10 and line[0] != "#"]
    answers = {}
    for processor, (program, path) in programs.items():
        for map in programs:
            said = run(program, "localize", f"{map}.cairn", *images, "--log-level", "off", path=path)
            answers[f"{map}'s map on {processor}"] = [json.loads(line) for line in said.splitlines()]
    expected = answers["x86-64's map on x86-64"]
    num_fixes = sum(fix["fix"] for fix in expected)
    if num_fixes < len(images) / 2:
        faults.append(f"only {num_fixes} of {len(images)} images are localized")
    for name, fixes in answers.items():
        if [fix["fix"] for fix in fixes] != [fix["fix"] for fix in expected]:
            faults.append(f"{name}: other images have a fix")
            continue
        pairs = [pair for pair in zip(fixes, expected) if pair[0]["fix"]]
        num_same = sum(json.dumps(fix) == json.dumps(other) for fix, other in pairs)
        largest = max(distance(fix, other) for fix, other in pairs)
        print(f"{name}: {len(pairs)} fixes, {num_same} of them equal to the last bit, largest difference {largest:.1e} m")
        if any(fix["num_inliers"] != other["num_inliers"] for fix, other in pairs):
            faults.append(f"{name}: other numbers of inliers")
        if largest > MAX_DIFFERENCE_M:
            faults.append(f"{name}: a fix is {largest} m off")
    sys.exit("\n".join(faults) if faults else 0)


if __name__ == "__main__":
    main()
