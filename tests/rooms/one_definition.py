#!/usr/bin/env python3
"""One name, one definition: finds what one namespace defines in two places.

usage: one_definition.py ROOT [FOLDER...]

Two types of one name in one namespace are no error to the compiler, which sees one source file at a time, nor to the
linker, which keeps one of their functions for both.  This reads the C++ sources as text, knows namespaces, classes and
braces, and reports types and functions outside of unnamed namespaces that two places define.  Programs and libraries
share the sources of core, runtime, sim, stages and pipeline: they are looked at together, and with each folder of the tests
and benchmarks in turn.
"""

import collections
import pathlib
import re
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from rooms import PARTS  # noqa: E402

APART = ("tests", "bench")  # programs of their own, a folder each

LITERALS = re.compile(
    r'R"(?P<tag>[^()\\ ]*)\(.*?\)(?P=tag)"'  # raw strings
    r'|"(?:\\.|[^"\\\n])*"'
    r"|(?<![0-9a-fA-F])'(?:\\.|[^'\\\n])+'"  # not the ' of 1'000
    r"|//(?:\\\n|[^\n])*|/\*.*?\*/",
    re.S,
)
TYPE = re.compile(
    r"^(?:template\s*<.*>\s*)?(?:typedef\s+)?(?:struct|class|union|enum(?:\s+class|\s+struct)?)\s+"
    r"(?:\[\[.*?\]\]\s*|alignas\s*\(.*?\)\s*)?(?P<name>[A-Za-z_][\w:]*(?:<.*>)?)\s*(?:final\s*)?(?::(?!:).*)?$",
    re.S,
)
NAMESPACE = re.compile(r"^(?:inline\s+)?namespace(?:\s+(?P<name>[A-Za-z_][\w:]*))?$")


def without_text(source):
    """The source without comments, preprocessor lines and what literals say; lines stay where they are."""

    def blank(match):
        text = match.group()
        if text.startswith("/"):
            return " " + "\n" * text.count("\n")
        return '""' + "\n" * text.count("\n")

    source = LITERALS.sub(blank, source)
    return re.sub(r"^[ \t]*#(?:\\\n|[^\n])*", lambda m: "\n" * m.group().count("\n"), source, flags=re.M)


def split_at_commas(text):
    parts, depth, part = [], 0, ""
    for char in text:
        depth += {"(": 1, "<": 1, "{": 1, "[": 1}.get(char, 0) - {")": 1, ">": 1, "}": 1, "]": 1}.get(char, 0)
        if char == "," and depth == 0:
            parts.append(part)
            part = ""
        else:
            part += char
    return parts + [part] if part.strip() else parts


def parameter_type(parameter):
    """'const std::string& name = "x"' -> 'std::string&'; what a caller's overload is chosen by."""
    parameter = re.sub(r"=.*$", "", parameter, flags=re.S).strip()
    match = re.match(r"^(.*[\s&*>])([A-Za-z_]\w*)\s*((?:\[\w*\])*)$", parameter, re.S)
    if match and match.group(1).split()[-1] not in ("const", "unsigned", "struct", "::"):
        parameter = match.group(1) + match.group(3)
    return re.sub(r"\s+", "", parameter)


def function_key(statement):
    """'Status Read(const std::string& path) const' -> 'Read(conststd::string&)const'; None: not a function."""
    statement = re.sub(r"\[\[.*?\]\]", "", statement, flags=re.S)
    is_template = statement.startswith("template")
    match = re.search(r"((?:[A-Za-z_]\w*(?:<[^()]*>)?\s*::\s*)*(?:operator\s*(?:\(\)|[^\s(]+|\s\w+)|~?[A-Za-z_]\w*))\s*\(",
                      statement)
    if not match or "=" in statement[: match.start()].replace("==", "") or re.search(r"\bstatic\b", statement[: match.start()]):
        return None
    depth = 0
    for end in range(match.end() - 1, len(statement)):
        depth += {"(": 1, ")": -1}.get(statement[end], 0)
        if depth == 0:
            break
    types = [parameter_type(p) for p in split_at_commas(statement[match.end() : end])]
    after = " const" if re.match(r"\s*const\b", statement[end + 1 :]) else ""
    constraint = re.sub(r"\s+", " ", statement[: match.start()]) if is_template else ""
    return constraint + re.sub(r"\s+", "", match.group(1)) + "(" + ", ".join(types) + ")" + after


def definitions(source):
    """(name with its namespace, line) of each type and function defined outside of unnamed namespaces."""
    found, scopes, statement, line, parentheses = [], [], "", 1, 0
    start = 1
    for char in without_text(source):
        if char == "\n":
            line += 1
        if char == "{" and parentheses == 0:
            text = statement.strip()
            opened = "inner"
            if all(kind == "namespace" for kind, _ in scopes):
                namespace = NAMESPACE.match(text)
                inside = "::".join(name for _, name in scopes if name)
                if namespace:
                    opened = "namespace" if namespace.group("name") else "unnamed"
                    scopes.append((opened, namespace.group("name") or ""))
                    statement = ""
                    continue
                if re.match(r'^extern\s*""$', text):
                    scopes.append(("namespace", ""))
                    statement = ""
                    continue
                type_match = TYPE.match(text)
                name = type_match.group("name") if type_match else function_key(text)
                if name:
                    found.append((f"{inside}::{name}", start))
            scopes.append((opened, ""))
            statement += " "
        elif char == "}" and parentheses == 0:
            if scopes:
                kind, _ = scopes.pop()
                if kind != "inner" or all(k == "namespace" for k, _ in scopes):
                    statement = ""
        elif any(kind != "namespace" for kind, _ in scopes):
            continue
        elif char == ";" and parentheses == 0:
            statement = ""
        else:
            if char in "()":
                parentheses += 1 if char == "(" else -1
            if not statement.strip():
                start = line
            statement += char
    return found


def is_main(name):
    """What a program begins with, or a fuzzer: one in each."""
    return name.startswith(("::main(", "::LLVMFuzzerTestOneInput("))


def sources(folder):
    return sorted(p for p in folder.rglob("*") if p.suffix in (".h", ".cc") and p.is_file())


def main():
    root = pathlib.Path(sys.argv[1])
    places = collections.defaultdict(list)  # name -> "file:line"

    def read(folder, into):
        for path in sources(folder):
            for name, line in definitions(path.read_text(encoding="utf-8")):
                into[name].append(f"{path.relative_to(root)}:{line}")

    for folder in PARTS:
        read(root / folder, places)
    twice = {name: where for name, where in places.items() if len(where) > 1 and not is_main(name)}
    num_checked = len(places)
    for parent in APART:
        for folder in sorted(p for p in (root / parent).glob("*") if p.is_dir()):
            own = collections.defaultdict(list)
            read(folder, own)
            num_checked += len(own)
            for name, where in own.items():
                where = places.get(name, []) + where
                if len(where) > 1 and not is_main(name):
                    twice[f"{name} ({parent}/{folder.name})"] = where
    for name, where in sorted(twice.items()):
        print(f"{name}: defined in {', '.join(where)}; the linker keeps one for all: rename one, or give it a namespace")
    print(f"{num_checked} definitions, {len(twice)} of them more than once")
    return 1 if twice or num_checked == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
