#!/usr/bin/env python3
"""Drives from random starts in the twin wings: twins.py CAIRN MAP RECIPE GOAL NUM [drive options]

The starts look out of either wing, from where the way out leads past the panel that differs.  Prints, for all runs and
for those whose first choice was in the wrong wing, the median posterior of the right start after T = 0 ... 4 images, the
share that reaches the goal image, by truth: within 0.3 m and 10 degrees, and the way to it.
"""
import random
import statistics
import sys

from drives import drive, has_arrived

WINGS_X = (1.75, 5.45)  # their middles in maps/drive_twins
LOW_Y, HIGH_Y = 5.0, 6.8


def is_near(pose, start):
    return abs(pose["x_m"] - start["x_m"]) < 1.5 and abs(pose["y_m"] - start["y_m"]) < 2.0


def main():
    cairn, map_path, recipe, goal, num = *sys.argv[1:5], int(sys.argv[5])
    options = sys.argv[6:]
    draw = random.Random(1)
    runs = []
    for i in range(num):
        x = WINGS_X[i % 2] + draw.uniform(-0.2, 0.2)
        y, heading = draw.uniform(LOW_Y, HIGH_Y), -90 + draw.uniform(-8, 8)
        run = drive(cairn, map_path, recipe, (x, y, round(heading, 2)), goal, i, *options)
        first = run["legs"][0]["hypotheses"]
        right = [h["start"] for h in first if is_near(h["start_pose"], run["start"])]
        followed = first[run["legs"][0]["followed"]]["start"] if first else None
        posteriors = []
        for leg in run["legs"]:
            if leg["kind"] == "relocalize":
                break
            if leg["hypotheses"]:
                posteriors.append(sum(h["posterior"] for h in leg["hypotheses"] if h["start"] in right))
        runs.append((followed not in right, posteriors, has_arrived(run), run["num_switches"], run["num_relocalizations"],
                     len(first), run["way_m"]))
    for name, part in (("all", runs), ("first choice wrong", [r for r in runs if r[0]])):
        if not part:
            continue
        medians = []
        for t in range(5):
            values = [r[1][t] for r in part if len(r[1]) > t]
            medians.append(f"{statistics.median(values):.3f}" if values else "-")
        print(f"{name}: {len(part)} runs, {statistics.mean(r[5] for r in part):.1f} starts held possible; posterior of the "
              f"right one at T = 0 ... 4: {' '.join(medians)}; goal reached {sum(r[2] for r in part)}, after "
              f"{statistics.mean(r[6] for r in part):.1f} m; turned back {sum(r[3] for r in part)}, looked anew "
              f"{sum(r[4] for r in part)} times")


if __name__ == "__main__":
    main()
