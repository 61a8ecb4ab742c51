#!/usr/bin/env python3
"""The source's experiments [Sala06] by one command, beside the source's figures.

usage: bench/reproduce.py BUILD OUT [--worlds N] [--survey RECIPE.toml] [options]

BUILD has the programs cairn, regions_tables, survey_areas and visual_map_tables.  OUT gets README.md with all tables,
what they were made of (worlds.csv, areas.csv, survey.csv, visual_map.csv) and the pictures (fig9.svg, fig10.svg).  What
OUT/survey.build has of an earlier run is not made again.
"""

import argparse
import collections
import csv
import pathlib
import re
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
ALGORITHMS = {"a1": "A.1", "a2": "A.2", "a3": "A.3", "b1": "B.1", "b2": "B.2", "c": "C"}
# [Sala06 Table V, Table VI]: landmarks, MB, mean error (cm), s a pose, mean of KL, its standard deviation.
SOURCE_MAPS = {
    "all": (554, 9.2, 18.66, 25.91, None, None),
    "k10_tau0": (72, 3.1, 29.75, 10.56, 0.3472, 0.1355),
    "k10_tau1": (85, 3.4, 31.34, 11.02, 0.3561, 0.1595),
    "k4_tau0": (23, 1.5, 64.48, 5.82, 0.6522, 0.2678),
    "k4_tau1": (28, 1.6, 50.42, 6.72, 0.5943, 0.2457),
}
# [Sala06 §VI-B]: features seen from 16 places, those that the filter leaves; their areas' mean and median; regions.
SOURCE_AREAS = {"before": (897, None, None), "after": (554, 33, 23)}
SOURCE_REGIONS = {"k4_tau0": 7, "k4_tau1": 9}


def say(text):
    print(f"reproduce: {text}", file=sys.stderr, flush=True)


def run(command, **options):
    return subprocess.run([str(word) for word in command], check=True, cwd=ROOT, **options)


def read_csv(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(str(cell) for cell in line) + " |\n" for line in lines)


def beside(value, source, digits):
    """Ours, and the source's in brackets."""
    text = "–" if value in ("", None) else f"{float(value):.{digits}f}"
    return text if source in ("", None) else f"{text} ({float(source):g})"


def mean_and_deviation(mean, deviation):
    return "–" if mean == "" else f"{float(mean):.3f} ± {float(deviation):.3f}"


# --- Simulated worlds: Tables II and III


def world_tables(rows):
    """Tables II and III with what belongs to them, from the lines of regions_tables --csv."""
    groups = collections.defaultdict(list)
    for row in rows:
        groups[int(row["setting"]), row["algorithm"]].append(row)
    settings = sorted({setting for setting, _ in groups})

    def mean(setting, algorithm, column):
        return statistics.fmean(float(row[column]) for row in groups[setting, algorithm])

    def lines(column, digits, source=None):
        return [
            [setting, *(beside(mean(setting, a, column), source and groups[setting, a][0][source], digits) for a in ALGORITHMS)]
            for setting in settings
        ]

    head = lambda what: [what, *ALGORITHMS.values()]
    densities = [
        [setting, len(groups[setting, "b2"]), *(f"{mean(setting, 'b2', column):.0f}" for column in ("stations", "coverable", "visible"))]
        for setting in settings
    ]
    return (
        table(["setting", "worlds", "stations", "coverable", "features visible from one"], densities)
        + "\nTable II, mean number of regions (source):\n\n"
        + table(head("setting"), lines("regions", 2, "source_regions"))
        + "\nTable III, mean stations of a region before it grows by tau (source, which does not say which):\n\n"
        + table(head("setting"), lines("stations_a_region", 2, "source_stations_a_region"))
        + "\nThe same after it has grown:\n\n"
        + table(head("setting"), lines("grown", 2))
        + "\nCoverable stations that are in no region, since rho lets small remainders go (mean):\n\n"
        + table(head("setting"), lines("uncovered", 1))
        + "\nLandmarks, the union of all regions' k features (mean; Fig. 7 has no numbers):\n\n"
        + table(head("setting"), lines("landmarks", 1))
    )


# --- A rendered survey: Figs. 9 and 10, Tables V and VI


def compile_survey(cairn, recipe, seed, out):
    """Everything of the survey that maps are made of; returns its build folder."""
    text = pathlib.Path(recipe).read_text(encoding="utf-8")
    text, num = re.subn(r"(?m)^seed = \d+$", f"seed = {seed}", text)
    if num != 1:
        raise SystemExit(f"{recipe}: expected one line 'seed = N'")
    (out / "survey.toml").write_text(text, encoding="utf-8")
    for stage in ("filter_visibility", "build_vocabulary"):
        run([cairn, "compile", out / "survey.toml", "-o", out / "survey.cairn", "--until", stage])
    return out / "survey.build"


def area_table(rows):
    source = lambda row, i: SOURCE_AREAS[row["areas"]][i]
    return table(
        ["areas", "features", "mean stations", "median", "with holes", "holes a feature", "stations a hole"],
        [
            [
                row["areas"] + " the filter",
                beside(row["features"], source(row, 0), 0),
                beside(row["mean_stations"], source(row, 1), 1),
                beside(row["median_stations"], source(row, 2), 0),
                row["with_holes"],
                row["holes_per_feature"],
                row["stations_per_hole"],
            ]
            for row in rows
        ],
    )


def map_tables(rows, regions):
    """Tables V and VI, from the lines of visual_map_tables --csv and the number of regions of each map."""
    whole = float(rows[0]["lattice_mean_cm"])
    source_whole = SOURCE_MAPS["all"][2]
    lines = []
    for row in rows:
        name = row["map"]
        source = SOURCE_MAPS.get(name, (None,) * 6)
        ratio = beside(float(row["lattice_mean_cm"]) / whole, source[2] and round(source[2] / source_whole, 2), 2)
        lines.append(
            [
                name,
                beside(regions.get(name), SOURCE_REGIONS.get(name), 0),
                beside(row["landmarks"], source[0], 0),
                beside(row["megabytes"], source[1], 2),
                beside(row["lattice_mean_cm"], source[2], 1),
                ratio,
                f"{float(row['lattice_median_cm']):.1f}",
                f"{row['without_match']} of {row['queries']}",
                beside(row["seconds"], source[3], 2),
            ]
        )
    text = "Table V (source), every query counted, by the likeliest place of the lattice:\n\n" + table(
        ["map", "regions", "landmarks", "MB", "mean error, cm", "of all features'", "median", "queries without a match", "s a pose"], lines
    )
    lines = []
    for row in rows[1:]:
        source = SOURCE_MAPS.get(row["map"], (None,) * 6)
        lines.append(
            [
                row["map"],
                mean_and_deviation(row["kl_mean"], row["kl_sd"]) + (f" ({source[4]:g} ± {source[5]:g})" if source[4] else ""),
                mean_and_deviation(row["kl_reverse_mean"], row["kl_reverse_sd"]),
                mean_and_deviation(row["our_kl_mean"], row["our_kl_sd"]),
            ]
        )
    text += "\nTable VI (source), nats; 0.1 of the uniform distribution is mixed into both (the source: \"a small weight\"):\n\n" + table(
        ["map", "KL from all features, over the lattice", "KL of all features from it", "ours: with elsewhere and flags, inside only"], lines
    )
    text += "\nOurs, not the source's: fixes are poses without a flag, refined between places.\n\n" + table(
        ["map", "fixes of the queries inside", "their mean error, cm", "flagged ones too, cm", "fixes off by more than 1 m"],
        [
            [row["map"], f"{row['fixes']} of {row['inside']}", beside(row["fix_mean_cm"], None, 1), beside(row["flagged_too_mean_cm"], None, 1), row["over_1_m"]]
            for row in rows
        ],
    )
    return text


def num_regions(out):
    """Of each map, from what decompose-regions printed."""
    found = {}
    for path in sorted((out / "maps").glob("k*_tau*.txt")):
        match = re.search(r"(\d+) regions?", path.read_text(encoding="utf-8"))
        if match:
            found[path.stem] = match[1]
    return found


CHOICES = """What was chosen by looking at which data: densities of simulated worlds so that about a hundred features are visible from
a station, as the source says, and B.2's numbers of regions come near the source's, on worlds 0 and up of each setting, the ones
that are reported. Algorithms have the source's parameters. The filter, the visual map and its
estimator: on the surveys of maps/survey_6x3 with seeds 0 and 1 and their queries; the tables below are of another building and other
queries (seed {seed}){not_so}.
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--worlds", type=int, default=300, help="worlds per setting (the source: 300); 0: no worlds")
    parser.add_argument("--area-scale", type=float, default=1, help="multiplies the worlds' areas")
    parser.add_argument("--rho", type=int, default=9, help="of the worlds (the source: 9)")
    parser.add_argument("--survey", default=ROOT / "maps/survey_6x3/recipe.toml", help="recipe of the survey; none: no survey")
    parser.add_argument("--survey-seed", type=int, default=2, help="seed of its building and its queries; 0 and 1 chose")
    parser.add_argument("--threads", type=int, default=0, help="0: all cores")
    arguments = parser.parse_args()
    build, out = arguments.build.resolve(), arguments.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    page = "# The source's experiments\n\n" + CHOICES.format(
        seed=arguments.survey_seed, not_so=": not so here" if arguments.survey_seed < 2 else ", which chose nothing"
    )

    if arguments.worlds > 0:
        say(f"Tables II and III: {arguments.worlds} worlds of each setting")
        run(
            [build / "regions_tables", "--worlds", arguments.worlds, "--area-scale", arguments.area_scale, "--rho", arguments.rho]
            + ["--threads", arguments.threads, "--csv", out / "worlds.csv"],
            stdout=subprocess.DEVNULL,
        )
        page += f"\n## Simulated worlds\n\nk = 4, tau = 1, rho = {arguments.rho}, alpha = 0.85"
        page += f", areas {arguments.area_scale:g} times the source's" if arguments.area_scale != 1 else ""
        page += ".\n\n" + world_tables(read_csv(out / "worlds.csv"))

    if str(arguments.survey) != "none":
        say("the survey: rendered, matched, filtered")
        survey = compile_survey(build / "cairn", arguments.survey, arguments.survey_seed, out)
        say("Figs. 9 and 10")
        areas = run(
            [build / "survey_areas", survey / "classes.db", survey / "world.db", out], stdout=subprocess.PIPE, encoding="utf-8"
        ).stdout
        (out / "survey.csv").write_text(areas, encoding="utf-8")
        page += "\n## A survey\n\nFigs. 9 and 10 (source): areas on the lattice, [a few of them](fig9.svg), [their sizes](fig10.svg).\n\n"
        page += area_table(read_csv(out / "survey.csv")) + "\n"
        say("Tables V and VI: maps with k = 10 and 4, tau = 0 and 1, rho = 3, by B.2")
        run(
            [ROOT / "bench/visual_map/tables.sh", build / "cairn", build / "visual_map_tables", survey, survey / "capture", out / "maps"]
            + ["--csv", out / "visual_map.csv"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        page += map_tables(read_csv(out / "visual_map.csv"), num_regions(out))

    (out / "README.md").write_text(page, encoding="utf-8")
    print(page)
    say(f"all of it: {out}/README.md")
    return 0


if __name__ == "__main__":
    sys.exit(main())
