#!/usr/bin/env python3
"""`make reproduce`, small: the tables are whole, and the worlds' numbers are the golden ones.

usage: reproduce_test.py BUILD

The golden counts (tests/decompose_regions/golden_regions.csv) are by a second transcription of the figures; no two
algorithms have the same in any setting, so that one in another's place is noticed.
"""

import csv
import pathlib
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
GOLDEN = ROOT / "tests/decompose_regions/golden_regions.csv"
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "bench"))
import reproduce as REPRODUCE  # noqa: E402

ALGORITHMS = ("a1", "a2", "a3", "b1", "b2", "c")


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
            + ["--survey", "none"],
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

    def test_every_map_stands_beside_the_source(self):
        """The tables of a survey, whose maps take minutes to make, from the lines of two of them."""
        head = (
            "map,landmarks,megabytes,queries,without_match,lattice_mean_cm,lattice_median_cm,kl_mean,kl_sd,kl_reverse_mean,"
            "kl_reverse_sd,seconds,fixes,inside,fix_mean_cm,flagged_too_mean_cm,over_1_m,our_kl_mean,our_kl_sd"
        )
        lines = ["all,200,1.5,93,0,10,9,,,,,0.2,84,84,0.2,0.2,0,,", "k4_tau0,20,0.1,93,7,40,15,2.5,1.5,2.25,1.25,0.1,0,84,,63,0,2,0.5"]
        text = REPRODUCE.map_tables(list(csv.DictReader([head, *lines])), {"k4_tau0": "6"})
        self.assertIn("| all | – | 200 (554) | 1.50 (9.2) | 10.0 (18.66) | 1.00 (1) | 9.0 | 0 of 93 | 0.20 (25.91) |", text)
        self.assertIn("| k4_tau0 | 6 (7) | 20 (23) | 0.10 (1.5) | 40.0 (64.48) | 4.00 (3.46) | 15.0 | 7 of 93 | 0.10 (5.82) |", text)
        self.assertIn("| k4_tau0 | 2.500 ± 1.500 (0.6522 ± 0.2678) | 2.250 ± 1.250 | 2.000 ± 0.500 |", text)
        self.assertIn("| k4_tau0 | 0 of 84 | – | 63.0 | 0 |", text)

    def test_says_what_was_chosen_by_what_and_which_densities(self):
        self.assertIn("chosen by looking at which data", self.page)
        self.assertIn("(seed 2), which chose nothing", self.page)
        densities = self.rows_below("k = 4, tau = 1, rho = 2")
        self.assertEqual([cells[0] for cells in densities], ["1", "2", "3", "4"])
        self.assertTrue(all(cells[1] == "3" and float(cells[4]) > 10 for cells in densities))

    def test_reports_progress(self):
        self.assertRegex(self.run_.stderr, r"setting 4: 3 of 3 worlds")


if __name__ == "__main__":
    BUILD = pathlib.Path(sys.argv.pop(1)).resolve()
    unittest.main()
