#!/usr/bin/env python3
"""What one_definition.py takes for a definition, and that it finds two of one name: hand-written sources."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
from one_definition import definitions  # noqa: E402

SCRIPT = pathlib.Path(__file__).with_name("one_definition.py")


def names(source):
    return [name for name, _ in definitions(source)]


class Definitions(unittest.TestCase):
    def test_types_carry_their_namespace(self):
        self.assertEqual(
            names("namespace a {\nstruct B { int b = 0; };\nnamespace c::d {\nenum class E : int { kF };\n}\n}\nunion G {};"),
            ["a::B", "a::c::d::E", "::G"],
        )

    def test_declarations_unnamed_namespaces_and_inner_types_do_not_count(self):
        self.assertEqual(names("namespace a {\nstruct B;\nint F(int x);\nnamespace {\nstruct C {};\nint G() { return 0; }\n}\n}"), [])
        self.assertEqual(names("struct A { struct B {}; void F() {} };"), ["::A"])

    def test_functions_count_by_the_types_of_their_parameters(self):
        self.assertEqual(names("int F(const A& a, std::vector<B> b = {}) { return 0; }"), names("int F(const A& x,std::vector<B> y)\n{}"))
        self.assertNotEqual(names("int F(A a) {}"), names("int F(B a) {}"))
        self.assertEqual(names("static int F() { return 0; }"), [])  # its file's own

    def test_text_that_looks_like_source_is_none(self):
        self.assertEqual(names('// struct A {};\n/* struct B {}; */\nconst char* s = "}{ struct C {";\nauto r = R"x(struct D {)x";\nint n = 1\'000;\n#define E struct F {\nstruct G {};'), ["::G"])

    def test_lines_are_those_of_the_names(self):
        self.assertEqual(definitions("// one\n\nstruct A {\n};\n\nstruct B {};\n"), [("::A", 3), ("::B", 6)])


class WholeTree(unittest.TestCase):
    def run_on(self, files):
        with tempfile.TemporaryDirectory() as root:
            for path, text in files.items():
                file = pathlib.Path(root, path)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text)
            return subprocess.run([sys.executable, str(SCRIPT), root], capture_output=True, text=True)

    def test_two_stages_with_a_type_of_one_name_are_found(self):
        found = self.run_on({"stages/a/a.h": "namespace cairn {\nstruct S { int a; };\n}", "stages/b/b.cc": "namespace cairn {\nstruct S { double b; };\n}"})
        self.assertEqual(found.returncode, 1)
        self.assertIn("cairn::S: defined in stages/a/a.h:2, stages/b/b.cc:2", found.stdout)

    def test_a_test_that_defines_a_type_of_the_library_is_found(self):
        found = self.run_on({"core/a.h": "struct S {};", "tests/a/a_test.cc": "struct S {};", "tests/b/b_test.cc": "struct T {};"})
        self.assertEqual(found.returncode, 1)
        self.assertIn("::S (tests/a)", found.stdout)

    def test_programs_of_their_own_may_share_names(self):
        found = self.run_on({"core/a.h": "struct S {};", "tests/a/a.cc": "struct T {};\nint main() {}", "tests/b/b.cc": "struct T {};\nint main() {}"})
        self.assertEqual(found.returncode, 0, found.stdout)

    def test_a_tree_without_sources_is_an_error(self):
        self.assertEqual(self.run_on({"readme.txt": ""}).returncode, 1)


if __name__ == "__main__":
    unittest.main()
