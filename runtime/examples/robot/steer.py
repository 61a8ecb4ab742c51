#!/usr/bin/python3
"""How does a robot get to where the survey image TARGET was taken?  steer.py MAP TARGET PICTURE.pgm...

The command after each of these pictures, one every quarter of a second.
"""
import sys

import cairn
from pgm import read_pgm

if len(sys.argv) < 4:
    sys.exit("usage: steer.py MAP TARGET PICTURE.pgm... (8-bit grey)")
try:
    map = cairn.Map.open(sys.argv[1])  # shared by all threads
    servo = cairn.Servo(map, map.find_image(sys.argv[2]))  # one for each image of a way
    for path in sys.argv[3:]:
        command = servo.step(read_pgm(path))
        # drive like this, for servo.step_s or until the next image
        print(f"{command.state} {command.speed_m_s:.17g} m/s {command.turn_rad_s:.17g} rad/s, {command.num_matches} matches")
        if command.state == "arrived":  # to the next image of the way
            break
except cairn.Error as error:
    sys.exit(str(error))
