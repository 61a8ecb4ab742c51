#!/usr/bin/env python3
"""Which way pays, in random buildings that repeat themselves.

usage: planners.py CAIRN FOLDER make  SEEDS                      makes and compiles the buildings of these seeds
       planners.py CAIRN FOLDER drive SEEDS RUNS [PLANNER...]    drives in each of them, RUNS times by each planner
       planners.py CAIRN FOLDER table SEEDS                      the table of all drives so far

SEEDS: 1-4 or 7,9.  A building has two wings that look alike up to some panels, joined by a second corridor, or rooms most
of whose panels are shared; sizes, panels and furniture are drawn from its seed.  PLANNER: NAME=OPTIONS of `cairn drive`,
such as "risk=--weight risk"; without any, PLANNERS below.

A robot starts beside a random survey image and goes to another one, steered by its camera unless OPTIONS say otherwise,
with the light, exposures, blur and slip that are the defaults of `cairn drive`.  On its way it is carried ahead: at the same share of its own way, as far beside the
survey's image there and turned as much, whatever its planner.  Runs of all planners have the same starts, goals and seeds,
and are compared in pairs.  A place is wrong that is more than 1 m or 45 degrees from where the robot stands; the first
planner is the one that the others are compared with.
"""
import json
import math
import os
import random
import statistics
import subprocess
import sys
import time

from drives import drive, has_arrived, survey_poses

PLANNERS = {"shortest": ["--weight", "links"], "matches": ["--weight", "matches"], "entropy": ["--weight", "entropy"],
            "risk": ["--weight", "risk"]}
LEAST_WAY_IMAGES = 6  # shorter ways are not driven
LEAST_APART_M = 3  # of start and goal
LEAST_CARRIED_M = 2.5
BESIDE_M, TURNED_DEG = 0.2, 15
# A robot that need not be exact on its way: it passes an image within a tenth of the scene's distance.
STEERING = ("--pass-distance-ratio 0.12 --pass-heading-deg 8 --arrive-distance-ratio 0.05 --arrive-heading-deg 4 "
            "--patience-commands 10 --max-num-commands 60 --max-num-legs 40").split()

TWINS = """width_m = {width:.2f}
depth_m = {depth:.2f}
twin_wings = true
back_corridor = true
num_different_panels = {different}
corridor_width_m = {corridor:.2f}
repetition_ratio = 0
spacing_m = {spacing:.3f}
"""
ROOMS = """width_m = {width:.2f}
depth_m = {depth:.2f}
num_rooms = {rooms}
extra_door_ratio = 1
repetition_ratio = {repetition:.2f}
num_shared_textures = {shared}
spacing_m = 0.8
"""
RECIPE = """name = "building_{seed}"
seed = {seed}
[simulate]
{building}furniture_ratio = {furniture:.2f}
pillars_per_room = 0
texel_m = 0.006
image_width_px = 160
image_height_px = 120
horizontal_fov_deg = 90
num_headings = 8
num_queries = 5
[extract_features]
max_num_features = 300
[group_classes]
refine_poses = "never"
[filter_visibility]
min_num_stations = 2
min_block_side = 1
min_num_neighbours = 0
[decompose_regions]
k = 20
tau = 1
[link_appearance]
algorithm = "all"
min_num_inliers = 25
max_link_distance_m = 1.35
max_link_turn_deg = 50
[emit_map]
landmarks = "all"
words = "survey"
"""


def recipe_of(seed):
    draw = random.Random(seed)
    if draw.random() < 2 / 3:
        corridor = draw.uniform(1.6, 1.9)
        # Wings are four stations apart: stations as well are twins.
        building = TWINS.format(width=draw.uniform(10.2, 11), depth=draw.uniform(6.5, 7.5), different=draw.randint(0, 3),
                                corridor=corridor, spacing=(corridor + 1.95) / 4)
    else:
        building = ROOMS.format(width=draw.uniform(7, 9), depth=draw.uniform(6, 7.5), rooms=draw.randint(3, 4),
                                repetition=draw.uniform(.5, .95), shared=draw.randint(2, 3))
    return RECIPE.format(seed=seed, building=building, furniture=draw.choice([0, .08]))


def paths_of(folder, seed):
    base = os.path.join(folder, f"building_{seed}")
    return base + ".toml", base + ".cairn", base + ".build/capture/images.txt"


def make(cairn, folder, seed):
    recipe, map_path, _ = paths_of(folder, seed)
    text = recipe_of(seed)
    if os.path.exists(map_path) and open(recipe).read() == text:
        return
    with open(recipe, "w") as file:
        file.write(text)
    begin = time.time()
    subprocess.run([cairn, "compile", recipe, "-o", map_path, "--progress", "none", "--threads", "1"], check=True)
    print(f"building {seed}: {len(survey_poses(paths_of(folder, seed)[2]))} images, {time.time() - begin:.0f} s", flush=True)


def apart(a, b):
    return math.hypot(a[0] - b[0], a[1] - b[1])


def turned(a, b):
    return abs((a[2] - b[2] + 180) % 360 - 180)


def pose_of(json_pose):
    return json_pose["x_m"], json_pose["y_m"], json_pose["heading_deg"]


def way_of(cairn, map_path, start, goal, options):
    """Names of the images on the way; none where there is no way."""
    weight = options[:options.index("--weight") + 2][-2:]
    rest = [option for pair in zip(options[::2], options[1::2]) if pair[0] in
            ("--lost-ratio", "--faint-link-inliers", "--look-anew-m", "--wrong-place-m") for option in pair]
    listing = subprocess.run([cairn, "route", map_path, start, goal, "--json", *weight, *rest], capture_output=True, text=True)
    if listing.returncode:
        if "no path" not in listing.stderr:
            sys.exit(listing.stderr)
        return []
    return [image["name"] for image in json.loads(listing.stdout)["images"]]


def draw_run(cairn, map_path, poses, planners, draw):
    """A start (pose), a goal (image), and by planner where it is carried; the same draws for all of them."""
    names = sorted(poses)
    while True:
        first, goal = draw.choice(names), draw.choice(names)
        start = tuple(value + draw.uniform(-size, size) for value, size in zip(poses[first], (.2, .2, 10)))
        share, side, bearing = draw.uniform(.2, .6), draw.uniform(0, BESIDE_M), draw.uniform(0, 2 * math.pi)
        turn = draw.uniform(-TURNED_DEG, TURNED_DEG)
        if apart(poses[first], poses[goal]) < LEAST_APART_M:
            continue
        carried = {}
        for name, options in planners.items():
            way = way_of(cairn, map_path, first, goal, options)
            before = int(share * len(way))
            farther = [image for image in way[before:] if apart(poses[image], poses[way[before - 1]]) > LEAST_CARRIED_M]
            if len(way) < LEAST_WAY_IMAGES or not farther:
                break
            x, y, heading = poses[farther[0]]
            carried[name] = (f"{before}:{x + side * math.cos(bearing):.3f},{y + side * math.sin(bearing):.3f},"
                             f"{heading + turn:.3f}")
        if len(carried) == len(planners):
            return start, goal, carried


def leg_way_m(leg, before):
    poses = [before, *(pose_of(step["pose"]) for step in leg["steps"]), pose_of(leg["pose"])]
    return sum(apart(a, b) for a, b in zip(poses, poses[1:]))


def judge(run):
    """Of a drive: how often a wrong place was followed for the right one, how surely, and how far."""
    stood, before, was_wrong = None, pose_of(run["start"]), False
    wrong, sure, wrong_m, legs = 0, 0, 0, 0
    for leg in run["legs"]:
        legs += leg["kind"] in ("go", "retrace")
        if was_wrong:
            wrong_m += leg_way_m(leg, before)
        before = pose_of(leg["pose"])
        if leg["kind"] in ("start", "relocalize"):
            stood, was_wrong = before, False
        if not leg["hypotheses"]:
            continue
        followed = leg["hypotheses"][leg["followed"]]
        start = pose_of(followed["start_pose"])
        is_wrong = apart(stood, start) > 1 or turned(stood, start) > 45
        if is_wrong and not was_wrong:
            wrong += 1
            sure += followed["posterior"] >= .9
        was_wrong = is_wrong
    return {"wrong": wrong, "sure": sure, "wrong_m": wrong_m, "legs": legs, "way_m": run["way_m"],
            "anew": run["num_relocalizations"], "switches": run["num_switches"], "reached": has_arrived(run),
            "says": run["reached"]}


def drive_all(cairn, folder, seed, num, planners):
    recipe, map_path, survey = paths_of(folder, seed)
    poses = survey_poses(survey)
    draw = random.Random(seed)
    done = {(row["seed"], row["run"], row["planner"]) for row in rows_of(folder)}
    num_done, index = 0, -1
    while num_done < num:
        start, goal, carried = draw_run(cairn, map_path, poses, planners, draw)
        index += 1
        if all((seed, index, name) in done for name in planners):
            num_done += 1
            continue
        rows = []
        for name, options in planners.items():
            begin = time.time()
            run = drive(cairn, map_path, recipe, start, goal, index + 1, "--kidnap", carried[name], "--threads", "1",
                        *STEERING, *options)
            if not run:  # in a wall
                break
            rows.append({"seed": seed, "run": index, "planner": name, **judge(run), "seconds": time.time() - begin})
        if len(rows) < len(planners):
            continue
        with open(os.path.join(folder, "runs.jsonl"), "a") as file:
            for row in rows:
                file.write(json.dumps(row) + "\n")
        print("; ".join(f"{row['planner']}: {row['wrong']} wrong, {row['way_m']:.1f} m, {row['seconds']:.1f} s" for row in rows),
              flush=True)
        num_done += 1


def rows_of(folder):
    path = os.path.join(folder, "runs.jsonl")
    return [json.loads(line) for line in open(path)] if os.path.exists(path) else []


def wilson(hits, num):
    """95 % interval of a share."""
    z, p = 1.96, hits / num
    middle, half = p + z * z / (2 * num), z * math.sqrt(p * (1 - p) / num + z * z / (4 * num * num))
    return (middle - half) / (1 + z * z / num), (middle + half) / (1 + z * z / num)


def fisher(a, num_a, b, num_b):
    """Two-sided: as unlikely tables as this one, or less likely."""
    def chance(k):
        return math.comb(num_a, k) * math.comb(num_b, a + b - k) / math.comb(num_a + num_b, a + b)
    likely = chance(a) * (1 + 1e-9)
    return min(1, sum(chance(k) for k in range(max(0, a + b - num_b), min(num_a, a + b) + 1) if chance(k) <= likely))


def mcnemar(only_a, only_b):
    """Exact, two-sided: pairs that differ go either way alike."""
    num, least = only_a + only_b, min(only_a, only_b)
    return min(1, 2 * sum(math.comb(num, k) for k in range(least + 1)) / 2 ** num)


def resampled(values, statistic, num=2000):
    """95 % interval of a statistic of runs."""
    draw = random.Random(0)
    found = sorted(statistic(draw.choices(values, k=len(values))) for _ in range(num))
    return found[num // 40], found[-num // 40]


def ratio_of(pairs):
    return sum(a for a, _ in pairs) / sum(b for _, b in pairs)


def table(folder, seeds):
    by_planner = {}
    for row in rows_of(folder):
        if row["seed"] in seeds:
            by_planner.setdefault(row["planner"], {})[row["seed"], row["run"]] = row
    first = next(iter(by_planner))
    print("| planner | runs | with a wrong place | Fisher, McNemar | sure of it | goal reached | way | over the shortest's |"
          " wrong way | looked anew |\n|---|--:|--:|---|--:|--:|--:|--:|--:|--:|")
    for name, rows in by_planner.items():
        both = sorted(rows.keys() & by_planner[first].keys())
        ours, theirs = [rows[key] for key in both], [by_planner[first][key] for key in both]
        num, wrong = len(ours), sum(row["wrong"] > 0 for row in ours)
        low, high = wilson(wrong, num)
        tests = ""
        if name != first:
            only_ours = sum(a["wrong"] > 0 and b["wrong"] == 0 for a, b in zip(ours, theirs))
            only_theirs = sum(a["wrong"] == 0 and b["wrong"] > 0 for a, b in zip(ours, theirs))
            tests = (f"{fisher(wrong, num, sum(row['wrong'] > 0 for row in theirs), num):.3f}, "
                     f"{mcnemar(only_ours, only_theirs):.3f} ({only_ours} : {only_theirs})")
        pairs = [(a["way_m"], b["way_m"]) for a, b in zip(ours, theirs)]
        ratio = ratio_of(pairs)
        least, most = resampled(pairs, ratio_of)
        print(f"| {name} | {num} | {wrong} ({100 * low:.1f} to {100 * high:.1f} %) | {tests} | "
              f"{sum(row['sure'] > 0 for row in ours)} | {sum(row['reached'] for row in ours)} | "
              f"{statistics.mean(row['way_m'] for row in ours):.1f} m | {ratio:.2f} ({least:.2f} to {most:.2f}) | "
              f"{statistics.mean(row['wrong_m'] for row in ours):.2f} m | {sum(row['anew'] for row in ours)} |")
    seconds = [row["seconds"] for rows in by_planner.values() for row in rows.values()]
    print(f"{len(seconds)} drives, {statistics.mean(seconds):.1f} s each")


def main():
    cairn, folder, what, text = sys.argv[1:5]
    seeds = []
    for part in text.split(","):
        low, _, high = part.partition("-")
        seeds += range(int(low), int(high or low) + 1)
    os.makedirs(folder, exist_ok=True)
    if what == "table":
        table(folder, seeds)
        return
    planners = {name: options.split() for name, _, options in (word.partition("=") for word in sys.argv[6:])} or PLANNERS
    for seed in seeds:
        make(cairn, folder, seed)
        if what == "drive":
            drive_all(cairn, folder, seed, int(sys.argv[5]), planners)


if __name__ == "__main__":
    main()
