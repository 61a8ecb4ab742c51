#!/usr/bin/env python3
"""What odometry is worth to a camera that is followed: where is it while it is dark, and how soon is it found again?

usage: dark.py [--cairn PROGRAM] [--lit N] [--dark N] [--noise RATIO] [--size W H] [--seed N] MAP=CAPTURE[:LIST]...

A capture's images in their order (LIST: images.txt, the default, or queries.txt; poses are truth, the world's z is up) are shown to
`cairn localize --sequence`, N lit ones and N black ones in turn, once without odometry and once with: how the camera moved over the floor
from frame to frame by the truth, with this ratio (0.05) of each way and turn as noise.  Counts fixes of lit frames, wrong ones (0.5 m or 10
degrees off), lit frames after a dark piece until one is found by the prediction, and, of dark frames, how far off what is believed is, and
its error squared over its covariance (6 where that is right).  Pieces of one drive are not independent.
"""
import argparse
import json
import math
import pathlib
import random
import statistics
import subprocess
import tempfile

from where import center, driven, read_poses


def matrix_of(q):
    w, x, y, z = q
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]


def perturbation(of, to):
    """(rotation, translation) with to = (Exp(rotation), translation) * of; poses w x y z tx ty tz."""
    w0, x0, y0, z0 = to[:4]
    w1, x1, y1, z1 = of[0], -of[1], -of[2], -of[3]
    q = [w0 * w1 - x0 * x1 - y0 * y1 - z0 * z1, w0 * x1 + x0 * w1 + y0 * z1 - z0 * y1,
         w0 * y1 - x0 * z1 + y0 * w1 + z0 * x1, w0 * z1 + x0 * y1 - y0 * x1 + z0 * w1]
    if q[0] < 0:
        q = [-value for value in q]
    sine = math.sqrt(sum(value * value for value in q[1:]))
    angle = 2 * math.atan2(sine, q[0])
    rotation = [2 * value if sine < 1e-9 else angle * value / sine for value in q[1:]]
    turned = [sum(row[k] * of[4 + k] for k in range(3)) for row in matrix_of(q)]
    return rotation + [to[4 + k] - turned[k] for k in range(3)]


def error_squared(error, covariance):
    """error' covariance^-1 error, by elimination."""
    rows = [[covariance[6 * i + j] for j in range(6)] + [error[i]] for i in range(6)]
    for k in range(6):
        pivot = max(range(k, 6), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(6):
            if i != k:
                factor = rows[i][k] / rows[k][k]
                rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k])]
    return sum(error[i] * rows[i][6] / rows[i][i] for i in range(6))


def is_wrong(found, truth):
    degrees = 2 * math.degrees(math.acos(min(1, abs(sum(a * b for a, b in zip(found[:4], truth[:4]))))))
    return math.dist(center(found), center(truth)) > 0.5 or degrees > 10


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cairn", default="build/release/cairn")
    parser.add_argument("--lit", type=int, default=1)
    parser.add_argument("--dark", type=int, default=1)
    parser.add_argument("--noise", type=float, default=0.05)
    parser.add_argument("--size", type=int, nargs=2, default=[640, 480], help="of the images, pixels")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("runs", nargs="+")
    arguments = parser.parse_args()
    print("| map, frames | odometry | fixes of lit frames | wrong | dark pieces | found by the prediction in the first frame after | "
          "within two | dark frames with a belief | its median error, m | 90 % | mean error squared | median |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|", flush=True)
    for run in arguments.runs:
        map_path, _, folder = run.partition("=")
        folder, _, listed = folder.partition(":")
        folder = pathlib.Path(folder)
        truth = read_poses(folder / (listed or "images.txt"))
        names = sorted(truth)
        period = arguments.lit + arguments.dark
        is_lit = [i % period < arguments.lit for i in range(len(names))]
        generator = random.Random(arguments.seed)
        wheels = [[0, 0, 0]] + [driven(truth[a], truth[b], generator, arguments.noise) for a, b in zip(names, names[1:])]
        for has_odometry in (False, True):
            with tempfile.TemporaryDirectory() as scratch:
                black = pathlib.Path(scratch) / "black.pgm"
                width, height = arguments.size
                black.write_bytes(f"P5 {width} {height} 255\n".encode() + bytes(width * height))
                odometry = pathlib.Path(scratch) / "odometry.txt"
                odometry.write_text("".join("{:.5f} {:.5f} {:.4f}\n".format(*step) for step in wheels))
                images = [str(folder / "images" / name) if lit else str(black) for name, lit in zip(names, is_lit)]
                answer = subprocess.run([arguments.cairn, "localize", map_path, "-", "--sequence", "--progress", "none"] +
                                        (["--odometry", str(odometry)] if has_odometry else []),
                                        input="".join(f"{image}\n" for image in images), capture_output=True, text=True, check=True)
            lines = [json.loads(line) for line in answer.stdout.splitlines()]
            num_fixes = num_wrong = num_pieces = first = within_two = 0
            errors, squares = [], []
            for i, (name, line) in enumerate(zip(names, lines)):
                if is_lit[i] and line["fix"]:
                    num_fixes += 1
                    num_wrong += is_wrong(line["rotation_wxyz"] + line["translation_m"], truth[name])
                if is_lit[i] and i > 0 and not is_lit[i - 1]:
                    num_pieces += 1
                    tracked = [line["fix"] and line["scope"] == "track" for line in lines[i:i + 2]]
                    first += tracked[0]
                    within_two += any(tracked)
                if not is_lit[i] and "believed" in line:
                    believed = line["believed"]
                    pose = believed["rotation_wxyz"] + believed["translation_m"]
                    errors.append(math.dist(center(pose), center(truth[name])))
                    squares.append(error_squared(perturbation(pose, truth[name]), believed["covariance"]))
            errors.sort()
            beliefs = (f"{len(errors)} of {is_lit.count(False)} | {statistics.median(errors):.3f} | {errors[int(0.9 * len(errors))]:.3f} | "
                       f"{statistics.mean(squares):.1f} | {statistics.median(squares):.1f}" if errors else "| | | |")
            print(f"| {map_path}, {len(names)} | {'yes' if has_odometry else 'no'} | {num_fixes} of {is_lit.count(True)} | {num_wrong} | "
                  f"{num_pieces} | {first} | {within_two} | {beliefs} |", flush=True)


if __name__ == "__main__":
    main()
