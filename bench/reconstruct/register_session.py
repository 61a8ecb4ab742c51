#!/usr/bin/env python3
"""A session without poses beside one that has them: how much of it joins, how exactly, and does another place stay out?

usage: register_session.py [--cairn PROGRAM] [--work FOLDER] [kitchen] [rendered] [foreign] [twins] [update]

Each case is a recipe of two captures, compiled to its poses by `cairn compile --until reconstruct` with defaults; the second capture is
a folder of images.  kitchen: the real kitchen's survey (../shared/data/redkitchen_sfm), every second image or the second half
without poses and with an unknown camera.  rendered: a drive through a building, and another one in half the light after 30 % of its wall
panels were exchanged.  foreign: kitchen, corridor and demo offered to each other.  twins: of a building with two wings that look alike
but for one panel, or none, images of one wing offered to maps of both.  update: the kitchen's halves again, where only the first one's
map is left (`cairn update-map`), and how the held-out images fare in the old map, in the new one and in one of all images.  Errors are of the joined images' stated frame: nothing is fitted.
What is there is not made again.  Needs NumPy.
"""
import argparse
import json
import pathlib
import re
import subprocess

import numpy as np

from compare_mappers import read_poses

ROOT = pathlib.Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared/data"
ROOMS = ["--width-m", 10, "--depth-m", 8, "--num-rooms", 5, "--survey", "driven", "--num-queries", 0]
TWINS = ["--width-m", 14, "--depth-m", 8, "--twin-wings", "true", "--survey", "driven", "--num-queries", 0]


def render(cairn, folder, *options):
    if not folder.exists():
        subprocess.run([cairn, "stage", "simulate", *map(str, options), "--progress", "none", "-o", folder], check=True,
                       stdout=subprocess.DEVNULL)
    return folder


def image_lines(capture):
    lines = [line for line in (capture / "images.txt").read_text().splitlines() if line and line[0] != "#"]
    return sorted((line for line in lines if len(line.split()) == 10), key=lambda line: line.split()[9])


def part_of(capture, folder, lines, is_posed):
    """These of a capture's images as one of their own; the poses of those that have none lie beside it."""
    (folder / "images").mkdir(parents=True, exist_ok=True)
    for line in lines:
        link = folder / "images" / line.split()[9]
        if not link.is_symlink():
            link.symlink_to((capture / "images" / link.name).resolve())
    text = "".join(line + "\n\n" for line in lines)
    if is_posed:
        (folder / "images.txt").write_text(text)
        (folder / "cameras.txt").write_text((capture / "cameras.txt").read_text())
    else:
        folder.with_name(folder.name + ".truth.txt").write_text(text)
    return folder


def joined_cells(name, poses, new):
    found = {re.sub("^new/", "", key): pose for key, pose in read_poses(poses / "images.txt").items() if key.startswith("new/")}
    truth_list = new.with_name(new.name + ".truth.txt")
    num_images = len(list(new.rglob("*.jpg"))) + len(list(new.rglob("*.png")))
    cells = [name, f"{len(found)} of {num_images}"]
    if not truth_list.exists() or not found:
        return cells + ["", "", "0" if not found else "?"]
    truth = read_poses(truth_list)
    distances = np.array([100 * np.linalg.norm(found[key][1] - truth[key][1]) for key in found])
    angles = np.array([np.degrees(np.arccos(np.clip((np.trace(truth[key][0] @ found[key][0].T) - 1) / 2, -1, 1))) for key in found])
    return cells + [f"{np.median(distances):.2f} cm, {np.median(angles):.3f}°", f"{distances.max():.2f} cm, {angles.max():.3f}°",
                    f"{(distances > 50).sum()}"]


def join(cairn, work, name, old, new):
    recipe, poses = work / f"{name}.toml", work / f"{name}.build/poses"
    recipe.write_text(f'name = "{name}"\n[[capture]]\npath = "{old}"\nname = "old"\n[[capture]]\npath = "{new}"\nname = "new"\n')
    if not poses.exists():
        subprocess.run([cairn, "compile", recipe, "-o", work / f"{name}.cairn", "--until", "reconstruct", "--progress", "none",
                        "--log-level", "error"], check=True, stdout=subprocess.DEVNULL)
    print("| " + " | ".join(joined_cells(name, poses, new)) + " |", flush=True)


def kitchen(cairn, work):
    capture = DATA / "redkitchen_sfm"
    lines = image_lines(capture)
    for name, is_old in (("alternating", lambda i: i % 2 == 0), ("halves", lambda i: i < len(lines) // 2)):
        old = part_of(capture, work / f"kitchen_{name}_old", [line for i, line in enumerate(lines) if is_old(i)], True)
        new = part_of(capture, work / f"kitchen_{name}_new", [line for i, line in enumerate(lines) if not is_old(i)], False)
        join(cairn, work, f"kitchen_{name}", old, new)


def rendered(cairn, work):
    for seed in (13, 14, 15):
        old = render(cairn, work / f"rooms{seed}", *ROOMS, "--seed", seed)
        changed = render(cairn, work / f"rooms{seed}_changed", *ROOMS, "--seed", seed, "--run", 1, "--light-ratio", 0.5, "--change", 1)
        join(cairn, work, f"rendered_{seed}", old, part_of(changed, work / f"rooms{seed}_new", image_lines(changed), False))


def foreign(cairn, work):
    demo = render(cairn, work / "demo", ROOT / "maps/demo/recipe.toml")
    room = DATA / "redkitchen_sfm"
    bare = {"demo": part_of(demo, work / "demo_new", image_lines(demo), False),
            "kitchen": part_of(room, work / "kitchen_new", image_lines(room), False), "corridor": DATA / "corridor"}
    for old, capture in (("kitchen", room), ("demo", demo)):
        for new in bare:
            if new != old:
                join(cairn, work, f"foreign_{new}_to_{old}", capture, bare[new])


def twins(cairn, work):
    for num_different in (1, 0):
        surveys = [render(cairn, work / f"twins{num_different}_{run}", *TWINS, "--seed", 5, "--run", run, "--num-different-panels",
                          num_different) for run in (0, 1)]
        centres = [{key: pose[1] for key, pose in read_poses(survey / "images.txt").items()} for survey in surveys]

        def wing(run, is_in):
            return [line for line in image_lines(surveys[run]) if is_in(*centres[run][line.split()[9]][:2])]
        old = part_of(surveys[0], work / f"twins{num_different}_old", wing(0, lambda x, y: x < 7.5 and y > 1.7), True)
        for name, is_in in (("first", lambda x, y: x < 3.5 and y > 1.7), ("second", lambda x, y: 4 < x < 7.5 and y > 1.7)):
            new = part_of(surveys[1], work / f"twins{num_different}_{name}", wing(1, is_in), False)
            join(cairn, work, f"twins_{num_different}_different_{name}_wing", old, new)


def compiled(cairn, map_path, *words):
    if not map_path.exists():
        subprocess.run([cairn, *words, "-o", map_path, "--progress", "none", "--log-level", "error"], check=True, stdout=subprocess.DEVNULL)
    return map_path


def update(cairn, work):
    capture = DATA / "redkitchen_sfm"
    lines = image_lines(capture)
    whole = compiled(cairn, work / "update_whole.cairn", "compile", part_of(capture, work / "update_whole", lines, True))
    rows = []
    for name, is_old in (("alternating", lambda i: i % 2 == 0), ("halves", lambda i: i < len(lines) // 2)):
        folder = work / f"update_{name}"
        old = part_of(capture, folder / "kitchen", [line for i, line in enumerate(lines) if is_old(i)], True)
        new = part_of(capture, folder / "new", [line for i, line in enumerate(lines) if not is_old(i)], False)
        old_map = compiled(cairn, folder / "old.cairn", "compile", old)
        new_map = compiled(cairn, folder / "updated.cairn", "update-map", old_map, new)
        print("| " + " | ".join(joined_cells(f"update_{name}", folder / "updated.build/poses", new)) + " |", flush=True)
        rows += [(f"{name}, old map", old_map), (f"{name}, updated", new_map)]
    print("\n| map | held-out images localized | median error | landmarks, kB |\n|---|---|---|---|")
    for name, path in rows + [("of all images, posed", whole)]:
        answer = json.loads(subprocess.run([cairn, "check", path, "--queries", capture / "queries.txt", "--capture", capture, "--json",
                                            "--progress", "none"], check=True, capture_output=True).stdout)
        num_held_out = round(answer["num_held_out"])
        print(f"| {name} | {round(num_held_out * answer['localized_ratio'])} of {num_held_out} | {100 * answer['median_error_m']:.2f} cm, "
              f"{answer['median_error_deg']:.3f}° | {answer['num_landmarks']}, {answer['map_bytes'] / 1000:.0f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cairn", type=pathlib.Path, default=ROOT / "build/release/cairn")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "build/bench/register_session")
    cases = {"kitchen": kitchen, "rendered": rendered, "foreign": foreign, "twins": twins, "update": update}
    parser.add_argument("cases", nargs="*", help=", ".join(cases))
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    print("| case | joined | median error | largest | in a wrong place (50 cm) |\n|---|---|---|---|---|")
    for name in arguments.cases or cases:
        cases[name](arguments.cairn.resolve(), arguments.work.resolve())


if __name__ == "__main__":
    main()
