#!/usr/bin/python3
"""Where did I start?  start.py MAP GOAL PICTURE.pgm...

A robot that was switched on anywhere is on its way to where the survey image GOAL was taken; these pictures it took on its
way, one at each place.
"""
import sys

import cairn
from pgm import read_pgm

if len(sys.argv) < 4:
    sys.exit("usage: start.py MAP GOAL PICTURE.pgm... (8-bit grey)")
try:
    map = cairn.Map.open(sys.argv[1])  # shared by all threads
    model = cairn.PlaceModel(map)  # shared, too
    goal = model.place_of_image(map.find_image(sys.argv[2]))

    def name_of(place):
        return map.image_name(model.images_of_place(place)[0])

    looks = [model.look(read_pgm(path)) for path in sys.argv[3:]]
    starts = cairn.StartHypotheses(model, looks[0], goal)
    for i, look in enumerate(looks):
        # drive along starts.hypotheses[starts.followed].way; at every place:
        verdict = starts.observe(look) if i > 0 else "follow"
        posterior = [f"{name_of(each.start)} {each.posterior:.17g}" for each in starts.hypotheses]
        print(verdict, *posterior)
        if verdict == "lost":  # carried away: localize again
            sys.exit()
    print("way", *[name_of(place) for place in starts.hypotheses[starts.followed].way])
except cairn.Error as error:
    sys.exit(str(error))
