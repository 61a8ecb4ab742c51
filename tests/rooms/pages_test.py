#!/usr/bin/env python3
"""That pages.py finds what it is for: hand-written trees, each with one fault."""

import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
from pages import faults  # noqa: E402
from summary import BEGIN, END, ORDER, anchor_of, page_of, read_rows, with_table  # noqa: E402

BENCHMARK = "# Speed\n<!-- summary: How fast? | 12 ms | `measure` -->\n\nA query takes 12 ms.\n"


def tree():
    """Pages without a fault, by path: README -> docs/README.md -> all others."""
    benchmarks = {str(pathlib.PurePosixPath("bench", page_of(entry))).replace("bench/../", ""): BENCHMARK for entry in ORDER}
    links = "".join(f"[page](../{page})\n" for page in benchmarks)
    return {
        "README.md": "# House\n\n[Read on](docs/README.md)\n",
        "docs/README.md": f"# Order\n\n[map](map.md) [next](next.md) [bench](../bench/README.md) [format](../schemas/FORMAT.md)\n{links}",
        "docs/map.md": "# Map\n\n## What it is, in short\n\n![picture](map.svg)\n",
        "docs/map.svg": "",
        "docs/next.md": "",
        "schemas/FORMAT.md": "# Format\n\n[map](../docs/map.md#what-it-is-in-short)\n",
        "bench/README.md": f"# Benchmarks\n\n{BEGIN}\n{END}\n",
        **benchmarks,
    }


class Pages(unittest.TestCase):
    def faults_with(self, files, table=None):
        """Of the tree with these files changed or added (None: removed) and the table that their pages make."""
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for path, text in {**tree(), **files}.items():
                if text is not None:
                    (root / path).parent.mkdir(parents=True, exist_ok=True)
                    (root / path).write_text(text)
            page = root / "bench/README.md"
            page.write_text(table or with_table(page.read_text(), read_rows(root)[0]))
            return faults(root)

    def fault_of(self, path, text):
        found = self.faults_with({path: text})
        self.assertEqual(len(found), 1, found)
        return found[0]

    def test_a_tree_in_order_has_none(self):
        self.assertEqual(self.faults_with({}), [])

    def test_defaults_that_are_not_the_programs_are_found(self):
        reference = "# Recipes\n[map](map.md)\n\n| key | default | range |\n|---|---|---|\n| `k` | `40` | at least 1 |\n| `choice` | `'auto'` | |\n"
        page = "# Map\n\n## What it is, in short\n![picture](map.svg) [recipes](recipe.md)\n\n"
        order = tree()["docs/README.md"].replace("[next]", "[recipe](recipe.md) [next]")

        def found(rows, head="| option of `cairn plan` | default | |"):
            return self.faults_with({"docs/recipe.md": reference, "docs/README.md": order, "docs/map.md": f"{page}{head}\n|---|---|---|\n{rows}"})

        self.assertEqual(found("| `k` | 40 | |\n| `--choice`, `other` | auto, 7 | |\n| words | 3 | |\n"), [])
        self.assertEqual(found("| `k` | 41 | |\n"), ["docs/map.md: says that the default of k is 41, but it is 40"])
        self.assertEqual(found("| `other`, `--choice` | 40, none | |\n"),
                         ["docs/map.md: says that the default of choice is none, but it is auto"])
        self.assertEqual(found("| `k` | 41 | |\n", "| figure | default | |"), [])
        self.assertEqual(found("| `k` | 40 | |\n\ntext\n\n| a | b |\n|---|---|\n| `k` | 41 |\n"), [])

    def test_links_to_nothing_are_found(self):
        self.assertEqual(self.fault_of("docs/map.md", "# Map\n## What it is, in short\n[gone](gone.md)\n"),
                         "docs/map.md: the link gone.md leads to nothing")
        self.assertIn("leads to nothing", self.fault_of("docs/map.svg", None))
        self.assertIn("gone.svg leads to nothing", self.fault_of("maps/demo/README.md", "[![picture](gone.svg)](../../README.md)\n"))
        self.assertIn("leads to nothing", self.fault_of("CONTRIBUTING.md", "see [there]\n\n[there]: docs/gone.md\n"))
        self.assertIn("leads out of the project", self.fault_of("CONTRIBUTING.md", "[data](../data/README.md)\n"))

    def test_links_to_headings_that_are_gone_are_found(self):
        self.assertIn("#what-it-was names a heading", self.fault_of("schemas/FORMAT.md", "[map](../docs/map.md#what-it-was)\n"))
        self.assertEqual(self.faults_with({"docs/map.md": "# Map\n## What it is, in short\n## Size\n## Size\n[second](#size-1)\n"}), [])
        self.assertIn("#size-2", self.fault_of("docs/map.md", "# Map\n## What it is, in short\n## Size\n## Size\n[third](#size-2)\n"))

    def test_code_and_other_sites_are_no_links(self):
        code = "```\n[a](gone.md)\n# no heading\n```\n`[b](gone.md)` <!-- [c](gone.md) --> [d](https://example.com/gone.md)\n"
        self.assertEqual(self.faults_with({"CONTRIBUTING.md": code}), [])

    def test_headings_are_named_as_the_site_names_them(self):
        self.assertEqual(anchor_of("B.2 from 5,000 stations to a million"), "b2-from-5000-stations-to-a-million")
        self.assertEqual(anchor_of("Choosing a region's `k` by [pose](pose.md), Ctrl-C"), "choosing-a-regions-k-by-pose-ctrl-c")

    def test_pages_that_nothing_leads_to_are_found(self):
        self.assertEqual(self.fault_of("docs/forgotten.md", "# Forgotten\n"),
                         "docs/forgotten.md: no way leads there from docs/README.md; no page links it")
        # Two pages that link only each other.
        self.assertEqual(len(self.faults_with({"docs/a.md": "[b](b.md)\n", "docs/b.md": "[a](a.md)\n"})), 2)
        self.assertEqual(self.faults_with({"docs/next.md": "[a](../schemas/a.md)", "schemas/a.md": ""}), [])

    def test_the_changelog_is_no_way(self):
        files = {"docs/next.md": "[changes](../CHANGELOG.md)\n", "CHANGELOG.md": "[new](docs/new.md)\n", "docs/new.md": ""}
        self.assertEqual(self.faults_with(files), ["docs/new.md: no way leads there from docs/README.md; only CHANGELOG.md links it"])

    def test_the_reading_order_has_every_page_of_docs(self):
        self.assertEqual(self.faults_with({"docs/next.md": "[a](a.md)", "docs/a.md": ""}),
                         ["docs/a.md: has no link in docs/README.md, the reading order"])

    def test_the_readme_leads_to_the_reading_order(self):
        self.assertIn("does not link docs/README.md", self.fault_of("README.md", "# House\n"))
        self.assertIn("docs/README.md: is not there", self.faults_with({"docs/README.md": None})[-1])

    def test_pages_that_sources_name_are_there(self):
        self.assertEqual(self.fault_of("core/base/a.h", "// docs/gone.md says how.\n"), "core/base/a.h: names docs/gone.md, which is not there")
        self.assertEqual(self.faults_with({"core/base/a.h": "// docs/map.md says how.\n"}), [])

    def test_tests_that_the_page_of_threats_names_are_there(self):
        def found(rows):
            return self.faults_with({"docs/README.md": tree()["docs/README.md"].replace("[next]", "[threats](security.md) [next]"),
                                     "docs/security.md": f"# Threats\n\n| he tries | test |\n|---|---|\n{rows}",
                                     "tests/core/map_test.cc": "TEST_F(Map, IsClosed) {\n}\nTEST(Ring,\n     IsRead) {\n}\n// TEST(Ring, IsGone)\n"})

        self.assertEqual(found("| to open | `Map.IsClosed`, `Ring.IsRead` |\n"), [])
        self.assertEqual(found("| to open | `Map.IsClosed`, `Map.IsOpen` |\n"), ["docs/security.md: names the test Map.IsOpen, which is not there"])
        self.assertEqual(found("| to open | `Ring.IsGone` |\n"), ["docs/security.md: names the test Ring.IsGone, which is not there"])
        self.assertEqual(found("| to open | `Map.IsClosed` |\n| to shut | `map` |\n"),
                         ["docs/security.md: 'to shut' has no test that shows it; write one and name it"])

    def test_the_table_is_that_of_the_pages(self):
        page = page_of(ORDER[0])
        found = self.faults_with({}, table=f"# Benchmarks\n\n{BEGIN}\n| old |\n{END}\n")
        self.assertEqual(found, ["bench/README.md: its table is not what the pages say; run bench/summary.py"])
        self.assertIn("has no line '<!-- summary", self.fault_of(f"bench/{page}", "# Speed\n"))
        self.assertIn("has not the three parts", self.fault_of(f"bench/{page}", "# Speed\n<!-- summary: How fast? | 12 ms -->\n12 ms\n"))
        self.assertIn("figure 11 stands nowhere on the page", self.fault_of(f"bench/{page}", BENCHMARK.replace("| 12 ms", "| 11 ms")))
        self.assertIn("bench/new: is not in the table", self.faults_with({"bench/new/new.cc": ""})[-1])

    def test_rows_lead_to_the_heading_above_them(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for path, text in tree().items():
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text)
            (root / f"bench/{page_of(ORDER[0])}").write_text(BENCHMARK + "## In all\n<!-- summary: How long? | 12 ms | `all` -->\n")
            rows, found = read_rows(root)
        self.assertEqual(found, [])
        self.assertEqual(rows[0], f"| How fast? | [12 ms]({page_of(ORDER[0])}) | `measure` |")
        self.assertEqual(rows[1], f"| How long? | [12 ms]({page_of(ORDER[0])}#in-all) | `all` |")


if __name__ == "__main__":
    unittest.main()
