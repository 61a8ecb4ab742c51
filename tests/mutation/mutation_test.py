#!/usr/bin/env python3
"""That mutation.py changes what it says, and tells what a test notices from what it does not: on a project of one source."""

import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
from mutation import changes_of, is_listed, probability_of_at_most  # noqa: E402

SOURCE = """#include "sum.h"
// not a < b
int Sum(int from, int to) {
  int sum = 0;
  for (int i = from; i < to; ++i) sum += i;
  return sum;
}
bool Unused(int a) { return a > 70; }
"""
TEST = """#include "sum.h"
int main() { return Sum(2, 5) == 9 ? 0 : 1; }
"""
CMAKE = """cmake_minimum_required(VERSION 3.25)
project(small CXX)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR})
include_directories(room)
add_library(small STATIC room/sum.cc room/other.cc)
set_target_properties(small PROPERTIES UNITY_BUILD ${UNITE})
if(UNITE)
  target_precompile_headers(small PRIVATE <string>)
endif()
add_executable(sum_test sum_test.cc)
target_link_libraries(sum_test PRIVATE small)
"""


class Changes(unittest.TestCase):
    def changed(self, line):
        return sorted(change.applied(line) for change in changes_of("a.cc", line))

    def test_one_operator_or_number_at_a_time(self):
        self.assertEqual(self.changed("x = a < b;"), ["x = a <= b;", "x = a > b;"])
        self.assertEqual(self.changed("x += y;"), ["x -= y;"])
        self.assertEqual(self.changed("if (a && b)"), ["if (a || b)"])
        self.assertEqual(self.changed("f(3, 2.5)"), ["f(3, 3.85)", "f(4, 2.5)"])
        self.assertEqual(self.changed("std::min(a, b)"), ["std::max(a, b)"])
        self.assertEqual(self.changed("continue;"), ["break;"])

    def test_not_what_the_compiler_does_not_compute(self):
        for line in ('f("a < 3");', "// a < 3", "#define A 3", "template <int n = 3>", "f('3');", "/* 3", "using A = B<3>;", "x3 = y.z2;"):
            self.assertEqual(self.changed(line), [], line)
        self.assertEqual(self.changed("/* 3\n 4\n*/ f();"), [])
        self.assertEqual(len(self.changed("/* 3 */\nx = 4;")), 1)

    def test_what_means_the_same_is_listed_by_its_line(self):
        text = "  x = a < b;"
        change = next(change for change in changes_of("room/a.cc", text) if change.new == "<=")
        entry = {"file": "a.cc", "line": "x = a < b;", "change": "< -> <=", "why": ""}
        self.assertTrue(is_listed(change, text, [entry]))
        for key, value in (("file", "b.cc"), ("line", "x = a < c;"), ("change", "< -> >"), ("column", 3)):
            self.assertFalse(is_listed(change, text, [{**entry, key: value}]), key)

    def test_a_share_is_too_few_by_the_binomial_distribution(self):
        self.assertAlmostEqual(probability_of_at_most(0, 2, 0.9), 0.01)
        self.assertAlmostEqual(probability_of_at_most(1, 2, 0.9), 0.19)
        self.assertAlmostEqual(probability_of_at_most(2, 2, 0.9), 1)


class Project(unittest.TestCase):
    def run_with(self, rooms, *arguments, unite="OFF", test=TEST):
        with tempfile.TemporaryDirectory() as name:
            root = pathlib.Path(name)
            for path, text in {"room/sum.cc": SOURCE, "room/sum.h": "int Sum(int from, int to);\n", "room/other.cc": "int Other() { return 1; }\n",
                               "sum_test.cc": test, "CMakeLists.txt": CMAKE, "tests/mutation/rooms.toml": rooms}.items():
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text)
            program = shutil.copy(pathlib.Path(__file__).with_name("mutation.py"), root / "tests/mutation")
            for command in (["cmake", "-G", "Ninja", "-S", root, "-B", root / "build", f"-DUNITE={unite}"], ["ninja", "-C", root / "build"]):
                subprocess.run(command, check=True, capture_output=True)
            before = (root / "room/sum.cc").read_text()
            done = subprocess.run([sys.executable, "-B", program, root / "build", *arguments], capture_output=True, text=True, check=False)
            self.assertEqual((root / "room/sum.cc").read_text(), before)
            return done.returncode, done.stdout + done.stderr

    def test_survivors_are_what_no_test_notices(self):
        for unite in ("OFF", "ON"):
            code, said = self.run_with('[room]\ntests = ["sum_test"]\nnoticed = 95\n', "room", unite=unite)
            self.assertEqual(code, 1, said)
            survived = [line.split(None, 2)[1:] for line in said.splitlines() if line.startswith("survived")]
            # The limit and both comparisons of the function that nobody calls, and the number of the one that no test links.
            self.assertEqual(sorted(place for place, _ in survived), ["room/other.cc:1"] + ["room/sum.cc:8"] * 3, said)
            self.assertIn("5 of 9 changes noticed (56 %; 95 % wanted)", said)

    def test_what_means_the_same_is_not_drawn_and_a_figure_is_met(self):
        same = "".join(f'[[room.same]]\nfile = "{file}"\nline = "{line}"\nchange = "{change}"\nwhy = "nobody calls it"\n'
                       for file, line, change in [("sum.cc", "bool Unused(int a) { return a > 70; }", change) for change in ("> -> >=", "> -> <", "70 -> 71")]
                       + [("other.cc", "int Other() { return 1; }", "1 -> 2")])
        code, said = self.run_with('[room]\ntests = ["sum_test"]\nnoticed = 95\n' + same, "room")
        self.assertIn("5 of 5 changes noticed", said)
        self.assertEqual(code, 0, said)
        code, said = self.run_with('[room]\ntests = ["sum_test"]\nnoticed = 95\n' + same.replace("71", "72"), "room")
        self.assertEqual(code, 2, said)
        self.assertIn("no source has the change", said)

    def test_a_share_fails_where_significantly_fewer_are_noticed(self):
        rooms = '[room]\ntests = ["sum_test"]\nnoticed = {}\n'
        self.assertEqual(self.run_with(rooms.format(60), "--share", "--num", "9")[0], 0)
        self.assertEqual(self.run_with(rooms.format(99), "--share", "--num", "9")[0], 1)

    def test_tests_that_fail_as_they_are_tell_nothing(self):
        code, said = self.run_with('[room]\ntests = ["sum_test"]\nnoticed = 95\n', "room", test="int main() { return 1; }\n")
        self.assertEqual(code, 2, said)
        self.assertIn("its tests fail as they are", said)

    def test_a_room_that_is_not_listed_is_refused_and_none_lists_all(self):
        rooms = '[room]\ntests = ["sum_test"]\nnoticed = 95\n'
        code, said = self.run_with(rooms, "hall")
        self.assertEqual(code, 2)
        self.assertIn("which has room", said)
        code, said = self.run_with(rooms)
        self.assertEqual((code, said.split()), (0, ["room", "95", "%", "by", "sum_test"]))


if __name__ == "__main__":
    unittest.main()
