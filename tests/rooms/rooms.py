#!/usr/bin/env python3
"""Which folder may know which: the house's rooms, from the ground up.

usage: rooms.py ROOT

A room is a folder of C++ sources below core, runtime, sim, stages or pipeline.  It includes headers of its own and of
rooms that stand before it here, by their path from the project's root, and lives in the namespace of its part.  Stages
know no other stage.
"""

import collections
import pathlib
import re
import sys

# What a room is for stands in its CMakeLists.txt.
ORDER = """
core/threads core/base core/files core/modules core/images core/options core/geometry core/picture core/sift core/features core/learned core/work core/camera core/vocabulary core/colmap core/feature_files core/structure
core/capture core/plan core/world core/promise core/packing core/blocks core/seal core/map core/delta core/atlas core/line core/view_regions
runtime/map runtime/localize runtime/track runtime/scans runtime/laser runtime/beams runtime/belief runtime/paths runtime/looks runtime/visual_map runtime/drive runtime/atlas runtime/robot_log runtime/c_api runtime/c_api/plans
sim/render sim/survey sim/robot sim/worlds
stages/simulate
stages/extract_features
stages/match_features/pairs stages/match_features/two_views stages/match_features
stages/reconstruct/view_graph stages/reconstruct/globally stages/reconstruct/registration stages/reconstruct/inertial stages/reconstruct/verdict stages/reconstruct/by_colmap stages/reconstruct
stages/group_classes/persistence stages/group_classes/tracks stages/group_classes/adjust stages/group_classes
stages/filter_visibility
stages/decompose_regions/cover stages/decompose_regions/algorithms stages/decompose_regions
stages/build_vocabulary
stages/link_appearance/dominating_set stages/link_appearance
stages/decompose_views/formats stages/decompose_views/plan stages/decompose_views
stages/emit_map/previous stages/emit_map/choose stages/emit_map stages/emit_map/leave_out
stages/check_map
pipeline/build pipeline/program pipeline/explain pipeline/report pipeline/exchange/export pipeline/exchange/import pipeline/exchange/film
pipeline/exchange/bags/files pipeline/exchange/bags
pipeline/atlas pipeline/commands pipeline
""".split()
# What robots' authors write, and Python's module: nobody includes them.
CLIENTS = ("runtime/examples", "runtime/examples/robot", "runtime/python")
PARTS = ("core", "runtime", "sim", "stages", "pipeline")

# Sources of one name count once.  More than these are hard to overlook.
MAX_SOURCES = 12
LARGER = {
    "core/features": "the matching kernel, once for each instruction set",
    "pipeline/commands": "a file for each command",
}

INCLUDE = re.compile(r'^#\s*include\s+"([^"]+)"', re.M)
NAMESPACE = re.compile(r"^namespace (cairn[\w:]*)", re.M)


def namespace_of(room):
    """core and runtime share `cairn`, which a robot's program names; the other parts have their own, stages one each."""
    part, _, rest = room.partition("/")
    if part in ("core", "runtime"):
        return "cairn"
    return "cairn::" + (rest.split("/")[0] if part == "stages" else part)


def stage_of(room):
    return room.split("/")[1] if room.startswith("stages/") else None


def faults(root):
    """Sentences, one for each fault."""
    place = {room: i for i, room in enumerate(ORDER)}
    names = collections.defaultdict(set)
    found = []
    for part in PARTS:
        for path in sorted((root / part).rglob("*")):
            if path.suffix not in (".h", ".cc"):
                continue
            file = path.relative_to(root)
            room = str(file.parent)
            if room not in place and room not in CLIENTS:
                found.append(f"{file}: {room} is no room yet; give it a place in tests/rooms/rooms.py")
                continue
            names[room].add(path.stem)
            text = path.read_text(encoding="utf-8")
            for include in INCLUDE.findall(text):
                target = str(pathlib.PurePath(include).parent)
                if not (root / include).is_file():
                    if room in place and (path.parent / include).is_file():
                        found.append(f'{file}: includes "{include}"; write its path from the project\'s root')
                    continue  # made by the build
                if target in CLIENTS and target != room:
                    found.append(f"{file}: includes {include}, which is for its readers alone")
                elif target in place and room in place:
                    if place[target] > place[room]:
                        found.append(f"{file}: includes {include}, but {target} stands above {room}; move what both need down")
                    elif stage_of(target) and stage_of(room) and stage_of(target) != stage_of(room):
                        found.append(f"{file}: includes {include}, another stage's; move what both need into core")
            if room in place:
                for namespace in NAMESPACE.findall(text):
                    if namespace.split("::")[: len(namespace_of(room).split("::"))] != namespace_of(room).split("::"):
                        found.append(f"{file}: is in namespace {namespace}, expected {namespace_of(room)}")
    for room, stems in sorted(names.items()):
        if len(stems) > MAX_SOURCES and room not in LARGER:
            found.append(f"{room}: has {len(stems)} sources, at most {MAX_SOURCES} are overlooked at once; split it by subject")
    for room in ORDER:
        if room not in names:
            found.append(f"{room}: has no sources; take it out of tests/rooms/rooms.py")
    return found


def main():
    found = faults(pathlib.Path(sys.argv[1]))
    for fault in found:
        print(fault)
    print(f"{len(ORDER)} rooms, {len(found)} faults")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
