#!/usr/bin/env python3
"""A robot that is carried away before every image: carried.py CAIRN CAPTURE HALF ESTIMATOR MAP... [options of localize]

Shows `cairn localize --sequence` the held-out images of a capture (queries.txt) in a random order in which each lies more
than 1.5 m or 60 degrees from the one before.  HALF: 0 or 1, every other image of that order, so that options are chosen
on one half and reported on the other; or all.  ESTIMATOR: pnp or visual-map.  Options begin with `--`.  Three rows for
each map: by the votes alone (`--localize-when-lost false`), as it comes, and each image by itself, without `--sequence`,
which has neither votes nor a past.  A row has the fixes; of them those by the votes, those by the landmarks of the
regions where the robot was before, and others; wrong ones (more than 1 m or 45 degrees off); the median error; landmarks
matched and regions voted for (means of the fixes by votes).
"""
import json
import math
import os
import random
import statistics
import subprocess
import sys

from drives import survey_poses

APART_M, APART_DEG = 1.5, 60
WRONG_M, WRONG_DEG = 1, 45


def turn(a, b):
    return abs((a - b + 180) % 360 - 180)


def distance(a, b):
    return math.hypot(a[0] - b[0], a[1] - b[1])


def carried_order(poses):
    """Names; each far from the one before while there are such."""
    draw = random.Random(1)
    left = sorted(poses)
    order = [left.pop(draw.randrange(len(left)))]
    while left:
        last = poses[order[-1]]
        far = [name for name in left
               if distance(poses[name], last) > APART_M or turn(poses[name][2], last[2]) > APART_DEG]
        name = draw.choice(far or left)
        left.remove(name)
        order.append(name)
    return order


def pose_of(answer):
    """(x m, y m, heading degrees)."""
    if "floor_m" in answer:
        return *answer["floor_m"], answer["heading_deg"]
    w, x, y, z = answer["rotation_wxyz"]
    return *answer["center_m"][:2], math.degrees(math.atan2(2 * (y * z + w * x), 2 * (x * z - w * y)))


def median(values):
    return f"{statistics.median(values):.1f}" if values else "–"


def mean(values):
    return f"{statistics.mean(values):.1f}" if values else "–"


def main():
    cairn, capture, half, estimator, *rest = sys.argv[1:]
    first_option = next((i for i, word in enumerate(rest) if word.startswith("--")), len(rest))
    maps, options = rest[:first_option], rest[first_option:]
    poses = survey_poses(os.path.join(capture, "queries.txt"))
    order = carried_order(poses)
    if half != "all":
        order = order[int(half)::2]
    images = [os.path.join(capture, "images", name) for name in order]
    jumps = [distance(poses[a], poses[b]) for a, b in zip(order, order[1:])]
    print(f"{len(order)} images, carried {statistics.mean(jumps):.1f} m on average")
    print("| map | landmarks | regions | | fixes | by votes | tracked | otherwise | wrong | median cm | "
          "landmarks matched | regions voted for |")
    print("|---|--:|--:|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    for path in maps:
        about = json.loads(subprocess.run([cairn, "inspect", path, "--json"], capture_output=True, text=True,
                                          check=True).stdout)
        sequence = ["--sequence", *options]
        for name, more in (("votes alone", [*sequence, "--localize-when-lost", "false"]), ("as it comes", sequence),
                           ("each by itself", [])):
            run = subprocess.run([cairn, "localize", path, "--estimator", estimator, *images, *more, "--log-level",
                                  "error"], capture_output=True, text=True)
            if run.returncode:
                sys.exit(run.stderr)
            scopes = {"votes": 0, "track": 0}
            wrong, errors_cm, matched, voted = 0, [], [], []
            answers = [json.loads(line) for line in run.stdout.splitlines()]
            fixes = [answer for answer in answers if answer["fix"]]
            for answer in fixes:
                truth, found = poses[os.path.basename(answer["image"])], pose_of(answer)
                scope = answer.get("scope", "all")
                scopes[scope] = scopes.get(scope, 0) + 1
                errors_cm.append(100 * distance(truth, found))
                wrong += errors_cm[-1] > 100 * WRONG_M or turn(truth[2], found[2]) > WRONG_DEG
                if scope == "votes":
                    matched.append(answer.get("num_inliers", answer.get("num_agreeing")))
                    voted.append(len(answer.get("voted_regions", answer.get("regions"))))
            votes, tracked = scopes["votes"], scopes["track"]
            print(f"| {os.path.basename(path)} | {about['num_landmarks']} | {about['num_regions']} | {name} | "
                  f"{len(fixes)} of {len(answers)} | {votes} | {tracked} | {len(fixes) - votes - tracked} | {wrong} | "
                  f"{median(errors_cm)} | {mean(matched)} | {mean(voted)} |", flush=True)


if __name__ == "__main__":
    main()
