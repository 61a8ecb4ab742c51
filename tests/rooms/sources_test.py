#!/usr/bin/env python3
"""That sources.py finds what it is for: a hand-written page and hand-written sources, each time with one fault."""

import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
from sources import NUMBERED, PAGE, citations, faults, names_of, spans  # noqa: E402

CODE = """\
namespace cairn {
namespace {

// [Booij06 eq. 1] every node is in the set or beside it
bool Dominates(int node) {
  return node > 0;
}

}  // namespace

int Weight(int a, int b) {
  // [Mariottini11 eq. 2] w = (a + b) / 2
  return (a + b) / 2;
}

class Greedy {
 public:
  void Keep(int node) {
    Mark(node);  // [Booij06
                 // §IV-B step 3] black
  }
};

}  // namespace cairn
"""
ROWS = {
    "Booij06": (
        "| eq. 1 | dominating | [a.cc](../core/base/a.cc) | `Dominates` |",
        "| §IV-B step 3 | black | [a.cc](../core/base/a.cc) | `Greedy::Keep` |",
    ),
    "Mariottini11": ("| eq. 2 | weight | [a.cc](../core/base/a.cc) | `Weight` |",),
}


def page(rows=None, computed=("eq. 1", "§IV-B step 3", "eq. 2")):
    """A page with these rows, which says of everything else that it is not computed."""
    rows = rows or ROWS
    text = "# Sources\n"
    for source, numbered in NUMBERED.items():
        text += f"\n## [{source}] A source\n\n| equation, line or definition | what it says | file | function |\n|---|---|---|---|\n"
        text += "".join(row + "\n" for row in rows.get(source, ()))
        of_source = {name for row in ROWS.get(source, ()) for name in names_of(row.split("|")[1])} & set(computed)
        text += "\n" + "".join(f"- {name}: a remark.\n" for name in names_of(numbered) if name not in of_source)
    return text


class Sources(unittest.TestCase):
    def faults_of(self, code=CODE, text=None, files=None):
        """Of a tree with one source file, a page and these files besides."""
        with tempfile.TemporaryDirectory() as root:
            for path, content in {"core/base/a.cc": code, PAGE: page() if text is None else text, **(files or {})}.items():
                file = pathlib.Path(root, path)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(content)
            return faults(pathlib.Path(root))

    def fault_of(self, *arguments, **keywords):
        found = self.faults_of(*arguments, **keywords)
        self.assertEqual(len(found), 1, found)
        return found[0]

    def test_a_page_and_comments_that_agree_have_none(self):
        self.assertEqual(self.faults_of(), [])

    def test_a_row_whose_file_is_gone_is_named(self):
        found = self.fault_of(text=page().replace("../core/base/a.cc) | `Weight`", "../core/base/b.cc) | `Weight`"), code=CODE.replace("[Mariottini11 eq. 2] ", ""))
        self.assertRegex(found, r"^docs/sources.md:\d+: core/base/b.cc is no source file; name the one that Weight is in now")

    def test_a_row_whose_function_has_another_name_is_named(self):
        # A call is no definition, nor is the same name in another class.
        for old, new in (("Weight", "Weigh"), ("Greedy::Keep", "Mark"), ("Greedy::Keep", "Lazy::Keep")):
            found = self.faults_of(text=page().replace(f"`{old}`", f"`{new}`"))
            self.assertIn(f"core/base/a.cc defines no {new};", found[0])
            self.assertIn("stands in no function that has a row for it", found[1])  # and so does its comment

    def test_a_row_without_its_comment_is_named(self):
        found = self.fault_of(code=CODE.replace("[Mariottini11 eq. 2] ", ""))
        self.assertIn("core/base/a.cc has no comment [Mariottini11 eq. 2]; put it beside the statement in Weight", found)

    def test_a_comment_in_another_function_is_named(self):
        moved = CODE.replace("// [Booij06 eq. 1] every", "// Every").replace("// [Mariottini11 eq. 2]", "// [Mariottini11 eq. 2] [Booij06 eq. 1]")
        found = self.faults_of(code=moved)
        self.assertIn("core/base/a.cc:12 cites [Booij06 eq. 1], but not in Dominates", found[0])
        self.assertIn("core/base/a.cc:12: [Booij06 eq. 1] stands in no function that has a row for it", found[1])

    def test_a_second_comment_in_another_function_needs_a_row(self):
        found = self.fault_of(code=CODE.replace("// [Mariottini11 eq. 2]", "// [Mariottini11 eq. 2] [Booij06 eq. 1]"))
        self.assertIn("core/base/a.cc:12: [Booij06 eq. 1] stands in no function that has a row for it", found)
        # What a file begins with is about all of it.
        self.assertEqual(self.faults_of(code="// [Booij06 eq. 1]\n" + CODE), [])

    def test_a_comment_that_the_page_lacks_is_named(self):
        text = page().replace("- eq. 1: a remark.\n", "", 1)  # the first heading with an eq. 1 below it is [Mariottini11]
        found = self.faults_of(code=CODE.replace("[Mariottini11 eq. 2]", "[Mariottini11 eq. 1-2]"), text=text)
        self.assertIn("core/base/a.cc:12: [Mariottini11 eq. 1] does not stand in docs/sources.md; give it a row there", found)
        # A number that the source does not have.
        found = self.fault_of(code=CODE.replace("eq. 2] w", "eq. 2, eq. 9] w"))
        self.assertIn("[Mariottini11 eq. 9] does not stand", found)

    def test_what_is_computed_is_not_said_to_be_left_out(self):
        found = self.fault_of(code=CODE.replace("eq. 2] w", "eq. 2, eq. 3] w"))
        self.assertIn("core/base/a.cc:12: [Mariottini11 eq. 3] has no row with this file", found)
        self.assertIn("is said not to be computed, but has a row", self.fault_of(text=page(computed=("eq. 1", "§IV-B step 3"))))

    def test_headers_may_name_what_other_files_compute(self):
        header = "// Weights [Mariottini11 eq. 2], by the planner of [Mariottini11 §V].\nint Weight(int a, int b);\n"
        self.assertEqual(self.faults_of(files={"core/base/a.h": header}), [])
        self.assertIn("core/base/a.h:1: [Mariottini11 eq. 9]", self.fault_of(files={"core/base/a.h": header.replace("eq. 2", "eq. 9")}))

    def test_everything_that_a_source_numbers_is_on_the_page(self):
        found = self.fault_of(text=page().replace("- Theorem 4.3: a remark.\n", ""))
        self.assertIn("docs/sources.md: [Sala06] has no Theorem 4.3; give it a row, or say below the table why", found)

    def test_numbers_without_a_source_are_named(self):
        for comment, found in (
            ("// see eq. 3", "'eq. 3' names no source; write [SOURCE eq. 3]"),
            ("// [line 5] R = {v}", "'[line 5]' names no source; write [SOURCE line 5]"),
            ("// by Theorem 4.2", "'Theorem 4' names no source"),
            ("// Fig. 5: a disc", "'Fig. 5' names no source"),
        ):
            self.assertIn(f"core/base/b.cc:1: {found}", self.fault_of(files={"core/base/b.cc": comment + "\n"})[: 200], comment)
        for comment in ("// [Guha98, Theorem 3.1]", 'const char* text = "Fig. 5";', "// [Sala06: 16]", "// a line of Fig. a"):
            self.assertEqual(self.faults_of(files={"core/base/b.cc": comment + "\n"}), [], comment)

    def test_citations_of_no_place_are_named(self):
        self.assertIn("names nothing; write it as", self.fault_of(files={"core/base/b.cc": "// [Sala06, the third figure]\n"}))

    def test_rows_that_are_none_are_named(self):
        found = self.fault_of(text=page().replace("## [Simsarian96] A source\n", "## [Simsarian96] A source\n| §2 | no link | a.cc | `F` |\n"))
        self.assertIn("is no row; write | LOCATOR", found)
        self.assertIn("is no '- LOCATOR: reason'", self.fault_of(text=page().replace("## [Simsarian96] A source\n", "## [Simsarian96] A source\n- §2.4\n")))

    def test_a_tree_without_the_page_is_no_good_one(self):
        with tempfile.TemporaryDirectory() as root:
            self.assertIn("docs/sources.md: missing", faults(pathlib.Path(root))[0])

    def test_locators(self):
        self.assertEqual(names_of("eq. 3-5"), ["eq. 3", "eq. 4", "eq. 5"])
        self.assertEqual(names_of("Fig. 3 lines 8-9, Fig. 4 line 12"), ["Fig. 3 line 8", "Fig. 3 line 9", "Fig. 4 line 12"])
        self.assertEqual(names_of("§2.2 step IV, §VI-B, Def. 3.1, Table VI, fn 2"), ["§2.2 step IV", "§VI-B", "Def. 3.1", "Table VI", "fn 2"])
        for text in ("3", "eq. three", "§III-V", "Fig. 3, line 5", "On line 1"):
            self.assertIsNone(names_of(text), text)

    def test_comments_are_read_over_their_lines(self):
        items, found = citations("a.cc", 'f("// [Sala06 fn 2]");  // [Sala06\n  // fn 3; Booij06 §III: words, eq. 1], [Sala06: eq. 4]\n')
        self.assertEqual([(i.source, i.name, i.line) for i in items], [("Sala06", "fn 3", 1), ("Booij06", "§III", 1)])
        self.assertEqual(found, [])

    def test_definitions_end_where_their_braces_do(self):
        self.assertEqual(spans(CODE, "Dominates"), [(4, 7)])
        self.assertEqual(spans(CODE, "Weight"), [(11, 14)])
        self.assertEqual(spans(CODE, "Greedy::Keep"), [(18, 21)])
        self.assertEqual(spans(CODE, "Mark"), [])
        self.assertEqual(spans("int F();\nint F(int a,\n      int b)\n    : a_(a) {\n  F(3);\n}\n", "F"), [(2, 6)])
        self.assertEqual(spans("int A::F() const { return 1; }\nvoid G() {\n  return F(1);\n}\n", "A::F"), [(1, 1)])


if __name__ == "__main__":
    unittest.main()
