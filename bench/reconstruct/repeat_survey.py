#!/usr/bin/env python3
"""What memory a stage takes of a survey N times as large, without matching so many images.

usage: repeat_survey.py BUILD TIMES OUT     BUILD: a compile's folder, with matches.db and poses/

Writes OUT/matches.db and OUT/poses: the survey TIMES times, each copy 100 m beside the one before and with the values of its
descriptors in another order, so that copies do not look alike.  Then, for instance, `cairn stage group-classes OUT/matches.db
--capture OUT/poses -o OUT/classes.db` under /usr/bin/time -v.  Needs numpy.
"""
import os
import pathlib
import shutil
import sqlite3
import sys

import numpy as np

from compare_mappers import read_poses

METRES_APART = 100
PAIR_BASE = 2**31 - 1  # of COLMAP's pair_id


def insert(database, table, row):
    database.execute(f"INSERT INTO {table} VALUES ({','.join('?' * len(row))})", row)


def repeat_matches(source, target, times):
    shutil.copy(source, target)
    database = sqlite3.connect(target)
    columns = [row[1] for row in database.execute("PRAGMA table_info(images)")]
    tables = {table: database.execute(f"SELECT * FROM {table}").fetchall()
              for table in ("images", "keypoints", "descriptors", "two_view_geometries")}
    stride, name = max(row[0] for row in tables["images"]), columns.index("name")
    random = np.random.default_rng(0)
    for copy in range(1, times):
        order = random.permutation(128)
        for row in tables["images"]:
            insert(database, "images", [row[0] + copy * stride, *row[1:name], f"c{copy}_{row[name]}", *row[name + 1:]])
        for row in tables["keypoints"]:
            insert(database, "keypoints", [row[0] + copy * stride, *row[1:]])
        for image, rows, dimensions, values in tables["descriptors"]:
            turned = np.frombuffer(values, np.uint8).reshape(-1, dimensions)[:, order]
            insert(database, "descriptors", [image + copy * stride, rows, dimensions, turned.tobytes()])
        for row in tables["two_view_geometries"]:
            image1, image2 = (image + copy * stride for image in divmod(row[0], PAIR_BASE))
            insert(database, "two_view_geometries", [image1 * PAIR_BASE + image2, *row[1:]])
    database.commit()
    return stride


def repeat_poses(source, target, times, stride):
    (target / "images").mkdir(parents=True)
    for name in ("cameras.txt", "frame.json"):
        shutil.copy(source / name, target / name)
    poses = read_poses(source / "images.txt")
    rows = [words for words in map(str.split, (source / "images.txt").read_text().splitlines()) if len(words) == 10]
    with open(target / "images.txt", "w") as file:
        for copy in range(times):
            for words in rows:
                rotation, center = poses[words[9]]
                translation = -rotation @ (center + [METRES_APART * copy, 0, 0])
                name = f"c{copy}_{words[9]}" if copy else words[9]
                file.write(" ".join([str(int(words[0]) + copy * stride), *words[1:5], *map(repr, map(float, translation)), words[8],
                                     name]) + "\n\n")
                os.link((source / "images" / words[9]).resolve(), target / "images" / name)


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    build, times, out = pathlib.Path(sys.argv[1]), int(sys.argv[2]), pathlib.Path(sys.argv[3])
    out.mkdir(parents=True)
    stride = repeat_matches(build / "matches.db", out / "matches.db", times)
    repeat_poses(build / "poses", out / "poses", times, stride)


if __name__ == "__main__":
    main()
