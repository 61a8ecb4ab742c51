#!/usr/bin/env python3
"""How soon, and how surely, does a robot know where it woke up?

usage: where.py [--cairn PROGRAM] [--pieces N] [--length FRAMES] [--metres M] [--odometry] [--told] MAP=CAPTURE[:LIST]... [MAP=FOLDER:other]...

A capture's images in their order (LIST: images.txt, the default, or queries.txt; poses are truth) are cut into pieces of consecutive
frames, at random places by a fixed seed, and shown to `cairn where` one after the other: before each piece the robot was carried away,
of which it knows nothing; with --told each piece is a robot that wakes up.
A place is right within M metres and 60 degrees of the truth, or, where no survey image is, no farther than twice the nearest.  With --odometry the robot is told how it drove from frame to frame, by the truth with 5 % of the way
and of the turn as noise, but not that it was carried (the world's z is up).  Counts pieces whose right place leads and has 0.9, 0.99 within so many frames,
and frames at which a wrong place had that much.  `other`: a folder of images of another building, whole and in order: every place is
wrong.  Kidnaps of one run share a belief and are not independent of the map; intervals are Wilson's, as if they were.
"""
import argparse
import json
import math
import pathlib
import random
import subprocess
import tempfile

SUFFIXES = {".jpg", ".jpeg", ".png", ".pgm"}


def read_poses(path):
    """name: w, x, y, z, tx, ty, tz of cam_from_world"""
    poses = {}
    for line in path.read_text().splitlines():
        fields = line.split()
        if len(fields) == 10 and fields[0] != "#":
            poses[fields[9]] = [float(value) for value in fields[1:8]]
    return poses


def center(pose):
    w, x, y, z = pose[:4]
    rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
    return [-sum(rows[k][i] * pose[4 + k] for k in range(3)) for i in range(3)]


def map_poses(cairn, map_path):
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([cairn, "export", map_path, "--text", "-o", f"{folder}/model", "--progress", "none"], check=True, capture_output=True)
        return read_poses(next(pathlib.Path(folder).rglob("images.txt")))


def ahead_of(pose):
    """Where a camera looks, over the floor: radians from +x."""
    w, x, y, z = pose[:4]  # the third row of the rotation
    return math.atan2(2 * (y * z + w * x), 2 * (x * z - w * y))


def driven(before, after, generator, noise=0.05):
    """Metres ahead and to the left, degrees to the left, with noise."""
    way = [b - a for a, b in zip(center(before), center(after))]
    heading = ahead_of(before)
    ahead = way[0] * math.cos(heading) + way[1] * math.sin(heading)
    left = way[1] * math.cos(heading) - way[0] * math.sin(heading)
    turn = math.degrees(math.remainder(ahead_of(after) - heading, 2 * math.pi))
    return [value * (1 + generator.gauss(0, noise)) for value in (ahead, left, turn)]


def places_of(cairn, map_path, images, odometry=()):
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as wheels:
        wheels.write("".join("{:.4f} {:.4f} {:.3f}\n".format(*step) for step in odometry))
        wheels.flush()
        answer = subprocess.run([cairn, "where", map_path, "-", "--json", "--progress", "none"] +
                                (["--odometry", wheels.name] if odometry else []),
                                input="".join(f"{image}\n" for image in images), capture_output=True, text=True, check=True)
    return [json.loads(line) for line in answer.stdout.splitlines()]


def wilson(num_right, num):
    z, share = 1.96, num_right / num
    middle = (share + z * z / (2 * num)) / (1 + z * z / num)
    half = z * math.sqrt(share * (1 - share) / num + z * z / (4 * num * num)) / (1 + z * z / num)
    return f"{100 * (middle - half):.1f} to {100 * (middle + half):.1f} %"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cairn", default="build/release/cairn")
    parser.add_argument("--pieces", type=int, default=40)
    parser.add_argument("--length", type=int, default=10)
    parser.add_argument("--metres", type=float, default=2.0)
    parser.add_argument("--odometry", action="store_true")
    parser.add_argument("--told", action="store_true")
    parser.add_argument("runs", nargs="+")
    arguments = parser.parse_args()
    print("| map | images | frames | kidnaps | leads after 3 | 0.9 after 3 | 0.99 after 10 | frames with a wrong place above 0.9 | above 0.99 |")
    print("|---|---|---|---|---|---|---|---|---|", flush=True)
    sums = [0] * 7
    for run in arguments.runs:
        map_path, _, folder = run.partition("=")
        folder, _, listed = folder.partition(":")
        folder = pathlib.Path(folder)
        if listed == "other":
            steps = places_of(arguments.cairn, map_path, sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES))
            tops = [step["places"][0]["probability"] for step in steps]
            print(f"| {map_path} | {folder}, another building | {len(steps)} | | | | | {sum(p >= 0.9 for p in tops)} | {sum(p >= 0.99 for p in tops)} |",
                  flush=True)
            continue
        truth = read_poses(folder / (listed or "images.txt"))
        known = map_poses(arguments.cairn, map_path)
        names = sorted(truth)
        generator = random.Random(1)
        pieces = []
        for _ in range(arguments.pieces):
            start = generator.randrange(max(1, len(names) - arguments.length + 1))
            pieces.append(names[start:start + arguments.length])
        wheels = [step for piece in pieces
                  for step in [[0, 0, 0]] + [driven(truth[a], truth[b], generator) for a, b in zip(piece, piece[1:])]]
        # One sequence, or each piece for itself.
        steps, num_driven = [], 0
        for shown in pieces if arguments.told else [[name for piece in pieces for name in piece]]:
            odometry = wheels[num_driven:num_driven + len(shown)] if arguments.odometry else ()
            steps += places_of(arguments.cairn, map_path, [folder / "images" / name for name in shown], odometry)
            num_driven += len(shown)

        def apart(a, b):
            return math.dist(center(a), center(b)), 2 * math.degrees(math.acos(min(1, abs(sum(x * y for x, y in zip(a[:4], b[:4]))))))

        def is_within(a, b):
            metres, degrees = apart(a, b)
            return metres <= arguments.metres and degrees <= 60

        # Where the survey has no image within these, a place is right that is no farther than twice the nearest.
        def far_from(a, b):
            metres, degrees = apart(a, b)
            return math.hypot(metres / arguments.metres, degrees / 60)

        has_place = {name: any(is_within(truth[name], pose) for pose in known.values()) for name in names}
        nearest = {name: min(far_from(truth[name], pose) for pose in known.values()) for name in names if not has_place[name]}

        def is_right(step, name):
            place = known[step["places"][0]["image"]]
            if has_place[name]:
                return is_within(truth[name], place)
            return far_from(truth[name], place) <= 2 * nearest[name]

        leads = early = late = wrong90 = wrong99 = 0
        position = 0
        for piece in pieces:
            marks = []
            for name in piece:
                step = steps[position]
                position += 1
                marks.append((is_right(step, name), step["places"][0]["probability"], step["elsewhere"]))
            leads += any(right and p > gone for right, p, gone in marks[:3])
            early += any(right and p >= 0.9 for right, p, _ in marks[:3])
            late += any(right and p >= 0.99 for right, p, _ in marks[:10])
            wrong90 += sum(not right and p >= 0.9 for right, p, _ in marks)
            wrong99 += sum(not right and p >= 0.99 for right, p, _ in marks)
        row = [len(steps), len(pieces), leads, early, late, wrong90, wrong99]
        sums = [a + b for a, b in zip(sums, row)]
        print(f"| {map_path} | {folder} | " + " | ".join(str(value) for value in row) + " |", flush=True)
    if sums[1]:
        print("| all that have poses | | " + " | ".join(str(value) for value in sums) + " |")
        print(f"| 95 % | | | | {wilson(sums[2], sums[1])} | {wilson(sums[3], sums[1])} | {wilson(sums[4], sums[1])} | "
              f"{wilson(sums[5], sums[0])} | {wilson(sums[6], sums[0])} |")


if __name__ == "__main__":
    main()
