#!/usr/bin/env python3
"""`make reproduce`, small: the tables are whole, and the worlds' numbers are the golden ones.

usage: reproduce_test.py BUILD

The golden counts (tests/decompose_regions/golden_regions.csv) are by a second transcription of the figures; no two
algorithms have the same in any setting, so that one in another's place is noticed.
"""

import csv
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
GOLDEN = ROOT / "tests/decompose_regions/golden_regions.csv"
ALGORITHMS = ("a1", "a2", "a3", "b1", "b2", "c")
MAPS = ("all", "k10_tau0", "k10_tau1", "k4_tau0", "k4_tau1")
NUM_QUERIES = 12  # of small_survey.toml


def read_csv(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


class Reproduce(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.out = pathlib.Path(cls.folder.name) / "out"
        cls.run_ = subprocess.run(
            [ROOT / "bench/reproduce.py", BUILD, cls.out, "--worlds", "3", "--area-scale", "0.1", "--rho", "2"]
            + ["--survey", HERE / "small_survey.toml"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            check=False,
        )

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def setUp(self):
        self.assertEqual(self.run_.returncode, 0, self.run_.stderr[-2000:])
        self.page = (self.out / "README.md").read_text(encoding="utf-8")

    def rows_below(self, heading):
        """Cells of the first table below a line that begins so."""
        lines = self.page.split("\n")
        at = next(i for i, line in enumerate(lines) if line.startswith(heading))
        first = next(i for i in range(at, len(lines)) if lines[i].startswith("|"))
        last = next(i for i in range(first, len(lines)) if not lines[i].startswith("|"))
        return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[first + 2 : last]]

    def test_worlds_have_the_golden_counts(self):
        found = {
            (row["setting"], row["seed"], row["algorithm"]): (row["regions"], row["uncovered"]) for row in read_csv(self.out / "worlds.csv")
        }
        golden = read_csv(GOLDEN)
        self.assertEqual(len(found), len(golden) * len(ALGORITHMS))
        for row in golden:
            for algorithm in ALGORITHMS:
                expected = row[algorithm], row[algorithm + "_uncovered"]
                self.assertEqual(found[row["setting"], row["seed"], algorithm], expected, (row["setting"], row["seed"], algorithm))

    def test_tables_have_the_means_of_the_worlds_beside_the_sources(self):
        golden = read_csv(GOLDEN)
        regions, uncovered = self.rows_below("Table II,"), self.rows_below("Coverable stations that are in no region")
        for setting in range(1, 5):
            worlds = [row for row in golden if row["setting"] == str(setting)]
            for column, algorithm in enumerate(ALGORITHMS, 1):
                mean = sum(int(row[algorithm]) for row in worlds) / len(worlds)
                self.assertTrue(regions[setting - 1][column].startswith(f"{mean:.2f} ("))
                mean = sum(int(row[algorithm + "_uncovered"]) for row in worlds) / len(worlds)
                self.assertEqual(uncovered[setting - 1][column], f"{mean:.1f}")
        self.assertIn("(112.63)", regions[0][5])  # B.2 in setting 1
        self.assertIn("(218.56)", self.rows_below("Table III,")[3][6])  # C in setting 4

    def test_every_query_counts_in_the_maps_of_the_survey(self):
        rows = read_csv(self.out / "visual_map.csv")
        self.assertEqual([row["map"] for row in rows], list(MAPS))
        for row in rows:
            self.assertEqual(row["queries"], str(NUM_QUERIES))
            self.assertLess(float(row["lattice_mean_cm"]), 150)  # the survey is 1.75 m x 1.4 m
        # Half a spacing to the next place, at most: 0.38 of a spacing in the mean.
        self.assertLess(float(rows[0]["lattice_mean_cm"]), 35)
        self.assertLess(int(rows[4]["landmarks"]), int(rows[0]["landmarks"]))
        for row in rows[1:]:
            self.assertGreater(float(row["kl_mean"]), 0)
            self.assertGreater(float(row["kl_reverse_mean"]), 0)
            self.assertNotEqual(row["kl_mean"], row["kl_reverse_mean"])
        table_v = self.rows_below("Table V ")
        self.assertEqual([cells[0] for cells in table_v], list(MAPS))
        self.assertTrue(all(cells[7].endswith(f" of {NUM_QUERIES}") for cells in table_v), table_v)
        self.assertIn("(64.5)", table_v[3][4])
        self.assertIn("(0.6522 ± 0.2678)", self.rows_below("Table VI ")[2][1])

    def test_areas_shrink_by_the_filter(self):
        before, after = read_csv(self.out / "survey.csv")
        self.assertGreater(int(before["features"]), int(after["features"]))
        self.assertGreater(int(after["features"]), 20)
        self.assertEqual(after["features"], read_csv(self.out / "visual_map.csv")[0]["landmarks"])
        sizes = [int(row["stations_after"]) for row in read_csv(self.out / "areas.csv")]
        self.assertEqual(sum(size > 0 for size in sizes), int(after["features"]))
        for name in ("fig9.svg", "fig10.svg"):
            picture = xml.etree.ElementTree.parse(self.out / name)
            self.assertGreater(len(list(picture.iter())), 20)

    def test_says_what_was_chosen_by_what_and_which_densities(self):
        self.assertIn("chosen by looking at which data", self.page)
        self.assertIn("seed 1", self.page)
        densities = self.rows_below("k = 4, tau = 1, rho = 2")
        self.assertEqual([cells[0] for cells in densities], ["1", "2", "3", "4"])
        self.assertTrue(all(cells[1] == "3" and float(cells[4]) > 10 for cells in densities))

    def test_reports_progress(self):
        self.assertRegex(self.run_.stderr, r"setting 4: 3 of 3 worlds")
        self.assertTrue(re.search(r"(?s)Tables II and III.*Figs. 9 and 10.*Tables V and VI", self.run_.stderr))


if __name__ == "__main__":
    BUILD = pathlib.Path(sys.argv.pop(1)).resolve()
    unittest.main()
