#!/usr/bin/env python3
"""The paper in the margin: that docs/sources.md and the citations in comments say the same.

usage: sources.py ROOT

A comment cites what the statement beside it computes as [SOURCE LOCATOR, LOCATOR...: words]; the words may be missing,
and [SOURCE: words] says what the source has for a number.  Locators are

  eq. 3    eq. 3-5    Fig. 3    Fig. 3 line 5    Fig. 3 lines 5-9    Def. 3.1    Theorem 4.1    Lemma 4.1    Table II    fn 2
  §VI-B    §2.3    §IV-B step 3

Several sources in one pair of brackets stand apart by semicolons.  The page has a heading `## [SOURCE] ...` for each source;
below it a row for each thing that is computed, `| LOCATOR | what it says | [file](../path) | `function` |`, and a list
`- LOCATOR: why not` of what is not.
"""

import collections
import pathlib
import re
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from one_definition import LITERALS  # noqa: E402
from rooms import PARTS  # noqa: E402

PAGE = "docs/sources.md"
CITING = (*PARTS, "bench", "tests")
HEADERS = (".h",)
SOURCES = (".h", ".cc", ".c")

# What the sources number: each stands on the page.  Lines of figures that only end a loop or a branch are left out.
NUMBERED = {
    "Sala06": "Def. 3.1, Def. 3.2, Def. 3.3, Def. 3.4, Def. 3.5, Def. 3.6, Def. 3.7, Def. 3.8, Def. 4.1, "
    "Lemma 4.1, Lemma 4.2, Lemma 4.3, Theorem 4.1, Theorem 4.2, Theorem 4.3, "
    "Fig. 3 lines 1-9, Fig. 3 lines 11-12, Fig. 3 lines 14-16, Fig. 4 lines 1-7, Fig. 4 lines 9-12, "
    "Fig. 5 lines 1-11, Fig. 5 lines 13-15, Table I, Table II, Table III, Table IV, Table V, Table VI, fn 1-5",
    "Mariottini11": "eq. 1-8, Table I, fn 1-5",
    "Booij06": "eq. 1, §IV-B steps 1-6",
    "Simsarian96": "§2.2 step I, §2.2 step II, §2.2 step III, §2.2 step IV, Fig. 4, Fig. 6, Fig. 7",
    "TUF": "§5.3.4, §5.3.5, §5.3.6, §5.3.7, §5.3.8, §5.3.10, §5.3.11",
}

LOCATOR = re.compile(
    r"(?P<whole>§(?:[IVX]+(?:-[A-H])?|\d+(?:\.\d+)*)|(?:Def\.|Theorem|Lemma|Table) [\dIVX.]*[\dIVX]|(?:eq\.|Fig\.|fn) \d+)"
    r"(?:-(?P<last>\d+))?(?: (?P<part>line|step)s? (?P<first_part>\d+|[IVX]+)(?:-(?P<last_part>\d+))?)?"
)
CITATION = re.compile(r"\[[^\[\]]*\b(?:" + "|".join(NUMBERED) + r")\b[^\[\]]*\]")
OTHER_CITATION = re.compile(r"\[[^\[\]]*\b[A-Z]\w+\d\d\b[^\[\]]*\]")  # [Hartley97]
BARE = re.compile(
    r"\b(?:eqs?\.|Fig\.|Def\.) ?\(?\d|\b(?:[Ee]quation|[Ff]igure|Theorem|Lemma|Definition) \(?\d|\[(?:lines?|steps?|eqs?\.|Fig\.|§)[^\]]*\]?"
)

Item = collections.namedtuple("Item", "source name line")  # one locator, and where it stands
Row = collections.namedtuple("Row", "source names file function line")


def names_of(text):
    """Every single thing that a list of locators names; None where it is no list of locators."""
    names = []
    for locator in filter(None, (part.strip() for part in text.split(","))):
        match = LOCATOR.fullmatch(locator)
        if not match or (match["last"] and match["part"]):
            return None
        whole, last = match["whole"], match["last"]
        if last:
            kind, first = whole.rsplit(" ", 1)
            names += [f"{kind} {i}" for i in range(int(first), int(last) + 1)]
        elif match["last_part"]:
            parts = range(int(match["first_part"]), int(match["last_part"]) + 1)
            names += [f"{whole} {match['part']} {i}" for i in parts]
        elif match["part"]:
            names.append(f"{whole} {match['part']} {match['first_part']}")
        else:
            names.append(whole)
    return names


def is_part_of(name, whole):
    """Fig. 3 line 5 is part of Fig. 3, §VI-B and §VI-B step 1 are parts of §VI."""
    return name == whole or name.startswith(tuple(whole + mark for mark in (" ", "-", ".")))


def comment_blocks(text):
    """Comments on lines that follow each other, joined: (text, line of each character)."""
    blocks, last_line = [], -1
    for match in LITERALS.finditer(text):
        if not match.group().startswith("/"):
            continue
        line = text.count("\n", 0, match.start()) + 1
        words, lines = "", []
        for i, part in enumerate(match.group().split("\n")):
            part = re.sub(r"^\s*(?://+|/\*+|\*(?!/))|\*/\s*$", "", part).strip() + " "
            words += part
            lines += [line + i] * len(part)
        if line <= last_line + 1 and blocks:
            blocks[-1] = (blocks[-1][0] + words, blocks[-1][1] + lines)
        else:
            blocks.append((words, lines))
        last_line = lines[-1]
    return blocks


def citations(file, text):
    """Items that the comments of a file cite, and faults."""
    items, found = [], []
    for words, lines in comment_blocks(text):
        for match in CITATION.finditer(words):
            for part in match.group()[1:-1].split(";"):
                begin = re.match(r"\s*(\w+),?([^:]*)", part)
                if not begin or begin[1] not in NUMBERED:
                    continue
                source, names = begin[1], names_of(begin[2])
                line = lines[match.start()]
                if names is None:
                    found.append(f"{file}:{line}: {match.group()} names nothing; write it as tests/rooms/sources.py says, words after a colon")
                else:
                    items += [Item(source, name, line) for name in names]
        rest = OTHER_CITATION.sub("", CITATION.sub(lambda m: " " * len(m.group()), words))
        for match in BARE.finditer(rest):
            found.append(f"{file}:{lines[min(match.start(), len(lines) - 1)]}: '{match.group()}' names no source; write [SOURCE {match.group().strip('[]')}]")
    return items, found


def spans(text, function):
    """Lines (first, last) of each definition of a function or type, the comments above it included.

    By the layout that clang-format makes: a definition ends with a brace as far to the right as its first line begins."""
    lines = text.split("\n")
    outer, _, name = function.rpartition("::")
    if outer and f"{outer}::{name}" not in text:
        name_pattern, within = re.escape(name), spans(text, outer)
    else:
        name_pattern, within = re.escape(function), [(1, len(lines))]
    begin = re.compile(
        r"^(?P<indent>\s*)(?!return\b|if\b|for\b|while\b|switch\b|else\b|case\b|//)(?:"
        r"(?:class|struct) " + (r"(?!)" if outer.endswith(name) else name_pattern) + r"\b[^;]*$"  # A::A is no class
        r"|(?:[\w:<>,&*\[\]~ ]+[ &*])?(?:\w+::)*" + name_pattern + r"\("
        r"|TEST(?:_\w+)?\(\w+, " + name_pattern + r"\))"
    )
    found = []
    for i, line in enumerate(lines):
        match = begin.match(line)
        if not match or not any(first <= i + 1 <= last for first, last in within):
            continue
        head = i  # the line on which the definition's head ends
        while head < len(lines) and not re.search(r"[{};]\s*(?://.*)?$", lines[head]):
            head += 1
        if head == len(lines) or (re.search(r";\s*(?://.*)?$", lines[head]) and "{" not in lines[head]):
            continue  # a declaration, a call
        last = head
        if re.search(r"{\s*(?://.*)?$", lines[head]):
            while last + 1 < len(lines) and not re.match(match["indent"] + "}", lines[last + 1]):
                last += 1
            last += 1
        first = i
        while first > 0 and re.match(r"\s*(?://|template\b)", lines[first - 1]):
            first -= 1
        found.append((first + 1, last + 1))
    return found


def places_for(text, rows):
    """Lines (first, last) in which the things of these rows may be cited: their functions, what stands above the types that
    these belong to, and what the file begins with."""
    lines = text.split("\n")

    def comment_from(first):
        return first, next((i for i in range(first, len(lines)) if not re.match(r"\s*//", lines[i])), first)

    found = [comment_from(1)] if lines[0].startswith("//") else []
    for row in rows:
        found += spans(text, row.function)
        outer = row.function.rpartition("::")[0]
        found += [comment_from(first) for first, _ in (spans(text, outer) if outer else ())]
    return found


def read_page(text):
    """Rows, Items that are said not to be computed, and faults."""
    rows, left_out, found, source = [], [], [], None
    for number, line in enumerate(text.split("\n"), 1):
        heading = re.match(r"## \[(\w+)\]", line)
        if line.startswith("## "):
            source = heading[1] if heading else None
        if source is None:
            continue
        if source not in NUMBERED:
            found.append(f"{PAGE}:{number}: [{source}] is no source yet; add what it numbers to tests/rooms/sources.py")
            source = None
        elif line.startswith("- "):
            names = names_of(line[2:].partition(":")[0])
            if names is None or not line.partition(":")[2].strip():
                found.append(f"{PAGE}:{number}: '{line[:60]}' is no '- LOCATOR: reason'; write it so")
            else:
                left_out += [Item(source, name, number) for name in names]
        elif line.startswith("|") and not re.match(r"\|[-\s|]*$|\| equation", line):
            cells = [cell.strip() for cell in line.strip().strip("|").split(" | ")]
            link = re.fullmatch(r"\[[^\]]+\]\(\.\./([^)]+)\)", cells[2]) if len(cells) == 4 else None
            function = re.fullmatch(r"`([\w:~]+)`", cells[3]) if len(cells) == 4 else None
            names = names_of(cells[0])
            if not link or not function or not names or not cells[1]:
                found.append(f"{PAGE}:{number}: '{line[:60]}' is no row; write | LOCATOR | what | [file](../path) | `function` |")
            else:
                rows.append(Row(source, names, link[1], function[1], number))
    return rows, left_out, found


def faults(root):
    """Sentences, one for each fault."""
    page = root / PAGE
    if not page.is_file():
        return [f"{PAGE}: missing; it leads from each equation to its file and function"]
    rows, left_out, found = read_page(page.read_text(encoding="utf-8"))

    cited, texts = {}, {}
    for part in CITING:
        for path in sorted((root / part).rglob("*")):
            if path.suffix not in SOURCES:
                continue
            file = str(path.relative_to(root))
            texts[file] = path.read_text(encoding="utf-8")
            cited[file], unreadable = citations(file, texts[file])
            found += unreadable

    for row in rows:
        if row.file not in texts:
            found.append(f"{PAGE}:{row.line}: {row.file} is no source file; name the one that {row.function} is in now")
            continue
        places = spans(texts[row.file], row.function)
        if not places:
            found.append(f"{PAGE}:{row.line}: {row.file} defines no {row.function}; name the one that computes {row.names[0]} now")
            continue
        for name in row.names:
            lines = [item.line for item in cited[row.file] if item.source == row.source and is_part_of(item.name, name)]
            if not lines:
                found.append(f"{PAGE}:{row.line}: {row.file} has no comment [{row.source} {name}]; put it beside the statement in {row.function}, or take the row out")
            elif not any(first <= line <= last for line in lines for first, last in places):
                found.append(f"{PAGE}:{row.line}: {row.file}:{lines[0]} cites [{row.source} {name}], but not in {row.function}; correct the row or move the comment")

    on_page = [Item(row.source, name, row.line) for row in rows for name in row.names] + left_out
    for file, items in cited.items():
        for item in items:
            of_source = [other.name for other in on_page if other.source == item.source]
            here = [row for row in rows if (row.source, row.file) == (item.source, file) and any(is_part_of(name, item.name) for name in row.names)]
            if file.endswith(HEADERS) and item.name.startswith("§") and " " not in item.name:
                continue  # says where to read
            if not any(is_part_of(name, item.name) for name in of_source):
                found.append(f"{file}:{item.line}: [{item.source} {item.name}] does not stand in {PAGE}; give it a row there")
            elif file.endswith(HEADERS):
                continue
            elif not here:
                found.append(f"{file}:{item.line}: [{item.source} {item.name}] has no row with this file in {PAGE}; give it one")
            elif not any(first <= item.line <= last for first, last in places_for(texts[file], here)):
                found.append(f"{file}:{item.line}: [{item.source} {item.name}] stands in no function that has a row for it in {PAGE}; give it one")

    for source, numbered in NUMBERED.items():
        for name in names_of(numbered):
            if not any(item.source == source and is_part_of(item.name, name) for item in on_page):
                found.append(f"{PAGE}: [{source}] has no {name}; give it a row, or say below the table why it is not computed")
    for item in left_out:
        if any(row.source == item.source and item.name in row.names for row in rows):
            found.append(f"{PAGE}:{item.line}: [{item.source} {item.name}] is said not to be computed, but has a row; take one out")
    return found


def main():
    root = pathlib.Path(sys.argv[1])
    found = faults(root)
    for fault in found:
        print(fault)
    rows = read_page((root / PAGE).read_text(encoding="utf-8"))[0] if (root / PAGE).is_file() else []
    print(f"{len(rows)} rows of {len(NUMBERED)} sources, {len(found)} faults")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
