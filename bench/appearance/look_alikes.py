#!/usr/bin/env python3
"""Links that only look alike, in twin wings: posed, and with the poses withheld, in order and shuffled.

usage: look_alikes.py [--cairn PROGRAM] [--work FOLDER] [--kinds posed,withheld,shuffled] [--simulate KEY=VALUE]... SEED...

Renders the twin wings of maps/drive_twins by each seed, compiles the survey by default options up to the appearance graph, and
holds it against the true poses.  A link truly is one where half of its matches are within 4 pixels of where a point up to the
building's diagonal away would be seen.  "Routes": links of the graph between images of different wings.  Entropy: the median of
the images in the wings.  Pairs found: of the images of the wings, those confusable with an image that stands within 1 m of where
its twin would stand, if there is one within 0.5 m and 15 degrees.  Prints a row a seed and kind.  Needs numpy.
"""
import argparse
import pathlib
import random
import shutil
import sqlite3
import subprocess
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "reconstruct"))
from compare_mappers import errors, read_poses

SIMULATE = {"width_m": "12", "depth_m": "8", "twin_wings": "true", "num_different_panels": "1", "repetition_ratio": "0",
            "image_width_px": "320", "image_height_px": "240", "horizontal_fov_deg": "90", "survey": '"driven"', "step_m": "0.3",
            "num_queries": "20"}
CORRIDOR_M, WALL_M, MARGIN_M, OFFSET_M = 1.7, 0.15, 0.9, 3.654  # sim/render/twin_wings.cc
MIN_NUM_INLIERS, MAX_ERROR_PX, NEAR_M = 15, 4, 0.1


def wing_of(centre):
    """0 or 1, -1 outside of both."""
    for wing in (0, 1):
        low = MARGIN_M + wing * OFFSET_M
        if low <= centre[0] <= low + CORRIDOR_M and centre[1] > CORRIDOR_M + WALL_M:
            return wing
    return -1


def pixels(points, camera):
    fx, fy, cx, cy = camera
    return np.stack([fx * points[:, 0] / points[:, 2] + cx, fy * points[:, 1] / points[:, 2] + cy], 1)


def true_part(pixels1, pixels2, pose1, pose2, camera, far_m):
    """Part of the matches of which the second is where the first's ray may be seen: near the image of the ray, NEAR_M to far_m away."""
    fx, fy, cx, cy = camera
    rays = np.stack([(pixels1[:, 0] - cx) / fx, (pixels1[:, 1] - cy) / fy, np.ones(len(pixels1))], 1) @ pose1[0] @ pose2[0].T
    start = pose2[0] @ (pose1[1] - pose2[1])
    near, far = start + NEAR_M * rays, start + far_m * rays
    near = np.where(near[:, 2:] < NEAR_M, near + (far - near) * ((NEAR_M - near[:, 2:]) / (far[:, 2:] - near[:, 2:])), near)
    is_seen = far[:, 2] > NEAR_M
    near, far = pixels(near, camera), pixels(far, camera)
    along = far - near
    part = np.clip(np.sum((pixels2 - near) * along, 1) / np.maximum(np.sum(along**2, 1), 1e-12), 0, 1)
    distances = np.linalg.norm(near + part[:, None] * along - pixels2, axis=1)
    return np.mean(is_seen & (distances < MAX_ERROR_PX))


def read_links(matches_path, true, name_of, camera, far_m):
    """{(name, name): whether it truly is a link} of pairs with enough inliers."""
    database = sqlite3.connect(f"file:{matches_path}?immutable=1", uri=True)
    names = {i: name_of(name) for i, name in database.execute("SELECT image_id, name FROM images")}
    keypoints = {i: np.frombuffer(blob, np.float32).reshape(rows, cols)[:, :2].astype(float)
                 for i, rows, cols, blob in database.execute("SELECT image_id, rows, cols, data FROM keypoints") if rows}
    links = {}
    for pair_id, rows, config, blob in database.execute("SELECT pair_id, rows, config, data FROM two_view_geometries"):
        image2, image1 = pair_id % 2147483647, pair_id // 2147483647
        if rows < MIN_NUM_INLIERS or config < 2 or config == 7 or names[image1] not in true or names[image2] not in true:
            continue
        matches = np.frombuffer(blob, np.uint32).reshape(rows, 2)
        part = true_part(keypoints[image1][matches[:, 0]], keypoints[image2][matches[:, 1]], true[names[image1]],
                         true[names[image2]], camera, far_m)
        links[tuple(sorted((names[image1], names[image2])))] = part >= 0.5
    return links


def read_graph(appearance_path, matches_path, name_of):
    """Links, entropies by name, and confusable pairs."""
    names = {i: name_of(name) for i, name in
             sqlite3.connect(f"file:{matches_path}?immutable=1", uri=True).execute("SELECT image_id, name FROM images")}
    database = sqlite3.connect(f"file:{appearance_path}?immutable=1", uri=True)
    nodes, neighbours, entropies = {}, {}, {}
    for node, images, blob, entropy in database.execute("SELECT node_idx, images, neighbours, entropy FROM nodes"):
        nodes[node] = names[int(np.frombuffer(images, np.int32)[0])]
        neighbours[node] = np.frombuffer(blob, np.int32)
        entropies[nodes[node]] = entropy / 1000
    links = {tuple(sorted((nodes[a], nodes[int(b)]))) for a in nodes for b in neighbours[a]}
    confusable = {tuple(sorted((nodes[a], nodes[b]))) for a, b in database.execute("SELECT node1, node2 FROM confusable")}
    return links, entropies, confusable


def is_twin_place(pose, other, far_m, turn_deg):
    """Whether `other` stands and looks where `pose` would in the other wing."""
    shift = OFFSET_M if wing_of(pose[1]) == 0 else -OFFSET_M
    turn = np.degrees(np.arccos(np.clip((np.trace(pose[0] @ other[0].T) - 1) / 2, -1, 1)))
    return np.linalg.norm(pose[1] + [shift, 0, 0] - other[1]) < far_m and turn < turn_deg


def pairs_found(true, images, confusable):
    """How many images with a twin are confusable with one near it, and how many have one."""
    partners = {}
    for a, b in confusable:
        partners.setdefault(a, []).append(b)
        partners.setdefault(b, []).append(a)
    num_found = num = 0
    for name in images:
        wing = wing_of(true[name][1])
        if wing < 0 or not any(wing_of(true[other][1]) == 1 - wing and is_twin_place(true[name], true[other], 0.5, 15)
                               for other in images):
            continue
        num += 1
        num_found += any(wing_of(true[other][1]) == 1 - wing and is_twin_place(true[name], true[other], 1, 180)
                         for other in partners.get(name, []))
    return num_found, num


def compile_survey(cairn, recipe, work):
    with open(work / "log.txt", "w") as log:
        done = subprocess.run([cairn, "compile", recipe, "-o", work / "map.cairn", "--build-dir", work / "map.build", "--until",
                               "link-appearance", "--progress", "none"], stdout=log, stderr=log)
    return done.returncode == 0


def withhold_poses(capture, names, bare, seed):
    """A folder of the images alone; returns the true name of each."""
    shutil.rmtree(bare, ignore_errors=True)
    (bare / "images").mkdir(parents=True)
    order = list(range(len(names)))
    if seed is not None:
        random.Random(seed).shuffle(order)
    true_names = {}
    for name, number in zip(names, order):
        new = name if seed is None else f"s{number:05d}{pathlib.Path(name).suffix}"
        shutil.copy(capture / "images" / name, bare / "images" / new)
        true_names[new] = name
    return true_names


def row(kind, seed, true, build, true_names, camera, far_m):
    name_of = lambda name: true_names.get(name, name)
    truth = read_links(build / "matches.db", true, name_of, camera, far_m)
    links, entropies, confusable = read_graph(build / "appearance.db", build / "matches.db", name_of)
    images = [name for name in entropies if name in true]
    kept = {pair: is_true for pair, is_true in truth.items() if pair[0] in entropies and pair[1] in entropies}
    wings = {name: wing_of(true[name][1]) for name in images}
    between = lambda pair: {wings[pair[0]], wings[pair[1]]} == {0, 1}
    alike = [pair for pair, is_true in kept.items() if not is_true]
    alike_between = [pair for pair in alike if between(pair)]
    true_links = [pair for pair, is_true in kept.items() if is_true]
    in_wings = [entropies[name] for name in images if wings[name] >= 0]
    place = ""
    if kind != "posed":
        found = {name_of(name): pose for name, pose in read_poses(build / "poses" / "images.txt").items()}
        distances, _ = errors(found, true)
        place = f"{100 * np.median(distances):.2f}, {100 * np.max(distances):.1f} cm"
    found, num = pairs_found(true, images, confusable)
    print(f"| {seed} | {kind} | {len(images)} of {len(true)} | {place} | {len(kept)} | "
          f"{len(alike_between)}: {sum(p not in links for p in alike_between)} | "
          f"{len(alike)}: {sum(p not in links for p in alike)} | {len(true_links)}: {sum(p not in links for p in true_links)} | "
          f"{sum(between(p) for p in links)} | {np.median(in_wings):.3f} | {found} of {num} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("seeds", nargs="+", type=int)
    parser.add_argument("--cairn", default="build/release/cairn")
    parser.add_argument("--work", type=pathlib.Path, default=pathlib.Path("build/bench/look_alikes"))
    parser.add_argument("--kinds", default="posed,withheld,shuffled")
    parser.add_argument("--simulate", action="append", default=[], help="KEY=VALUE of [simulate]")
    arguments = parser.parse_args()
    simulate = {**SIMULATE, **dict(pair.split("=", 1) for pair in arguments.simulate)}
    far_m = float(np.hypot(float(simulate["width_m"]), float(simulate["depth_m"])))
    print("| seed | poses | images | error: median, largest | pairs | look-alikes between the wings: told | look-alikes: told | "
          "true links: lost | routes between the wings | entropy | twins found |\n|---|---|---|---|---|---|---|---|---|---|---|")
    variant = "".join(f"_{pair.replace('=', '_')}" for pair in arguments.simulate)
    for seed in arguments.seeds:
        work = arguments.work / f"{seed}{variant}"
        posed = work / "posed"
        posed.mkdir(parents=True, exist_ok=True)
        recipe = posed / "map.toml"
        recipe.write_text(f'name = "twins"\nseed = {seed}\n[simulate]\n' + "".join(f"{k} = {v}\n" for k, v in simulate.items()))
        compile_survey(arguments.cairn, recipe, posed)
        capture = posed / "map.build" / "capture"
        true = read_poses(capture / "images.txt")
        camera = [float(word) for line in (capture / "cameras.txt").read_text().splitlines() if not line.startswith("#")
                  for word in line.split()[4:]]
        for kind in arguments.kinds.split(","):
            folder, true_names = work / kind, {}
            if kind != "posed":
                folder.mkdir(exist_ok=True)
                true_names = withhold_poses(capture, sorted(true), folder / "bare", None if kind == "withheld" else seed)
                (folder / "map.toml").write_text('name = "twins"\n[capture]\npath = "bare"\n')
                if not compile_survey(arguments.cairn, folder / "map.toml", folder):
                    print(f"| {seed} | {kind} | no map: {(folder / 'log.txt').read_text().strip().splitlines()[-1]} |")
                    continue
            row(kind, seed, true, folder / "map.build", true_names, camera, far_m)


if __name__ == "__main__":
    main()
