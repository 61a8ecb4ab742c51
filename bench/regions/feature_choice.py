#!/usr/bin/env python3
"""Held-out localization with and without the choice of features by pose, at equal k.

  bench/regions/feature_choice.py maps/demo.build [--k 5,10,20,40] [--algorithm best] [--set min_kept_ratio=1]

Of a build folder that `cairn compile` has filled, divides the world into regions, keeps their features as landmarks and
localizes the capture's queries; for every k with the features that the algorithm found ("cover") and with those that fix
poses best ("pose").  Errors are of the queries that both maps localize.
"""
import argparse
import json
import math
import pathlib
import subprocess


def quantile(values, part):
    """The least value that at least `part` of them do not exceed, as check-map has it."""
    values = sorted(values)
    return values[max(0, math.ceil(part * len(values)) - 1)] if values else math.nan


def mean(values):
    return sum(values) / len(values) if values else math.nan


def config(build):
    """CAPTURE and QUERIES as `cairn stage configure` wrote them."""
    lines = (line.split(" := ", 1) for line in (build / "config.mk").read_text().splitlines() if " := " in line)
    values = {name: value.strip() for name, value in lines}
    return values["CAPTURE"], values.get("QUERIES") or values["CAPTURE"] + "/queries.txt"


def localize(arguments, k, choice, work):
    """check-map's report of the map with these landmarks."""
    build, cairn = arguments.build, arguments.cairn
    capture, queries = config(build)
    regions, landmarks = work / f"regions{k}_{choice}.json", work / f"k{k}_{choice}.cairn"
    report = landmarks.with_suffix(".json")
    options = [item for pair in arguments.set for item in ("--" + pair.split("=")[0].replace("_", "-"), pair.split("=")[1])]
    for command in (
        [cairn, "stage", "decompose-regions", build / "world.db", "--classes", build / "classes.db",
         "--options", build / "options/decompose_regions.toml", "--algorithm", arguments.algorithm, "--k", k,
         "--feature-choice", choice, *options, "-o", regions],
        [cairn, "stage", "emit-map", "--classes", build / "classes.db", "--world", build / "world.db",
         "--vocabulary", build / "vocabulary.db", "--regions", regions, "--name", landmarks.stem,
         "--landmarks", "regions", "-o", landmarks],
    ):
        subprocess.run([str(word) for word in command] + ["--progress", "none", "--log-level", "error"], check=True,
                       stdout=subprocess.DEVNULL)
    with report.open("w") as file:
        subprocess.run([str(word) for word in (cairn, "check", landmarks, "--capture", capture, "--queries",
                                               arguments.queries or queries, "--json", "--progress", "none")],
                       check=True, stdout=file)
    result = json.loads(report.read_text())
    decomposition = json.loads(regions.read_text())
    result["poses_per_region"] = sum(len(r["poses"]) for r in decomposition["regions"]) / len(decomposition["regions"])
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--k", default="5,10,20,40")
    parser.add_argument("--algorithm", default="best")
    parser.add_argument("--queries", help="another list than the capture's")
    parser.add_argument("--set", action="append", default=[], metavar="OPTION=VALUE", help="of decompose-regions")
    parser.add_argument("--cairn", default="build/release/cairn")
    arguments = parser.parse_args()
    work = arguments.build / "feature_choice" / arguments.algorithm
    work.mkdir(parents=True, exist_ok=True)
    print("| k | features | regions | stations a region | landmarks | localized | wrong | by both | mean, cm | median, cm |"
          " 90 %, cm | mean, deg |\n|---|---|---|---|---|---|---|---|---|---|---|---|")
    for k in arguments.k.split(","):
        reports = {choice: localize(arguments, k, choice, work) for choice in ("cover", "pose")}
        found = {choice: {image["name"]: image for image in report["images"] if "error_m" in image}
                 for choice, report in reports.items()}
        common = sorted(found["cover"].keys() & found["pose"].keys())
        for choice, report in reports.items():
            metres = [found[choice][name]["error_m"] for name in common]
            degrees = [found[choice][name]["error_deg"] for name in common]
            print(f"| {k} | {choice} | {report['num_regions']} | {report['poses_per_region']:.1f} |"
                  f" {report['num_landmarks']} | {report['num_localized']:.0f} of {report['num_held_out']:.0f} |"
                  f" {report['num_gross_errors']:.0f} | {len(common)} | {100 * mean(metres):.2f} |"
                  f" {100 * quantile(metres, 0.5):.2f} | {100 * quantile(metres, 0.9):.2f} | {mean(degrees):.2f} |",
                  flush=True)


if __name__ == "__main__":
    main()
