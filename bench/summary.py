#!/usr/bin/env python3
"""Writes the table of bench/README.md from the pages of the benchmarks.

usage: bench/summary.py [ROOT]

A page says below a heading what its figures answer, in one line:

  <!-- summary: QUESTION | FIGURE | COMMAND -->

The row of the table links to that heading.  Each number of FIGURE stands in the page's own text or tables, so that the
table cannot say what no page says.
"""

import pathlib
import re
import sys

# Pages in the order of the table; folders are those of bench/.
ORDER = """
held_out redkitchen poses reconstruct change ../docs/sizes.md
sift features pairs matching arm64 regions vocabulary appearance views visual_map
drive atlas servo
runtime bindings report
scale crash
""".split()

BEGIN, END = "<!-- the table: written by bench/summary.py -->", "<!-- end of the table -->"
COMMENT = re.compile(r"<!--.*?-->", re.S)
MARK = re.compile(r"<!-- summary:(.*)-->\s*")
HEADING = re.compile(r"(#+) (.*)")
NUMBER = re.compile(r"\d+(?:[.,]\d+)*")


def anchor_of(heading):
    """The name that a heading has in links, as GitHub makes it of the heading's text."""
    text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
    return re.sub(r"[^\w\- ]", "", text).replace(" ", "-")


def page_of(entry):
    return entry if entry.endswith(".md") else f"{entry}/README.md"


def read_rows(root):
    """Rows of the table, and sentences, one for each fault."""
    bench = root / "bench"
    rows, faults = [], []
    folders = {path.name for path in bench.iterdir() if path.is_dir() and any(file.is_file() for file in path.iterdir())}
    for folder in sorted(folders - set(ORDER) - {"__pycache__"}):
        faults.append(f"bench/{folder}: is not in the table; give it a place in bench/summary.py")
    for entry in ORDER:
        page = page_of(entry)
        if not (bench / page).is_file():
            faults.append(f"bench/{page}: is not there, but in the order of bench/summary.py")
            continue
        text = (bench / page).read_text(encoding="utf-8")
        numbers = set(NUMBER.findall(COMMENT.sub("", text)))
        anchor, num_rows = "", 0
        for line in text.splitlines():
            if heading := HEADING.fullmatch(line):
                anchor = "" if heading[1] == "#" else "#" + anchor_of(heading[2])
            mark = MARK.fullmatch(line)
            if not mark:
                continue
            num_rows += 1
            parts = [part.strip() for part in mark[1].split("|")]
            if len(parts) != 3 or not all(parts):
                faults.append(f"bench/{page}: '{line}' has not the three parts QUESTION | FIGURE | COMMAND")
                continue
            question, figure, command = parts
            for number in NUMBER.findall(figure):
                if number not in numbers:
                    faults.append(f"bench/{page}: the summary's figure {number} stands nowhere on the page")
            rows.append(f"| {question} | [{figure}]({page}{anchor}) | {command} |")
        if num_rows == 0:
            faults.append(f"bench/{page}: has no line '<!-- summary: QUESTION | FIGURE | COMMAND -->'")
    return rows, faults


def with_table(text, rows):
    """The page with the table between its marks; None without marks."""
    begin, end = text.find(BEGIN), text.find(END)
    if begin < 0 or end < begin:
        return None
    table = "\n".join(["| question | figure | command |", "|---|---|---|", *rows])
    return f"{text[:begin]}{BEGIN}\n\n{table}\n\n{text[end:]}"


def main():
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parent.parent
    rows, faults = read_rows(root)
    for fault in faults:
        print(fault, file=sys.stderr)
    page = root / "bench/README.md"
    text = with_table(page.read_text(encoding="utf-8"), rows)
    if text is None:
        faults.append(BEGIN)
        print(f"{page}: has not the lines '{BEGIN}' and '{END}', between which the table goes", file=sys.stderr)
    if faults:
        return 1
    page.write_text(text, encoding="utf-8")
    print(f"{page}: {len(rows)} rows")
    return 0


if __name__ == "__main__":
    sys.exit(main())
