#!/usr/bin/python3
"""Where is this picture?  where.py MAP IMAGE.pgm"""
import re
import sys

import cairn
import numpy


def read_pgm(path):
    """A grey picture from a binary PGM file of 8 bits; a robot takes its camera's pixels instead."""
    with open(path, "rb") as file:
        contents = file.read()
    width, height, offset = 0, 0, 0
    if header := re.match(rb"P5\s+(\d+)\s+(\d+)\s+255\s", contents):
        width, height, offset = int(header[1]), int(header[2]), header.end()
    return numpy.frombuffer(contents, numpy.uint8, width * height, offset).reshape(height, width)


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
