"""Drives of `cairn drive` and their records, for the benchmarks beside this file."""
import json
import math
import os
import subprocess
import sys
import tempfile


def survey_poses(path):
    """(x m, y m, heading degrees) by image name, from COLMAP's images.txt."""
    poses = {}
    for line in open(path):
        fields = line.split()
        if line.startswith("#") or len(fields) < 10:
            continue
        w, x, y, z, *t = map(float, fields[1:8])
        rotation = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
        centre = [-sum(rotation[r][c] * t[r] for r in range(3)) for c in range(2)]
        poses[fields[9]] = (*centre, math.degrees(math.atan2(rotation[2][1], rotation[2][0])))
    return poses


def drive(cairn, map_path, recipe, start, goal, seed, *options):
    """The record of a drive from start (x m, y m, heading degrees); None where it could not begin: in a wall."""
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "run.json")
        done = subprocess.run([cairn, "drive", map_path, "--building", recipe, "--goal", goal, "--seed", str(seed),
                               "--start", ",".join(f"{value:.3f}" for value in start), "-o", out, *options],
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if os.path.exists(out):
            return json.load(open(out))
        if "no place to stand" in done.stderr:
            return None
        sys.exit(done.stderr)


def has_arrived(run):
    """At the goal, by truth as well as by what the robot says."""
    return run["reached"] and run["goal_error_m"] < 0.3 and run["goal_error_deg"] < 10
