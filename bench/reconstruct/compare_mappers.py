#!/usr/bin/env python3
"""Poses of captures without any: cairn's mapper and COLMAP's, on the same matches.

usage: compare_mappers.py [--cairn PROGRAM] [--work FOLDER] [--mappers global,colmap] CAPTURE...

A capture that has poses (images.txt, queries.txt) is compiled without them, and what is found is compared with them after the best
similarity: distance of the centres in cm, angle in degrees (frame of the mean rotation).  A folder of images is only mapped.
Prints a row a capture and mapper.  Needs numpy.
"""
import argparse
import pathlib
import re
import subprocess
import time

import numpy as np


def read_poses(path):
    """{name: (rotation, centre)} of a list in COLMAP's images.txt form."""
    poses = {}
    for line in path.read_text().splitlines():
        words = line.split()
        if len(words) < 10 or words[0].startswith("#"):
            continue
        try:
            q, t = np.array(words[1:5], float), np.array(words[5:8], float)
        except ValueError:
            continue
        w, x, y, z = q / np.linalg.norm(q)
        rotation = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                             [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                             [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
        poses[" ".join(words[9:])] = rotation, -rotation.T @ t
    return poses


def similarity(found, true):
    """Scale, rotation and shift that take points nearest to others [Umeyama91]."""
    mean_found, mean_true = found.mean(0), true.mean(0)
    u, values, v = np.linalg.svd((true - mean_true).T @ (found - mean_found))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u @ v))])
    rotation = u @ sign @ v
    scale = (values * np.diag(sign)).sum() / ((found - mean_found) ** 2).sum()
    return scale, rotation, mean_true - scale * rotation @ mean_found


def errors(found, true):
    """Distances in metres and angles in degrees of the images in both, after the similarity that fits those within three medians."""
    names = [name for name in found if name in true]
    centres = np.array([found[name][1] for name in names])
    targets = np.array([true[name][1] for name in names])
    inside = np.ones(len(names), bool)
    for _ in range(10):
        scale, rotation, shift = similarity(centres[inside], targets[inside])
        distances = np.linalg.norm(targets - (scale * centres @ rotation.T + shift), axis=1)
        inside = distances <= max(3 * np.median(distances), 1e-9)
    u, _, v = np.linalg.svd(sum(true[name][0].T @ found[name][0] for name in names))
    world = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    angles = [np.degrees(np.arccos(np.clip((np.trace(true[name][0] @ world @ found[name][0].T) - 1) / 2, -1, 1)))
              for name in names]
    return distances, np.array(angles)


def withhold_poses(capture, folder):
    folder.mkdir(parents=True, exist_ok=True)
    images = folder / "images"
    if not images.is_symlink():
        images.symlink_to((capture / "images").resolve())
    return folder


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", nargs="+", type=pathlib.Path)
    parser.add_argument("--cairn", default="build/release/cairn")
    parser.add_argument("--work", type=pathlib.Path, default=pathlib.Path("build/bench/reconstruct"))
    parser.add_argument("--mappers", default="global,colmap")
    arguments = parser.parse_args()
    print("| capture | mapper | joined | focal length, px | median error | 90th percentile | largest | s |")
    print("|---|---|---|---|---|---|---|---|")
    for capture in arguments.captures:
        work = arguments.work / capture.absolute().name
        bare, build = withhold_poses(capture, work / "capture"), work / "map.build"
        recipe = work / "map.toml"
        recipe.write_text(f'name = "map"\n[capture]\npath = "{bare.resolve()}"\n')
        subprocess.run([arguments.cairn, "compile", recipe, "-o", work / "map.cairn", "--until", "match-features",
                        "--progress", "none", "--log-level", "error"], check=True, stdout=subprocess.DEVNULL)
        true = {}
        for name in ("images.txt", "queries.txt"):
            if (capture / name).is_file():
                true.update(read_poses(capture / name))
        for mapper in arguments.mappers.split(","):
            poses, began = work / f"poses_{mapper}", time.time()
            subprocess.run([arguments.cairn, "stage", "reconstruct", build / "matches.db", "--capture", bare, "--mapper", mapper,
                            "--min-registered-ratio", "0.01", "-o", poses, "--progress", "none", "--log-level", "error"],
                           check=True, stdout=subprocess.DEVNULL)
            seconds = time.time() - began
            found = read_poses(poses / "images.txt")
            focal = next(line.split()[4] for line in (poses / "cameras.txt").read_text().splitlines() if re.match(r"\d", line))
            row = f"| {capture.absolute().name} | {mapper} | {len(found)} of {len(list((bare / 'images').rglob('*.*')))} | {float(focal):.1f} | "
            if true:
                distances, angles = errors(found, true)
                row += " | ".join(f"{100 * value(distances):.2f} cm, {value(angles):.3f}°"
                                  for value in (np.median, lambda x: np.quantile(x, 0.9), np.max))
            else:
                row += " | | "
            print(f"{row} | {seconds:.1f} |", flush=True)


if __name__ == "__main__":
    main()
