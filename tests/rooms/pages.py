#!/usr/bin/env python3
"""Whether a reader gets everywhere: links of the pages, ways to each page, and the table of the benchmarks.

usage: pages.py ROOT

A page is a Markdown file of the root, of a recipe's folder, or below docs, schemas or bench.  Its relative links lead to files, folders and
headings that are there.  docs/README.md, which the README names, has a link to every page below docs; from there links lead
to every page below schemas and bench too, without the changelog.  Pages that sources name are there, and so are the tests that
docs/security.md names, one at least for each thing that somebody may try.  The table of bench/README.md is what bench/summary.py makes of the pages.
"""

import collections
import pathlib
import re
import sys
import urllib.parse

sys.dont_write_bytecode = True
sys.path[:0] = [str(pathlib.Path(__file__).resolve().parent), str(pathlib.Path(__file__).resolve().parent.parent.parent / "bench")]
from rooms import PARTS  # noqa: E402
from summary import anchor_of, read_rows, with_table  # noqa: E402

START = "docs/README.md"
REACHED = ("docs", "schemas", "bench")
REFERENCE_OF_OPTIONS = "docs/recipe.md"  # written by the program
PAGE_OF_TESTS = "docs/security.md"
LOG = "CHANGELOG.md"  # a list of changes is nobody's way to a page
SOURCES = (*PARTS, "ros", "bench")

FENCE = re.compile(r"^(```|~~~).*?^\1", re.M | re.S)
CODE = re.compile(r"`[^`\n]*`")
COMMENT = re.compile(r"<!--.*?-->", re.S)
LINK = re.compile(r"\]\(\s*<?([^)\s>]+)>?[^)]*\)")
REFERENCE = re.compile(r"^\s*\[[^]]+\]:\s*(\S+)", re.M)
HEADING = re.compile(r"^#+ (.*)$", re.M)
TEST = re.compile(r"^TEST(?:_[FP])?\(\s*(\w+),\s*(\w+)\s*\)", re.M)
NAMED_TEST = re.compile(r"`([A-Z]\w*\.[A-Z]\w*)`")
NAMED = re.compile(r"\b(?:docs|schemas|bench)/[\w/.-]*\.md\b")


def pages_of(root):
    """Paths of the pages, from the root."""
    found = [*root.glob("*.md"), *root.glob("maps/*.md"), *root.glob("maps/*/*.md")]
    for place in REACHED:
        found += (root / place).rglob("*.md")
    return sorted(path.relative_to(root).as_posix() for path in found)


def links_of(text):
    """Targets of a page's links; what stands in code is none."""
    text = COMMENT.sub("", CODE.sub("", FENCE.sub("", text)))
    return LINK.findall(text) + REFERENCE.findall(text)


def anchors_of(text):
    """Names of a page's headings; of equal ones the second ends in -1."""
    times = collections.Counter()
    anchors = set()
    for heading in HEADING.findall(FENCE.sub("", text)):
        anchor = anchor_of(heading)
        anchors.add(f"{anchor}-{times[anchor]}" if times[anchor] else anchor)
        times[anchor] += 1
    return anchors


def link_faults(root, pages):
    """Faults of links, and per page the pages that it leads to."""
    found, leads_to = [], {page: set() for page in pages}
    for page in pages:
        for link in links_of((root / page).read_text(encoding="utf-8")):
            if re.match(r"[a-z]+:", link):
                continue  # of another site
            path, _, anchor = urllib.parse.unquote(link).partition("#")
            target = ((root / page).parent / path).resolve() if path else (root / page).resolve()
            if not target.is_relative_to(root.resolve()):
                found.append(f"{page}: the link {link} leads out of the project")
            elif not target.exists():
                found.append(f"{page}: the link {link} leads to nothing")
            else:
                name = target.relative_to(root.resolve()).as_posix()
                if name in leads_to and name != page:
                    leads_to[page].add(name)
                if anchor and (target.suffix != ".md" or anchor not in anchors_of(target.read_text(encoding="utf-8"))):
                    found.append(f"{page}: the link {link} names a heading that is not there")
    return found, leads_to


def reach_faults(pages, leads_to):
    """Pages that the reading order does not name or lead to."""
    if START not in leads_to:
        return [f"{START}: is not there; it has the reading order"]
    found = []
    if START not in leads_to.get("README.md", ()):
        found.append(f"README.md: does not link {START}, the reading order")
    reached, ahead = {START}, [START]
    while ahead:
        for page in leads_to[ahead.pop()] - reached - {LOG}:
            reached.add(page)
            ahead.append(page)
    for page in pages:
        if page.split("/")[0] in REACHED and page not in reached:
            linked = sorted(other for other in pages if page in leads_to[other])
            found.append(f"{page}: no way leads there from {START}; " + (f"only {linked[0]} links it" if linked else "no page links it"))
        elif page.startswith("docs/") and page != START and page not in leads_to[START]:
            found.append(f"{page}: has no link in {START}, the reading order")
    return found


def name_faults(root):
    """Pages that sources name and that are not there."""
    found = []
    for place in SOURCES:
        for path in sorted((root / place).rglob("*")):
            if path.suffix not in (".h", ".cc", ".c", ".py", ".sh", ".mk") and path.name != "CMakeLists.txt":
                continue
            for page in NAMED.findall(path.read_text(encoding="utf-8", errors="replace")):
                if not (root / page).is_file():
                    found.append(f"{path.relative_to(root)}: names {page}, which is not there")
    return found


def test_faults(root):
    """Tests that the page of threats names and that are not there, and rows that name none."""
    page = root / PAGE_OF_TESTS
    if not page.is_file():
        return []
    text = page.read_text(encoding="utf-8")
    tests = {".".join(test) for path in (root / "tests").rglob("*.cc") for test in TEST.findall(path.read_text(encoding="utf-8"))}
    found = [f"{PAGE_OF_TESTS}: names the test {name}, which is not there" for name in NAMED_TEST.findall(text) if name not in tests]
    for first, cells in rows_of(text):
        if first[-1:] == ["test"] and not re.match(r"-+$", cells[0]) and not NAMED_TEST.search(cells[-1]):
            found.append(f"{PAGE_OF_TESTS}: '{cells[0][:60]}' has no test that shows it; write one and name it")
    return found


def table_faults(root):
    """Faults of the benchmarks' summaries, and a table that is not what they make."""
    rows, found = read_rows(root)
    page = root / "bench/README.md"
    text = page.read_text(encoding="utf-8") if page.is_file() else ""
    if text != with_table(text, rows):
        found.append("bench/README.md: its table is not what the pages say; run bench/summary.py")
    return found


def rows_of(text):
    """Cells of a page's table rows, with the cells of their table's first row."""
    first = None
    for line in text.split("\n"):
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] if line.startswith("|") else None
        if cells and first:
            yield first, cells
        first = cells and (first or cells)


def default_faults(root, pages):
    """Defaults that a page's table states and that are not those of the option's name in the reference of recipes."""
    reference = root / REFERENCE_OF_OPTIONS
    if not reference.is_file():
        return []
    defaults = collections.defaultdict(set)
    for first, cells in rows_of(reference.read_text(encoding="utf-8")):
        if first[:2] == ["key", "default"] and len(cells) > 1:
            defaults[cells[0].strip("`")].add(cells[1].strip("`'"))
    found = []
    for page in pages:
        for first, cells in rows_of((root / page).read_text(encoding="utf-8")):
            if page == REFERENCE_OF_OPTIONS or not first[0].startswith("option") or first[1:2] != ["default"]:
                continue
            names = [name.lstrip("-").replace("-", "_") for name in re.findall(r"`([^`]+)`", cells[0])]
            stated = [default.strip("` '") for default in cells[1].split(", ")]
            for name, default in zip(names, stated):
                if name in defaults and default not in defaults[name]:
                    found.append(f"{page}: says that the default of {name} is {default}, but it is {' or '.join(sorted(defaults[name]))}")
    return found


def faults(root):
    """Sentences, one for each fault."""
    pages = pages_of(root)
    found, leads_to = link_faults(root, pages)
    return found + reach_faults(pages, leads_to) + name_faults(root) + test_faults(root) + table_faults(root) + default_faults(root, pages)


def main():
    root = pathlib.Path(sys.argv[1])
    found = faults(root)
    for fault in found:
        print(fault)
    print(f"{len(pages_of(root))} pages, {len(found)} faults")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
