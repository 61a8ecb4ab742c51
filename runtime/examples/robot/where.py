#!/usr/bin/python3
"""Where is this picture?  where.py MAP IMAGE.pgm"""
import sys

import cairn
from pgm import read_pgm

if len(sys.argv) != 3:
    sys.exit("usage: where.py MAP IMAGE.pgm (8-bit grey)")
image = read_pgm(sys.argv[2])
try:
    map = cairn.Map.open(sys.argv[1])  # shared by all threads
    localizer = cairn.Localizer(map)  # one per thread
    fix = localizer.localize(image)  # uint8, height x width
except cairn.Error as error:
    sys.exit(str(error))
if fix:
    x, y, z = fix.center
    print(f"{x:.3f} {y:.3f} {z:.3f} m, {fix.num_inliers} inliers, region {fix.region}")
else:
    print("no fix:", fix.message)
