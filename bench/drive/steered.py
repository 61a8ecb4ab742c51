#!/usr/bin/env python3
"""Whole drives steered by the camera: steered.py CAIRN MAP CAPTURE RECIPE NUM SEED [drive options]

From beside random survey images (up to 0.3 m in x and y, 15 degrees) to random others.  Prints every drive: whether the
robot says that it is there, how far it is from the goal by truth, the way, how often it looked anew, and why it gave up.
"""
import os
import random
import sys

from drives import drive, survey_poses


def main():
    cairn, map_path, capture, recipe, num, seed = *sys.argv[1:5], int(sys.argv[5]), sys.argv[6]
    options = sys.argv[7:]
    poses = survey_poses(os.path.join(capture, "images.txt"))
    names = sorted(poses)
    draw = random.Random(int(seed))
    num_done, num_reached = 0, 0
    while num_done < num:
        x, y, heading = poses[draw.choice(names)]
        x, y, heading = x + draw.uniform(-.3, .3), y + draw.uniform(-.3, .3), heading + draw.uniform(-15, 15)
        goal = draw.choice(names)
        run = drive(cairn, map_path, recipe, (x, y, round(heading, 2)), goal, seed, *options)
        if not run:  # a start in a wall
            continue
        num_done += 1
        num_reached += run["reached"]
        print(f"{'there' if run['reached'] else 'lost'}: {run['goal_error_m']:.3f} m, {run['goal_error_deg']:.2f} degrees "
              f"from {goal}; {run['way_m']:.1f} m, looked anew {run['num_relocalizations']} times  {run['error']}", flush=True)
    print(f"{num_reached} of {num_done} reached their goals")


if __name__ == "__main__":
    main()
