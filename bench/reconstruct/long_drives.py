#!/usr/bin/env python3
"""Long drives and a long film, without poses, by one command: seconds, memory and errors.

usage: long_drives.py [--cairn PROGRAM] [--work FOLDER] DRIVE...     DRIVE: 550, 1025, 2099 (images) or film (10 min at 30 Hz)

Renders each drive once, withholds its poses, runs `cairn compile` with defaults, and prints a row a stage (seconds, CPU seconds, peak
memory) and what is left of the errors after the best similarity.  The film's frames are encoded by ffmpeg.  Needs numpy.
"""
import argparse
import json
import pathlib
import shutil
import subprocess

import numpy as np

from compare_mappers import errors, read_poses

FRAMES_PER_SECOND, NUM_FRAMES = 30, 18000
BUILDINGS = {"550": (12, 8.5, 6, 103), "1025": (16, 12, 8, 105), "2099": (24, 16, 16, 101), "film": (24, 16, 16, 111)}
FILM = ["--step-m", "0.0226", "--max-turn-deg", "2", "--horizontal-fov-deg", "75"]


def render(cairn, name, drive):
    width, depth, rooms, seed = BUILDINGS[name]
    subprocess.run([cairn, "stage", "simulate", "--survey", "driven", "--num-queries", "0", "--width-m", str(width), "--depth-m",
                    str(depth), "--num-rooms", str(rooms), "--seed", str(seed), *(FILM if name == "film" else []), "-o", drive],
                   check=True)


def withhold_poses(name, drive, bare):
    """What is compiled: a film, or a folder of images alone."""
    if name != "film":
        shutil.copytree(drive / "images", bare / "images", dirs_exist_ok=True)
        return bare
    film = drive.parent / "film.mp4"
    subprocess.run(["ffmpeg", "-v", "error", "-y", "-framerate", str(FRAMES_PER_SECOND), "-i", drive / "images" / "d%05d.jpg",
                    "-frames:v", str(NUM_FRAMES), "-c:v", "libx264", "-preset", "veryfast", "-crf", "20", "-pix_fmt", "yuv420p",
                    film], check=True)
    return film


def true_poses(name, drive, found):
    """Those of the images in `found`, by their names; an image of a film is named by its time in seconds."""
    poses = read_poses(drive / "images.txt")
    if name != "film":
        return poses
    frames = sorted(poses)
    return {image: poses[frames[round(float(image.removesuffix(".jpg")) * FRAMES_PER_SECOND)]] for image in found}


def print_stages(build):
    reports = [json.loads(path.read_text()) for path in build.glob("*.report.json")]
    sums = {"seconds": 0, "cpu": 0, "peak": 0}
    for report in sorted(reports, key=lambda r: -r["user_seconds"]):
        cpu, peak = report["user_seconds"] + report["system_seconds"], report["peak_memory_bytes"] / 2**20
        sums = {"seconds": sums["seconds"] + report["seconds"], "cpu": sums["cpu"] + cpu, "peak": max(sums["peak"], peak)}
        print(f"| {report['stage']} | {report['seconds']:.1f} | {cpu:.1f} | {peak:.0f} |")
    print(f"| all | {sums['seconds']:.1f} | {sums['cpu']:.1f} | {sums['peak']:.0f} |")


def print_errors(name, drive, build):
    found = read_poses(build / "poses" / "images.txt")
    distances, angles = errors(found, true_poses(name, drive, found))
    print(f"{len(found)} images in the map; median error {100 * np.median(distances):.2f} cm, {np.median(angles):.3f}°; "
          f"largest {100 * np.max(distances):.2f} cm, {np.max(angles):.3f}°", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("drives", nargs="+", choices=BUILDINGS)
    parser.add_argument("--cairn", default="build/release/cairn")
    parser.add_argument("--work", type=pathlib.Path, default=pathlib.Path("build/bench/reconstruct"))
    arguments = parser.parse_args()
    for name in arguments.drives:
        work = arguments.work / f"long_{name}"
        work.mkdir(parents=True, exist_ok=True)
        drive, build = work / "drive", work / "map.build"
        if not drive.is_dir():
            render(arguments.cairn, name, drive)
        survey = withhold_poses(name, drive, work / "bare")
        subprocess.run([arguments.cairn, "compile", survey, "-o", work / "map.cairn"], check=True)
        print(f"\n{name}\n| stage | s | CPU s | peak, MiB |\n|---|---|---|---|")
        print_stages(build)
        print_errors(name, drive, build)


if __name__ == "__main__":
    main()
