#!/usr/bin/python3
"""Where is a robot with a laser?  laser.py PLAN SCANS

It was switched on anywhere on the floor plan of PLAN (views.db, or a map that has it), and drives.  Lines of SCANS: metres ahead, to
the left and radians turned to the left since the scan before, then ranges, all around from behind, counter-clockwise.
"""
import math
import sys

import cairn

if len(sys.argv) != 3:
    sys.exit("usage: laser.py PLAN SCANS")
try:
    plan = cairn.Plan.open(sys.argv[1])  # shared by all threads
    tracker = cairn.PlanTracker(plan)  # one per robot
    for line in open(sys.argv[2]):
        if line.startswith("#"):
            continue
        ahead_m, left_m, turn_left_rad, *ranges = map(float, line.split())
        tracker.move(ahead_m, left_m, turn_left_rad)  # since the last scan
        tracker.see_scan(cairn.Scan(ranges, first_angle_rad=-math.pi, step_rad=2 * math.pi / len(ranges), max_range_m=6))
        for place in tracker.places[:3]:  # the most probable first
            x, y = place.position
            print(f"{x:.17g} {y:.17g} m, {place.heading_rad:.17g} rad: {place.probability:.17g}", end="; ")
        print(f"elsewhere {tracker.elsewhere:.17g}")
except cairn.Error as error:
    sys.exit(str(error))
