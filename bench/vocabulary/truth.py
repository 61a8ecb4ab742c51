#!/usr/bin/python3
"""Prints which survey images show the place of each query, for vocabulary_retrieval: lines QUERY SURVEY...

  truth.py stations WORLD.DB FEATURES.DB QUERIES.TXT       taken at the station nearest to the query or at one that
                                                           an edge of the world joins to it, whatever the heading
  truth.py poses IMAGES.TXT QUERIES.TXT [METRES DEGREES]   taken near (0.5 m) and looking nearly the same way (45 deg)
  truth.py matches MATCHES.DB SURVEY.DB QUERIES.DB         pairs with a verified geometry; names as in the databases
"""
import math
import sqlite3
import struct
import sys


def rotation_of(w, x, y, z):
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]


def read_poses(path):
    """name -> camera centre, viewing direction"""
    poses = {}
    with open(path) as file:
        for line in file:
            words = line.split()
            if len(words) != 10 or line.startswith('#'):
                continue
            rotation = rotation_of(*map(float, words[1:5]))
            t = list(map(float, words[5:8]))
            centre = [-sum(rotation[row][axis] * t[row] for row in range(3)) for axis in range(3)]
            poses[words[9]] = (centre, rotation[2])
    return poses


def connect(path):
    return sqlite3.connect(f'file:{path}?mode=ro', uri=True)


def names(path):
    with connect(path) as database:
        return dict(database.execute('SELECT name, image_id FROM images'))


def ints(blob):
    return struct.unpack(f'<{len(blob) // 4}i', blob)


def by_stations(world_path, features_path, queries_path):
    name_of = {image_id: name for name, image_id in names(features_path).items()}
    with connect(world_path) as database:
        *q, tx, ty, _ = database.execute('SELECT qw, qx, qy, qz, tx, ty, tz FROM world').fetchone()
        rows = database.execute('SELECT station_idx, x, y, neighbours, images FROM stations').fetchall()
    floor_from_world = rotation_of(*q)
    neighbours = {row[0]: {row[0]} for row in rows}
    for station, _, _, larger, _ in rows:
        for other in ints(larger):
            neighbours[station].add(other)
            neighbours[other].add(station)
    images = {row[0]: [name_of[i] for i in ints(row[4])] for row in rows}
    for query, (centre, _) in sorted(read_poses(queries_path).items()):
        x, y = (sum(a * b for a, b in zip(floor_from_world[axis], centre)) + (tx, ty)[axis] for axis in (0, 1))
        nearest = min(rows, key=lambda row: math.hypot(row[1] - x, row[2] - y))[0]
        print(query, *sorted(name for station in neighbours[nearest] for name in images[station]))


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
    with connect(matches_path) as database:
        pairs = [divmod(row[0], 2147483647) for row in
                 database.execute('SELECT pair_id FROM two_view_geometries WHERE rows > 0')]
    for query in sorted(names(queries_path)):
        linked = {b if a == ids[query] else a for a, b in pairs if ids[query] in (a, b)}
        print(query, *sorted(survey[i] for i in linked if i in survey))


WAYS = {'stations': by_stations, 'poses': by_poses, 'matches': by_matches}
if len(sys.argv) < 4 or sys.argv[1] not in WAYS:
    sys.exit(__doc__)
WAYS[sys.argv[1]](*sys.argv[2:])
