#!/usr/bin/python3
"""Where was each of these pictures taken, one after the other?  follow.py MAP IMAGE.pgm..."""
import sys

import cairn
from pgm import read_pgm

if len(sys.argv) < 3:
    sys.exit("usage: follow.py MAP IMAGE.pgm... (8-bit grey)")
try:
    map = cairn.Map.open(sys.argv[1])  # shared by all threads
    tracker = cairn.Tracker(map)  # one per camera
    for path in sys.argv[2:]:
        fix = tracker.track(read_pgm(path))  # the next frame
        if fix:
            x, y, z = fix.center
            print(f"{x:.3f} {y:.3f} {z:.3f} m, {fix.num_inliers} inliers, {fix.scope}")  # "track": as expected
        else:
            print("no fix:", fix.message)
except cairn.Error as error:
    sys.exit(str(error))
