#!/usr/bin/python3
"""What Python adds to a fix, and whether it gives the program's poses bit for bit.

PYTHONPATH=BUILD/python python_overhead.py BUILD MAP IMAGE...
Both localize every image in a process of their own, by turns (C++, Python, C++, ...), the map open; an image's time is
processor time of all threads, the least of the rounds, so that other work on the machine hardly counts.
"""
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import numpy

import cairn

NUM_ROUNDS = 4


def read_pgm(path):
    size, rest = pathlib.Path(path).read_bytes().split(b"\n255\n", 1)
    width, height = (int(number) for number in size.split()[-2:])
    return numpy.frombuffer(rest, numpy.uint8).reshape(height, width)


def main(build, map_path, *images):
    printed = subprocess.run([f"{build}/cairn", "localize", map_path, "--log-level", "off", *images],
                             check=True, capture_output=True, text=True).stdout
    expected = [json.loads(line) for line in printed.splitlines()]
    program, python, fixes = {}, {}, {}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(NUM_ROUNDS):
            lines = subprocess.run([f"{build}/time_fixes", map_path, folder, *images], check=True, capture_output=True,
                                   text=True).stdout.splitlines()
            localizer = cairn.Localizer(cairn.Map.open(map_path))
            for line in lines:
                name, elapsed = line.rsplit(" ", 1)
                pixels = read_pgm(name)
                begin = time.process_time()
                fixes[name] = localizer.localize(pixels)
                pose = (fixes[name].rotation_wxyz, fixes[name].translation, fixes[name].covariance)
                python[name] = min(python.get(name, 1e9), 1e3 * (time.process_time() - begin))
                program[name] = min(program.get(name, 1e9), float(elapsed))
                del pose
    num_equal = 0
    for said, (_, fix) in zip(expected, fixes.items()):
        num_equal += said["fix"] == bool(fix) and (not fix or (
            said["rotation_wxyz"] == fix.rotation_wxyz.tolist() and said["translation_m"] == fix.translation.tolist()
            and said["covariance"] == fix.covariance.T.ravel().tolist()))
    added = [python[name] - program[name] for name in python]
    print(f"{len(images)} images, {sum(map(bool, fixes.values()))} fixes, {num_equal} equal to the program's bit for bit")
    print(f"C++ {statistics.median(program.values()):.1f} ms, Python {statistics.median(python.values()):.1f} ms "
          f"of processor time (medians); Python adds {statistics.median(added):+.2f} ms on the median, {statistics.mean(added):+.2f} on the mean")


main(*sys.argv[1:])
