#!/usr/bin/env python3
"""Is a fix right as often as it says?

usage: probability.py [--cairn PROGRAM] MAP=IMAGES[:KIND]...

Localizes images in maps by `cairn localize` with its defaults, and counts how many fixes of about the same P(right) are right.  IMAGES is
a capture with a queries.txt of true poses (KIND truth, the default: right within 25 cm and 10 degrees), or a folder of images of
the map's own place without poses (own: every fix counts as right) or of a place that the map does not show (other: every fix is wrong).
Prints a line for each pair, and the reliability curve of all with 95 % intervals (Wilson) as if images were independent.
"""
import argparse
import json
import math
import pathlib
import subprocess

EDGES = [0.5, 0.7, 0.9, 0.99, 1.0001]
MAX_ERROR_M = 0.25
MIN_COS_HALF = math.cos(math.radians(10) / 2)
SUFFIXES = {".jpg", ".jpeg", ".png", ".pgm"}


def true_poses(capture):
    """name: rotation (w, x, y, z), translation of cam_from_world"""
    poses = {}
    for line in (capture / "queries.txt").read_text().splitlines():
        fields = line.split()
        if len(fields) == 10 and fields[0] != "#":
            poses[fields[9]] = [float(value) for value in fields[1:8]]
    return poses


def center(q, t):
    w, x, y, z = q
    rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
    return [-sum(rows[k][i] * t[k] for k in range(3)) for i in range(3)]


def is_right(found, pose):
    away = math.dist(found["center_m"], center(pose[:4], pose[4:]))
    turn = abs(sum(a * b for a, b in zip(found["rotation_wxyz"], pose[:4])))
    return away <= MAX_ERROR_M and turn >= MIN_COS_HALF


def outcomes(cairn, map_path, folder, kind):
    """How many images were tried, and of each fix its probability and whether it is right."""
    poses = true_poses(folder) if kind == "truth" else {}
    names = sorted(poses) or sorted(path.name for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    images = folder / "images" if poses else folder
    answer = subprocess.run([cairn, "localize", map_path, "-", "--progress", "none"],
                            input="".join(f"{images / name}\n" for name in names), capture_output=True, text=True, check=True)
    found = [json.loads(line) for line in answer.stdout.splitlines()]
    return len(names), [(fix["probability"], is_right(fix, poses[pathlib.Path(fix["image"]).name]) if poses else kind == "own")
                        for fix in found if fix["fix"]]


def wilson(num_right, num):
    z, share = 1.96, num_right / num
    middle = (share + z * z / (2 * num)) / (1 + z * z / num)
    half = z * math.sqrt(share * (1 - share) / num + z * z / (4 * num * num)) / (1 + z * z / num)
    return middle - half, middle + half


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cairn", default="build/release/cairn")
    parser.add_argument("pairs", nargs="+", metavar="MAP=IMAGES[:KIND]")
    arguments = parser.parse_args()
    everything = []
    print("| map | images | fixes | right | wrong | wrong of 0.9 or more | of 0.99 | right below 0.9 |\n|---|---|---|---|---|---|---|---|")
    for pair in arguments.pairs:
        map_path, _, images = pair.partition("=")
        images, _, kind = images.partition(":")
        num, fixes = outcomes(arguments.cairn, map_path, pathlib.Path(images), kind or "truth")
        everything += fixes
        wrong = [probability for probability, right in fixes if not right]
        print(f"| {map_path} | {num} of {images} | {len(fixes)} | {len(fixes) - len(wrong)} | {len(wrong)} | "
              f"{sum(p >= 0.9 for p in wrong)} | {sum(p >= 0.99 for p in wrong)} | {sum(p < 0.9 for p, right in fixes if right)} |", flush=True)
    print("\n| P(right) | fixes | mean P | right | 95 % |\n|---|---|---|---|---|")
    for low, high in zip(EDGES, EDGES[1:]):
        part = [(p, right) for p, right in everything if low <= p < high]
        if part:
            num_right = sum(right for _, right in part)
            low95, high95 = wilson(num_right, len(part))
            print(f"| {low:g} to {min(1, high):g} | {len(part)} | {100 * sum(p for p, _ in part) / len(part):.1f} % | "
                  f"{num_right}, {100 * num_right / len(part):.1f} % | {100 * low95:.1f} to {100 * high95:.1f} % |")


if __name__ == "__main__":
    main()
