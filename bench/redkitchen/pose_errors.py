#!/usr/bin/env python3
"""Compares estimated poses with true ones: two lists in COLMAP's images.txt form, matched by image name.

Prints how many of the true list's images were localized, median and 90th percentile of the errors (camera centre in cm,
rotation in degrees), and the share within the usual limits.  Standard library only.
"""
import math
import sys


def read_poses(path):
    """Returns {name: (quaternion (w, x, y, z), translation)}, cam_from_world."""
    poses = {}
    with open(path, encoding="utf-8") as lines:
        for line in lines:
            words = line.split()
            if len(words) < 10 or words[0].startswith("#"):
                continue
            try:
                numbers = [float(word) for word in words[1:8]]
            except ValueError:
                continue
            if not words[9].replace(".", "", 1).lstrip("-").isdigit():  # a number there: a line of points
                poses[" ".join(words[9:])] = (numbers[:4], numbers[4:])
    return poses


def rotate_back(q, v):
    """R^T v for the rotation R of the unit quaternion q."""
    w, x, y, z = q
    x, y, z = -x, -y, -z
    tx, ty, tz = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    return [v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz, v[2] + w * tz + x * ty - y * tx]


def errors(true, estimate):
    """Distance of the centres in metres, angle between the rotations in degrees."""
    centre1, centre2 = rotate_back(*true), rotate_back(*estimate)  # minus the centres
    dot = abs(sum(a * b for a, b in zip(true[0], estimate[0])))
    return math.dist(centre1, centre2), math.degrees(2 * math.acos(min(1.0, dot)))


def main():
    if len(sys.argv) != 3:
        sys.exit("usage: pose_errors.py TRUE.txt ESTIMATED.txt")
    true, estimated = read_poses(sys.argv[1]), read_poses(sys.argv[2])
    found = sorted(errors(true[name], estimated[name]) for name in true if name in estimated)
    if not found:
        sys.exit("no image of the first list is in the second")
    centre = sorted(100 * e[0] for e in found)
    angle = sorted(e[1] for e in found)

    def quantile(values, q):
        return values[min(len(values) - 1, int(q * len(values)))]

    def within(cm, deg):
        return 100.0 * sum(1 for c, a in found if 100 * c <= cm and a <= deg) / len(true)

    print(f"{len(found)} of {len(true)} localized; median {quantile(centre, .5):.2f} cm / {quantile(angle, .5):.3f} deg, "
          f"90 % {quantile(centre, .9):.2f} cm / {quantile(angle, .9):.3f} deg; within 2 cm / 1 deg {within(2, 1):.1f} %, "
          f"5 cm / 5 deg {within(5, 5):.1f} %, 10 cm / 5 deg {within(10, 5):.1f} %")


if __name__ == "__main__":
    main()
