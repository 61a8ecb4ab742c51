#!/usr/bin/env python3
"""Robots that are carried along their way: kidnapped.py CAIRN MAP CAPTURE RECIPE NUM [drive options]

From random survey images to random others by the way of least entropy and by the shortest one (`--weight links`), put
near each image of it (`--servo ideal`).  Half-way a robot is carried to a place farther along its own way, 3 m or more
away, up to 0.4 m beside the survey's image there and turned by up to 20 degrees, and must notice and find out where it
is.  Prints every run, then for each way: how often robots looked anew, how often they then took the wrong place (more
than 1 m or 45 degrees from where they stood) for the right one, goals reached by truth (within 0.3 m and 10 degrees),
images and metres driven.
"""
import math
import os
import random
import statistics
import subprocess
import sys

from drives import drive, has_arrived, survey_poses

LEAST_WAY_IMAGES = 10  # shorter ways are not driven
LEAST_CARRIED_M = 3
BESIDE_M, TURNED_DEG = 0.4, 20


def apart(a, b):
    return math.hypot(a[0] - b[0], a[1] - b[1])


def pose_of(json_pose):
    return json_pose["x_m"], json_pose["y_m"], json_pose["heading_deg"]


class Tally:
    def __init__(self):
        self.looked, self.wrong, self.wrong_runs, self.goals, self.images, self.metres = 0, 0, 0, 0, [], []

    def add(self, run, reached):
        legs = run["legs"]
        wrong = 0
        for leg in legs:
            if leg["kind"] != "relocalize" or not leg["hypotheses"]:
                continue
            self.looked += 1
            stands, taken = pose_of(leg["pose"]), pose_of(leg["hypotheses"][leg["followed"]]["start_pose"])
            turn = abs((stands[2] - taken[2] + 180) % 360 - 180)
            wrong += apart(stands, taken) > 1 or turn > 45
        self.wrong += wrong
        self.wrong_runs += wrong > 0
        self.goals += reached
        self.images.append(sum(leg["kind"] in ("go", "retrace") for leg in legs))
        self.metres.append(run["way_m"])
        return f"{wrong} wrong, {self.images[-1]} images, {run['way_m']:.1f} m"


def main():
    cairn, map_path, capture, recipe, num = *sys.argv[1:5], int(sys.argv[5])
    options = sys.argv[6:]
    poses = survey_poses(os.path.join(capture, "images.txt"))
    names = sorted(poses)
    draw = random.Random(1)
    tallies = {"entropy": Tally(), "links": Tally()}
    num_done = 0
    while num_done < num:
        start, goal = draw.choice(names), draw.choice(names)
        ways = {}
        for weight in tallies:
            listing = subprocess.run([cairn, "route", map_path, start, goal, "--weight", weight],
                                     capture_output=True, text=True)
            if listing.returncode and "no path" not in listing.stderr:
                sys.exit(listing.stderr)
            ways[weight] = [word for word in listing.stdout.split() if word in poses]
        carried = {}
        for weight, way in ways.items():
            half = len(way) // 2
            farther = [name for name in way[half:] if apart(poses[name], poses[way[half - 1]]) > LEAST_CARRIED_M]
            if len(way) >= LEAST_WAY_IMAGES and farther:
                x, y, heading = poses[farther[0]]
                side, bearing = draw.uniform(0, BESIDE_M), draw.uniform(0, 2 * math.pi)
                carried[weight] = (f"{half - 1}:{x + side * math.cos(bearing):.3f},{y + side * math.sin(bearing):.3f},"
                                   f"{heading + draw.uniform(-TURNED_DEG, TURNED_DEG):.3f}")
        if len(carried) < len(tallies):
            continue
        runs = {}
        for weight in tallies:
            runs[weight] = drive(cairn, map_path, recipe, poses[start], goal, num_done + 1, "--kidnap", carried[weight],
                                 "--weight", weight, "--servo", "ideal", "--ideal-reach-m", "2", *options)
            if not runs[weight]:  # carried into a wall
                break
        if not all(runs.values()):
            continue
        num_done += 1
        added = [f"{weight}: {tally.add(runs[weight], has_arrived(runs[weight]))}" for weight, tally in tallies.items()]
        print(f"{start} to {goal}: {'; '.join(added)}", flush=True)
    for weight, tally in tallies.items():
        print(f"{weight}: {num_done} runs; looked anew {tally.looked} times, {tally.wrong} of them wrong, in "
              f"{tally.wrong_runs} runs; goal reached {tally.goals}; {statistics.mean(tally.images):.1f} images, "
              f"{statistics.mean(tally.metres):.1f} m")


if __name__ == "__main__":
    main()
