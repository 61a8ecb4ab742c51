#!/usr/bin/env python3
"""A drive as a robot records it, compiled by one command: how good is the map beside that of the same images with true poses?

usage: drive_to_map.py [--cairn PROGRAM] [--work FOLDER] [--seeds 0,...] [--building KEY=VALUE ...]

For each seed a drive through the demo's building is rendered at 30 Hz, 3 cm a frame, and recorded as a bag of ROS 1, as MCAP and
as db3, with wheel odometry of 2 % noise, drawn anew each metre, and as a film (H.264).  `cairn compile FILE`, with defaults, makes
a map of each; bags whose import is the same byte for byte share one.  The peer is a capture of the bag's images with their true
poses.  Queries, which no map has seen: the demo's 93, in any direction from anywhere, and 93 near the drive that look along
it.  A query counts as found where its fix is within 0.5 m and 10 degrees of the truth after the similarity that fits the map's frame
best; the scale is that of the map's images against the drive's.  --building sets keys of [simulate], num_rooms=6 for instance.
What is there is not made again.  Needs ffmpeg, NumPy, and what tests/ros/bag_of_capture.py needs.
"""
import argparse
import pathlib
import re
import shutil
import subprocess
import sys

import numpy as np

from compare_mappers import errors, read_poses, similarity

ROOT = pathlib.Path(__file__).resolve().parents[2]
DEMO = ROOT / "maps/demo/recipe.toml"
BAG_START_S, HZ = 1_700_000_000, 30


def run(*words, **more):
    return subprocess.run([str(word) for word in words], check=True, stdout=subprocess.DEVNULL, **more)


def render(cairn, folder, seed, building, *options):
    if not folder.exists():
        keys = [word for key, value in building for word in (f"--{key.replace('_', '-')}", value)]
        run(cairn, "stage", "simulate", DEMO, "--seed", seed, *keys, *options, "--progress", "none", "-o", folder)


def record(work, drive):
    """The bags and the film of a drive."""
    for form in ("bag", "mcap", "db3"):
        if not (work / f"drive.{form}").exists():
            run(sys.executable, ROOT / "tests/ros/bag_of_capture.py", drive, work / f"drive.{form}",
                "--hz", HZ, "--noise", 0.02, "--common", 0, "--noise-length", 1)
    if not (work / "drive.mp4").exists():
        run("ffmpeg", "-v", "error", "-framerate", HZ, "-i", drive / "images/d%04d.jpg", "-c:v", "libx264", "-pix_fmt", "yuv420p",
            work / "drive.mp4")


def compile_map(cairn, work, what, name, until=None):
    run(cairn, "compile", what, "-o", f"{name}.cairn", "--progress", "none", "--log-level", "error",
        *(("--until", until) if until else ()), cwd=work)


def contents(capture):
    return {str(path.relative_to(capture)): path.read_bytes() for path in sorted(capture.rglob("*")) if path.is_file()}


def frame_of(name):
    """The number of the frame that an imported image is: its name is its time."""
    seconds, fraction = re.fullmatch(r"(\d+)\.(\d+)\.jpg", pathlib.Path(name).name).groups()
    time_s = int(seconds) % BAG_START_S + float(f"0.{fraction}")
    return round(time_s * HZ)


def write_posed(imported, drive, folder):
    """The bag's images with the poses that they were rendered from."""
    folder.mkdir(exist_ok=True)
    lines = {words[9]: words for words in map(str.split, (drive / "images.txt").read_text().splitlines()) if len(words) == 10}
    images = sorted(path.name for path in (imported / "images").iterdir())
    with open(folder / "images.txt", "w") as file:
        for number, name in enumerate(images):
            words = lines[f"d{frame_of(name):04}.jpg"]
            file.write(" ".join([str(number + 1), *words[1:9], name]) + "\n\n")
    (folder / "cameras.txt").write_text((drive / "cameras.txt").read_text())
    shutil.copytree(imported / "images", folder / "images", dirs_exist_ok=True)


def truth_from_map(found, truth):
    """The similarity that takes the map's images to where the drive's frames were rendered from, and how far off they are then."""
    true = {name: truth[f"d{frame_of(name):04}.jpg"] for name in found}
    fit = similarity(*(np.array([poses[name][1] for name in found]) for poses in (found, true)))
    return fit, np.median(errors(found, true)[0])


def query_errors(cairn, built, queries, fit):
    """Metres and degrees of each query's fix in the truth's frame, and how many queries there are."""
    poses = built.with_suffix(f".{queries.name}.txt")
    run(cairn, "localize", built, "--cameras", queries / "cameras.txt", "--progress", "none", "--log-level", "error", "-o", poses,
        *sorted((queries / "images").glob("q*.jpg")))
    truth, (scale, rotation, shift) = read_poses(queries / "queries.txt"), fit
    distances, angles = [], []
    for name, (turn, centre) in read_poses(poses).items():
        true_turn, true_centre = truth[name]
        distances.append(np.linalg.norm(scale * rotation @ centre + shift - true_centre))
        cosine = (np.trace(true_turn @ rotation @ turn.T) - 1) / 2
        angles.append(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    return np.array(distances), np.array(angles), len(truth)


def report(cairn, work, name, label, truth, num_images, posed=None):
    build = work / f"{name}.build"
    found = read_poses((posed or build / "poses") / "images.txt")
    fit, median_m = truth_from_map(found, truth)
    is_metric = posed is not None or '"metre"' in (build / "poses/frame.json").read_text()
    cells = [label, f"{len(found)} of {num_images}", f"{100 * (1 / fit[0] - 1):+.2f} %" if is_metric else "none",
             "" if posed else f"{100 * median_m:.2f} cm"]
    for queries in (work / "lattice", work / "drive"):
        distances, angles, num = query_errors(cairn, work / f"{name}.cairn", queries, fit)
        right = (distances < 0.5) & (angles < 10)
        cells.append(f"{right.sum()} of {num}, {len(distances) - right.sum()} wrong; {100 * np.median(distances):.2f} cm, "
                     f"{np.median(angles):.3f}°")
    print("| " + " | ".join(cells) + " |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cairn", type=pathlib.Path, default=ROOT / "build/release/cairn")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "build/bench/drive_to_map")
    parser.add_argument("--seeds", default="0")
    parser.add_argument("--building", nargs="*", default=[], metavar="KEY=VALUE")
    arguments = parser.parse_args()
    cairn, building = arguments.cairn.resolve(), [word.split("=", 1) for word in arguments.building]
    print("| map of | joined | scale off by | images, median error | queries in any direction: found; median error | "
          "queries along the drive |\n|---|---|---|---|---|---|")
    for seed in arguments.seeds.split(","):
        work = (arguments.work / f"seed{seed}").resolve()
        work.mkdir(parents=True, exist_ok=True)
        drive = work / "drive"
        render(cairn, drive, seed, building, "--survey", "driven", "--step-m", 0.03, "--max-turn-deg", 2)
        render(cairn, work / "lattice", seed, building)
        record(work, drive)
        truth = read_poses(drive / "images.txt")
        compile_map(cairn, work, "drive.bag", "bag")
        imported = {"bag": work / "bag.build/bag-drive"}
        for form in ("mcap", "db3"):
            compile_map(cairn, work, f"drive.{form}", form, "import")
            imported[form] = work / f"{form}.build/bag-drive"
        same = [form for form in imported if contents(imported[form]) == contents(imported["bag"])]
        others = [form for form in imported if form not in same]
        for form in others:
            compile_map(cairn, work, f"drive.{form}", form)
        compile_map(cairn, work, "drive.mp4", "film")
        imported["film"] = work / "film.build/film-drive"
        write_posed(imported["bag"], drive, work / "posed")
        compile_map(cairn, work, "posed", "posed")
        labels = {"bag": " = ".join(f".{form}" for form in same), **{form: f".{form}" for form in others}, "film": "film",
                  "posed": "the bag's images with true poses"}
        for name, label in labels.items():
            folder = imported["bag" if name == "posed" else name] / "images"
            report(cairn, work, name, f"seed {seed}: {label}", truth, len(list(folder.iterdir())),
                   work / "posed" if name == "posed" else None)


if __name__ == "__main__":
    main()
