"""A grey picture from a binary PGM file of 8 bits; a robot takes its camera's pixels instead."""
import re

import numpy


def read_pgm(path):
    with open(path, "rb") as file:
        contents = file.read()
    width, height, offset = 0, 0, 0
    if header := re.match(rb"P5\s+(\d+)\s+(\d+)\s+255\s", contents):
        width, height, offset = int(header[1]), int(header[2]), header.end()
    return numpy.frombuffer(contents, numpy.uint8, width * height, offset).reshape(height, width)
