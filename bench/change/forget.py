#!/usr/bin/env python3
"""A place changes between two surveys: does what vanished leave the map, does what lives stay, and who is localized today?

usage: forget.py [--cairn PROGRAM] [--work FOLDER] [--size M,M,ROOMS] [SEED...]      (seeds 14 and 15)

Per seed a building is surveyed twice by other ways: old in full light, new in half of it after 30 % of its wall panels were exchanged
(changes.json is the truth).  Three maps are compiled with defaults: of the old survey, of the new, of both; the new survey's held-out images
try all three.  A class of the old survey has vanished if it lies within 3 cm of a panel that was exchanged; it lives if its descriptor's
patch (6 keypoint scales) does not reach one; the others, whose patch reaches over the edge, are counted apart.
Needs NumPy.  Twelve minutes a seed on two idle cores; what is there is not made again.
"""
import argparse
import json
import pathlib
import re
import sqlite3
import subprocess

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
SIGHTINGS = np.dtype([("expected", "<f4"), ("num_seen", "<i4"), ("there", "<f4")])
OBSERVATIONS = np.dtype([("image", "<u4"), ("keypoint", "<u4"), ("x", "<f4"), ("y", "<f4"), ("scale", "<f4"), ("orientation", "<f4")])
ON_SURFACE_M = 0.03
PATCH_SCALES = 6


def render(cairn, folder, size, seed, *options):
    width, depth, rooms = size.split(",")
    if not folder.exists():
        subprocess.run([cairn, "stage", "simulate", "--width-m", width, "--depth-m", depth, "--num-rooms", rooms, "--survey", "driven", "--seed",
                        str(seed), *map(str, options), "--progress", "none", "-o", folder], check=True, stdout=subprocess.DEVNULL)
    return folder


def compile_map(cairn, work, name, captures):
    recipe, map_file = work / f"{name}.toml", work / f"{name}.cairn"
    recipe.write_text(f'name = "{name}"\n' + "".join(f'[[capture]]\npath = "{capture}"\n' for capture in captures))
    if not map_file.exists():
        subprocess.run([cairn, "compile", recipe, "-o", map_file, "--progress", "none", "--log-level", "error"], check=True, stdout=subprocess.DEVNULL)
    return map_file


def tried(cairn, map_file, capture):
    text = subprocess.run([cairn, "check", map_file, "--queries", capture / "queries.txt", "--capture", capture, "--progress", "none"], check=True,
                          capture_output=True, text=True).stdout
    found = {key: re.search(rf"^{key} +(.*)$", text, re.M) for key in ("localized", "median error", "precision")}
    return [match.group(1) if match else "?" for match in found.values()]


def read_classes(path):
    """Per class of the old survey: its place, its patch's radius, P(there now), whether the new survey sees it."""
    database = sqlite3.connect(path)
    focal = {row[0]: np.frombuffer(row[1], "<f8")[0] for row in database.execute("SELECT camera_id, params FROM cameras")}
    centres = {}
    for image, camera, pose in database.execute("SELECT image_id, camera_id, refined FROM images"):
        w, x, y, z, *translation = np.frombuffer(pose, "<f8")
        rotation = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                             [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                             [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
        centres[image] = (-rotation.T @ np.array(translation), focal[camera])
    places, radii, presences, seen = [], [], [], []
    for table in ("classes", "vanished"):
        for place, observations, presence, sightings in database.execute(f"SELECT position, observations, presence, sightings FROM {table}"):
            sightings = np.frombuffer(sightings, SIGHTINGS)
            if sightings["num_seen"][0] == 0:
                continue
            place = np.frombuffer(place, "<f8")
            radii.append(np.median([PATCH_SCALES * o["scale"] * np.linalg.norm(place - centres[o["image"]][0]) / centres[o["image"]][1]
                                    for o in np.frombuffer(observations, OBSERVATIONS)]))
            places.append(place)
            presences.append(presence)
            seen.append(sightings["num_seen"][-1] > 0)
    return np.array(places), np.array(radii), np.array(presences), np.array(seen)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cairn", type=pathlib.Path, default=ROOT / "build/release/cairn")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "build/bench/change")
    parser.add_argument("--size", default="10,8,5", help="width and depth of the building, metres, and rooms [10,8,5]")
    parser.add_argument("seeds", nargs="*", type=int)
    arguments = parser.parse_args()
    cairn, work = arguments.cairn.resolve(), arguments.work.resolve()
    work.mkdir(parents=True, exist_ok=True)
    lines = []
    for seed in arguments.seeds or [14, 15]:
        old = render(cairn, work / f"old{seed}", arguments.size, seed, "--num-queries", 0)
        new = render(cairn, work / f"new{seed}", arguments.size, seed, "--num-queries", 90, "--run", 1, "--light-ratio", 0.5, "--change", 1)
        maps = {"both": [old, new], "old": [old], "new": [new]}
        maps = {name: compile_map(cairn, work, f"{name}{seed}", captures) for name, captures in maps.items()}
        places, radii, presences, seen = read_classes(work / f"both{seed}.build/classes.db")
        distances = np.full(len(places), np.inf)
        for surface in json.loads((new / "changes.json").read_text())["changed"]:
            low, high = np.array(surface["min"]), np.array(surface["max"])
            distances = np.minimum(distances, np.linalg.norm(np.maximum(0, np.maximum(low - places, places - high)), axis=1))
        vanished = distances < ON_SURFACE_M
        living = distances > np.maximum(radii, ON_SURFACE_M)
        dropped = presences < 0.5
        print(f"| {seed} | {vanished.sum():,} | {100 * dropped[vanished].mean():.1f} % | {living.sum():,} | {100 * seen[living].mean():.0f} % | "
              f"{100 * dropped[living].mean():.1f} % | {(~vanished & ~living).sum():,} | {100 * dropped[~vanished & ~living].mean():.0f} % |", flush=True)
        for name, map_file in maps.items():
            lines.append(f"| {seed} | {name} | " + " | ".join(tried(cairn, map_file, new)) + f" | {map_file.stat().st_size / 1000:.0f} |")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
