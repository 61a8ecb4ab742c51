#!/usr/bin/env python3
"""How long a compile takes to end after Ctrl-C, stage by stage.

    bench/crash/stop_delay.py CAIRN RECIPE FOLDER [TRIES]

Compiles the recipe in FOLDER once; then, TRIES times per stage, has the stage run again and sends SIGINT to the
process group at a random moment of it.  Prints the median and the longest delay until `cairn compile` has ended.
"""
import glob
import json
import os
import random
import shutil
import signal
import statistics
import subprocess
import sys
import time

STAMPS = {"simulate": "capture", "extract_features": "features.db", "match_features": "matches.db", "reconstruct": "poses",
          "group_classes": "classes.db", "filter_visibility": "world.db", "decompose_regions": "regions.db",
          "build_vocabulary": "vocabulary.db", "emit_map": "unsealed.cairn", "check_map": "map"}


def forget(build, name):
    os.remove(f"{build}/{name}.stamp")
    output = f"{build}/{name}"
    if os.path.isdir(output) and not os.path.islink(output):
        shutil.rmtree(output)
    elif os.path.exists(output):
        os.remove(output)


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    cairn, recipe, folder = sys.argv[1:4]
    tries = int(sys.argv[4]) if len(sys.argv) > 4 else 5
    build, kept = f"{folder}/m.build", f"{folder}/kept"
    command = [cairn, "compile", recipe, "-o", f"{folder}/m.cairn", "--progress", "none", "--log-level", "off"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    os.makedirs(folder, exist_ok=True)
    subprocess.run(command, check=True, **quiet)
    with open(f"{folder}/m.report.json", encoding="utf-8") as file:
        stages = json.load(file)["stages"]
    shutil.rmtree(kept, ignore_errors=True)
    shutil.copytree(build, kept, symlinks=True)
    rng = random.Random(1)
    print(f"{'stage':<20} {'seconds':>8} {'median delay':>13} {'longest':>8}   codes")
    for stage in stages:
        name = STAMPS[stage["stage"]]
        delays, codes = [], set()
        for _ in range(tries):
            forget(build, name)
            process = subprocess.Popen(command, start_new_session=True, **quiet)
            while process.poll() is None and not glob.glob(f"{build}/{name}.stamp.tmp-*"):
                time.sleep(0.002)
            time.sleep(rng.random() * stage["seconds"])
            begin = time.monotonic()
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
            codes.add(process.wait())
            delays.append(time.monotonic() - begin)
            left = glob.glob(f"{build}/**/*.tmp-*", recursive=True)
            assert not left, left
            shutil.rmtree(build)
            shutil.copytree(kept, build, symlinks=True)
        print(f"{stage['stage']:<20} {stage['seconds']:>8.2f} {statistics.median(delays):>13.2f} {max(delays):>8.2f}   "
              f"{sorted(codes)}", flush=True)
    shutil.rmtree(kept)


main()
