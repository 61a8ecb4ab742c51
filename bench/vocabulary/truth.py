#!/usr/bin/python3
"""Prints which survey images show the place of each query, for vocabulary_retrieval: lines QUERY SURVEY...

  truth.py poses IMAGES.TXT QUERIES.TXT [METRES DEGREES]   taken near (0.5 m) and looking nearly the same way (45 deg)
  truth.py matches MATCHES.DB SURVEY.DB QUERIES.DB         pairs with a verified geometry; names as in the databases
"""
import math
import sqlite3
import sys


def read_poses(path):
    """name -> camera centre, viewing direction"""
    poses = {}
    with open(path) as file:
        for line in file:
            words = line.split()
            if len(words) != 10 or line.startswith('#'):
                continue
            w, x, y, z = map(float, words[1:5])
            t = list(map(float, words[5:8]))
            rotation = [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
            centre = [-sum(rotation[row][axis] * t[row] for row in range(3)) for axis in range(3)]
            poses[words[9]] = (centre, rotation[2])
    return poses


def names(path):
    with sqlite3.connect(f'file:{path}?mode=ro', uri=True) as database:
        return dict(database.execute('SELECT name, image_id FROM images'))


def by_poses(images_path, queries_path, max_distance=0.5, max_angle=45):
    survey = read_poses(images_path)
    for query, (centre, direction) in sorted(read_poses(queries_path).items()):
        near = [name for name, (other, axis) in sorted(survey.items())
                if math.dist(centre, other) <= float(max_distance)
                and sum(a * b for a, b in zip(direction, axis)) >= math.cos(math.radians(float(max_angle)))]
        print(query, *near)


def by_matches(matches_path, survey_path, queries_path):
    ids = names(matches_path)
    survey = {ids[name]: name for name in names(survey_path)}
    with sqlite3.connect(f'file:{matches_path}?mode=ro', uri=True) as database:
        pairs = [divmod(row[0], 2147483647) for row in
                 database.execute('SELECT pair_id FROM two_view_geometries WHERE rows > 0')]
    for query in sorted(names(queries_path)):
        linked = {b if a == ids[query] else a for a, b in pairs if ids[query] in (a, b)}
        print(query, *sorted(survey[i] for i in linked if i in survey))


if len(sys.argv) < 4 or sys.argv[1] not in ('poses', 'matches'):
    sys.exit(__doc__)
(by_poses if sys.argv[1] == 'poses' else by_matches)(*sys.argv[2:])
