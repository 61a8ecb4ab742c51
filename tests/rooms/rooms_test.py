#!/usr/bin/env python3
"""That rooms.py finds what it is for: hand-written trees, each with one fault."""

import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
from rooms import ORDER, faults, namespace_of  # noqa: E402


def source(room, text=""):
    return f"{text}\nnamespace {namespace_of(room)} {{\n}}\n"


class Rooms(unittest.TestCase):
    def faults_with(self, files):
        """Of a tree in which each room has one header, and these files besides."""
        with tempfile.TemporaryDirectory() as root:
            for path, text in {**{f"{room}/it.h": source(room) for room in ORDER}, **files}.items():
                file = pathlib.Path(root, path)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text)
            return faults(pathlib.Path(root))

    def fault_of(self, path, text):
        found = self.faults_with({path: text})
        self.assertEqual(len(found), 1, found)
        return found[0]

    def test_a_tree_in_order_has_none(self):
        self.assertEqual(self.faults_with({}), [])
        self.assertEqual(self.faults_with({"core/files/a.cc": source("core/files", '#include "core/base/it.h"')}), [])
        self.assertEqual(self.faults_with({"stages/emit_map/a.cc": source("stages/emit_map", '#include "runtime/map/it.h"')}), [])
        self.assertEqual(self.faults_with({"runtime/examples/robot/a.cc": '#include "own.h"', "runtime/examples/robot/own.h": ""}), [])

    def test_nothing_includes_upward(self):
        for room, above in (("core/base", "core/files"), ("core/line", "runtime/map"), ("runtime/drive", "sim/robot"), ("stages/simulate", "pipeline/build")):
            found = self.fault_of(f"{room}/a.cc", source(room, f'#include "{above}/it.h"'))
            self.assertIn(f"{room}/a.cc: includes {above}/it.h, but {above} stands above {room}", found)

    def test_stages_know_no_other(self):
        found = self.fault_of("stages/emit_map/a.cc", source("stages/emit_map", '#include "stages/match_features/pairs/it.h"'))
        self.assertIn("another stage's", found)

    def test_examples_are_included_by_nobody(self):
        found = self.faults_with({"runtime/examples/own.h": "", "pipeline/a.cc": source("pipeline", '#include "runtime/examples/own.h"')})
        self.assertIn("for its readers alone", found[0])

    def test_includes_are_written_one_way(self):
        found = self.fault_of("core/base/a.cc", source("core/base", '#include "it.h"'))
        self.assertIn("write its path from the project's root", found)

    def test_namespaces_are_those_of_the_folders(self):
        self.assertIn("expected cairn::emit_map", self.fault_of("stages/emit_map/a.cc", source("core/base")))
        self.assertIn("expected cairn::match_features", self.fault_of("stages/match_features/pairs/a.cc", source("sim/robot")))
        self.assertEqual(self.faults_with({"core/base/a.cc": "namespace cairn::base_internal {\n}\n"}), [])

    def test_full_and_unknown_rooms_are_named(self):
        self.assertIn("has 13 sources", self.faults_with({f"core/line/a{i}.cc": source("core/line") for i in range(12)})[0])
        self.assertEqual(self.faults_with({f"core/line/a{i}.cc": source("core/line") for i in range(11)}), [])
        self.assertIn("core/new is no room yet", self.fault_of("core/new/a.cc", ""))

    def test_empty_trees_are_not_taken_for_good_ones(self):
        with tempfile.TemporaryDirectory() as root:
            self.assertEqual(len(faults(pathlib.Path(root))), len(ORDER))


if __name__ == "__main__":
    unittest.main()
