#!/usr/bin/env python3
"""That mutation.py changes what it says, and tells what a test notices from what it does not: on a project of one source."""

import concurrent.futures
import os
import pathlib
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
from changes import changes_of, is_listed  # noqa: E402
from mutation import is_at, probability_of_at_most  # noqa: E402
from schemata import schema_of  # noqa: E402

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
set(CMAKE_CXX_STANDARD 20)
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

    def test_not_in_raw_strings(self):
        text = 'const char* const kSql = R"sql(\nCHECK (a >= 0)\n  )" < 7)sql"; x = 1;\ny = 2;'
        self.assertEqual([(change.line, change.old) for change in changes_of("a.cc", text)], [(2, "1"), (3, "2")])

    def test_what_means_the_same_is_listed_by_its_line(self):
        text = "  x = a < b;"
        change = next(change for change in changes_of("room/a.cc", text) if change.new == "<=")
        entry = {"file": "a.cc", "line": "x = a < b;", "change": "< -> <=", "why": ""}
        self.assertTrue(is_listed(change, text, [entry]))
        for key, value in (("file", "b.cc"), ("line", "x = a < c;"), ("change", "< -> >"), ("column", 3)):
            self.assertFalse(is_listed(change, text, [{**entry, key: value}]), key)

    def test_places_are_files_and_lines(self):
        change = changes_of("room/a.cc", "int x;\nx = a < b;")[0]
        for place in ("a.cc", "a.cc:2", "a.cc:1-2", "a.cc:2-9"):
            self.assertTrue(is_at(change, place), place)
        for place in ("b.cc", "a.cc:1", "a.cc:3-9", "room"):
            self.assertFalse(is_at(change, place), place)

    def test_a_share_is_too_few_by_the_binomial_distribution(self):
        self.assertAlmostEqual(probability_of_at_most(0, 2, 0.9), 0.01)
        self.assertAlmostEqual(probability_of_at_most(1, 2, 0.9), 0.19)
        self.assertAlmostEqual(probability_of_at_most(2, 2, 0.9), 1)


# What changes are made in, of every kind: run with each of them compiled alone and all at once, it must say the same.
STANDARD = "".join(f"#include <{name}>\n" for name in ("algorithm", "array", "cstdio", "functional", "map", "numeric", "string", "vector"))
EXPRESSIONS = r"""#include "standard.h"
constexpr double kHalf = 0.5;
constexpr int kNum = 2;
struct Point {
  static constexpr int kDim = 3;
  double x = 1, y = 2;
  Point operator+(const Point& other) const { return {x + other.x, y + other.y}; }
};
struct Sum {  // an expression that refers to what it is made of, as Eigen's do
  const int& a;
  const int& b;
  int sign = 1;
  int eval() const { return a + sign * b; }
};
struct Int {
  int value;
  Sum operator+(const Int& b) const { return {value, b.value}; }
  Sum operator-(const Int& b) const { return {value, b.value, -1}; }
};
int Eval(Sum sum) { return sum.eval(); }
int Eval(int value) { return value; }
bool Said(const char* text) {
  std::printf("%s ", text);
  return text[0] == 'y';
}
int Branches(int a, int b, const std::vector<int>& values) {
  int sum = 0;
  for (size_t i = 0; i < values.size() && values[i] != 9; ++i) {
    if (values[i] == 7) continue;
    if (values[i] == 8)
      break;
    else
      sum += values[i];
    sum -= a > b || (a <= 1 && b >= 2) ? 1 : 0;  // not || this
  }
  return sum;
}
template <int N>
int Times(int a) {
  return a * N;
}
int main() {
  std::array<int, 3> fixed = {4, 5, 6};
  int bounds[kNum + 1] = {1};
  std::map<int, int> counts;
  for (int value : {3, 1, 3}) ++counts[value];
  auto it = counts.begin();
  ++it;
  std::printf("%d %zu %d\n", it == counts.end() ? 0 : it->second, fixed.size(), bounds[0]);
  std::printf("%d %d\n", Branches(1, 2, {1, 7, 2, 8, 3}), Branches(3, 2, {4, 9, 1}));
  std::printf("%d\n", Said("yes") && Said("no") || Said("y") && !Said("n"));
  const bool any = Said("no") ||
                   (Said("yes") && Said("y"));  // two && lines
  std::printf("%d %d\n", any, Times<4>(2 + 3) - 6 / 4);
  const Point point = Point() + Point{.x = kHalf, .y = 1e-3 * 2.5e+2};
  std::printf("%f %f %d\n", point.x, 1'000 - point.y, Point::kDim);
  const int a = 5, b = 3;
  std::printf("%d\n", Eval(Int{a} + Int{b}));
  std::printf("%d %d %d\n", std::min(a, b), std::max({a, b, 7}), std::min<int>(a, 2));
  std::printf("%d\n", std::max(a, b, [](int p, int q) { return p % 4 < q % 4; }));
  bool flag = false;
  flag |= a > 4 && true;
  std::string text = "a";
  text += std::string("b") + "c";
  std::vector<int> sorted = {2, 3, 1};
  std::sort(sorted.begin(), sorted.end(), std::less<>());
  for (int value : sorted) {
    switch (value) {
      case 1:
        std::printf("one ");
        break;
      default:
        std::printf("many ");
    }
    std::printf("of ");
  }
  const char* pointer = text.data();
  std::printf("%d %s %d %c %d\n", flag, text.c_str(), sorted[2], *(pointer + 1), pointer == nullptr);
  int wide = 0;
  wide += a > b ? 2 : 3;
  std::printf("%d %d\n", wide, std::accumulate(sorted.begin(), sorted.end(), 0, [](int x, int y) { return x - y * 2; }));
}
"""


class Schemata(unittest.TestCase):
    def run_of(self, folder, name, text, *options, env=None):
        (folder / f"{name}.cc").write_text(text)
        if not (folder / name).exists():
            done = subprocess.run(["g++", "-std=c++20", "-O0", "-w", "-o", folder / name, folder / f"{name}.cc", *options], capture_output=True, text=True,
                                  check=False)
            if done.returncode:
                return None, done.stderr
        done = subprocess.run([folder / name], capture_output=True, text=True, check=False, timeout=20, env={**os.environ, **(env or {})},
                              preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (1, 1)))
        return done.returncode, done.stdout[:500]

    def test_all_at_once_do_what_each_does_alone(self):
        changes = dict(enumerate(changes_of("a.cc", EXPRESSIONS), 1))
        self.assertGreater(len(changes), 120)
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            shutil.copy(pathlib.Path(__file__).with_name("chosen.h"), folder)
            (folder / "standard.h").write_text(STANDARD)
            subprocess.run(["g++", "-std=c++20", "-O0", "-w", "-x", "c++-header", folder / "standard.h"], check=True)
            # What needs a constant.
            constants = [k for k, change in changes.items() if re.search(r"kNum|Times<4>|array<int, 3>|case 1|N;|<int N>|kDim = ", change.said(EXPRESSIONS))]
            together = {k: change for k, change in changes.items() if k not in constants}
            schema, alone = schema_of(EXPRESSIONS, together)
            self.assertEqual([changes[k].old for k in alone], ["000", "std::less"])
            self.assertEqual(schema.count("\n"), EXPRESSIONS.count("\n"))
            schema = '#include "standard.h"\n#include "chosen.h"\n#line 1 "a.cc"\n' + schema
            (folder / "reached").write_bytes(bytes(len(changes) + 1))
            as_it_is = self.run_of(folder, "source", EXPRESSIONS)
            self.assertEqual(self.run_of(folder, "schema", schema, env={"CAIRN_REACHED": str(folder / "reached")}), as_it_is)
            reached = (folder / "reached").read_bytes()
            self.assertEqual(as_it_is[0], 0, as_it_is[1])

            def compared(k):
                alone_code, alone_said = self.run_of(folder, f"alone_{k}", together[k].applied(EXPRESSIONS))
                code, said = self.run_of(folder, "schema", schema, env={"CAIRN_CHANGE": str(k)})
                if alone_code is None:
                    return code == 97 or together[k].old == "+=" or not reached[k], (alone_said, code, said)
                if alone_code:  # whatever it does until it crashes or is stopped
                    return code != 0, (alone_code, code)
                return (code, said) == (alone_code, alone_said) and (reached[k] or said == as_it_is[1]), (alone_said, said)

            # Of each kind the first, the last and one between; all of them agree too, and take two minutes.
            kinds = {}
            for k in (k for k in together if k not in alone):
                kinds.setdefault("0" if changes[k].old.isdigit() else changes[k].old, []).append(k)
            numbers = sorted({kind[place] for kind in kinds.values() for place in (0, len(kind) // 2, -1)})
            self.assertGreater(len(numbers), 35)
            with concurrent.futures.ThreadPoolExecutor(2) as pool:
                for k, (same, seen) in zip(numbers, pool.map(compared, numbers)):
                    self.assertTrue(same, (changes[k].said(EXPRESSIONS), seen))


class Project(unittest.TestCase):
    def run_with(self, rooms, *arguments, unite="OFF", test=TEST):
        with tempfile.TemporaryDirectory() as name:
            root = pathlib.Path(name)
            for path, text in {"room/sum.cc": SOURCE, "room/sum.h": "int Sum(int from, int to);\n", "room/other.cc": "int Other() { return 1; }\n",
                               "sum_test.cc": test, "CMakeLists.txt": CMAKE, "tests/mutation/rooms.toml": rooms}.items():
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text)
            for name in ("mutation.py", "changes.py", "schemata.py", "chosen.h"):
                shutil.copy(pathlib.Path(__file__).with_name(name), root / "tests/mutation")
            for command in (["cmake", "-G", "Ninja", "-S", root, "-B", root / "build", f"-DUNITE={unite}"], ["ninja", "-C", root / "build"]):
                subprocess.run(command, check=True, capture_output=True)
            before = (root / "room/sum.cc").read_text()
            done = subprocess.run([sys.executable, "-B", root / "tests/mutation/mutation.py", root / "build", *arguments], capture_output=True, text=True, check=False)
            self.assertEqual((root / "room/sum.cc").read_text(), before)
            return done.returncode, done.stdout + done.stderr

    def test_survivors_are_what_no_test_notices(self):
        for unite in ("OFF", "ON"):
            code, said = self.run_with('[room]\ntests = ["sum_test"]\nnoticed = 95\n', "room", unite=unite)
            self.assertEqual(code, 1, said)
            # The limit and both comparisons of the function that nobody calls, and the number of the one that no test links.
            survived = [line.split()[2] for line in said.splitlines() if line.startswith("not reached: ")]
            self.assertEqual(sorted(survived), ["room/other.cc:1"] + ["room/sum.cc:8"] * 3, said)
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
        code, said = self.run_with('[room]\ntests = ["sum_test"]\n')
        self.assertEqual((code, said.split()), (0, ["room", "not", "measured,", "by", "sum_test"]))


if __name__ == "__main__":
    unittest.main()
