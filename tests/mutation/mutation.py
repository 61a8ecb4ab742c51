#!/usr/bin/env python3
"""Would the tests notice?  Changes one operator or number of a room's sources at a time, compiles the changed source, links it into
the room's tests before the libraries, runs them, and lists the changes that no test noticed.

A survivor is a line whose meaning no test checks: write the test, or delete the line.  Changes that mean the same (a bound that is
never reached, a tie that cannot be) stand in rooms.toml with the reason, and are not drawn.

The checkout is left as it is; BUILD is a build folder of it in which the tests are built.  Exit codes: 0, as many were noticed as
rooms.toml says; 1, fewer; 2, something is wrong with the arguments or with the tests as they are.
"""

import argparse
import concurrent.futures
import dataclasses
import json
import math
import os
import pathlib
import queue
import random
import re
import resource
import shlex
import subprocess
import sys
import tempfile
import time
import tomllib

OPERATORS = (("<", "<="), ("<=", "<"), (">", ">="), (">=", ">"), ("==", "!="), ("!=", "=="), ("<", ">"), (">", "<"), ("+", "-"), ("-", "+"),
             ("*", "/"), ("/", "*"), ("&&", "||"), ("||", "&&"), ("+=", "-="), ("-=", "+="))
WORDS = (("true", "false"), ("false", "true"), ("std::min", "std::max"), ("std::max", "std::min"), ("continue;", "break;"),
         ("break;", "continue;"), ("std::less", "std::greater"), ("std::greater", "std::less"), ("++", "--"))
MEMORY_BYTES = 8 << 30
FILE_BYTES = 1 << 30
# A share of the changes is too few where the room's figure would give so few, or fewer, with less than this probability.
SIGNIFICANCE = 0.01


@dataclasses.dataclass(frozen=True)
class Change:
    file: str
    line: int  # from 0
    column: int
    old: str
    new: str

    def applied(self, text):
        lines = text.split("\n")
        line = lines[self.line]
        lines[self.line] = line[: self.column] + self.new + line[self.column + len(self.old) :]
        return "\n".join(lines)

    def said(self, text):
        return f"{self.file}:{self.line + 1}  {self.old} -> {self.new}   {text.split(chr(10))[self.line].strip()}"


def changes_of(file, text):
    """All changes of a source, in the order of its lines."""
    found, in_comment = [], False
    for number, line in enumerate(text.split("\n")):
        stripped = line.strip()
        if in_comment or stripped.startswith("/*"):
            in_comment = "*/" not in stripped
            continue
        # Of the same length, and nothing inside strings, characters and comments.
        code = re.sub(r'"(\\.|[^"\\])*"' + r"|'(\\.|[^'\\])'", lambda match: '"' + "_" * (len(match.group()) - 2) + '"', line).split("//")[0]
        if not code.strip() or stripped.startswith(("#", "template", "using ", "static_assert", "namespace")):
            continue
        for old, new in OPERATORS:
            found += [Change(file, number, match.start(), old, new) for match in re.finditer(rf"(?<=\s){re.escape(old)}(?=\s|$)", code)]
        for old, new in WORDS:
            end = r"(?!\w)" if old[-1].isalpha() else ""
            found += [Change(file, number, match.start(), old, new) for match in re.finditer(rf"(?<![\w:]){re.escape(old)}{end}", code)]
        for match in re.finditer(r"(?<![\w.])(\d+\.\d+|\d+)(?![\w.])", code):
            value = match.group()
            new = repr(float(value) * 1.5 + 0.1) if "." in value else str(int(value) + 1)
            found.append(Change(file, number, match.start(), value, new))
    return found


def is_listed(change, text, same):
    """Whether rooms.toml lists it as a change that means the same."""
    line = text.split("\n")[change.line].strip()
    return any(change.file.endswith("/" + entry["file"]) and line == entry["line"] and f"{change.old} -> {change.new}" == entry["change"]
               and entry.get("column") in (None, change.column) for entry in same)


def unknown_entries(root, room, same):
    """Entries of changes that mean the same which no source has any more."""
    texts = {source: (root / source).read_text() for source in sources_of(root, room)}
    changes = [(change, texts[source]) for source in texts for change in changes_of(source, texts[source])]
    return [entry for entry in same if not any(is_listed(change, text, [entry]) for change, text in changes)]


def sources_of(root, room):
    return sorted(str(path.relative_to(root)) for path in (root / room).glob("*.cc"))


def commit_of(root):
    said = subprocess.run(["git", "-C", str(root), "rev-parse", "HEAD"], capture_output=True, text=True, check=False)
    return said.stdout.strip() if said.returncode == 0 else "0"


def probability_of_at_most(num, num_all, ratio):
    return sum(math.comb(num_all, k) * ratio**k * (1 - ratio) ** (num_all - k) for k in range(num + 1))


class Build:
    """How a build folder compiles a source and links a test."""

    def __init__(self, folder):
        self.folder = folder
        self.commands = {}
        self.headers = {}
        for entry in json.loads((folder / "compile_commands.json").read_text()):
            text = entry["command"]
            command = shlex.split(text)
            if any(word.endswith("ccache") for word in command):
                command = command[next(i for i, word in enumerate(command) if word.endswith("ccache")) + 1 :]
            file = pathlib.Path(entry["file"])
            if "/Unity/" in entry["file"]:
                for source in re.findall(r'^#include "(.*)"$', file.read_text(), re.MULTILINE):
                    self.commands.setdefault(pathlib.Path(source).resolve(), command)
            else:
                self.commands.setdefault(file.resolve(), command)

    def compile(self, source, changed, to):
        """The command that compiles `changed` as if it were `source`, optimized less: half of the time is the optimizer's."""
        command = ["-O1" if word in ("-O2", "-O3") else word for word in self.commands[source.resolve()]]
        command[command.index("-o") + 1] = str(to)
        command[command.index("-c") + 1] = str(changed)
        if "-include" in command:
            place = command.index("-include") + 1
            command[place] = self.headers.get(command[place], command[place])
        for option in ("-MT", "-MF"):
            if option in command:
                command[command.index(option) + 1] = f"{to}.d"
        return command

    def precompile(self, source, folder):
        """Compiles the header that the compiler puts before `source` for what `compile` says; whatever compiles it after that has it."""
        command = self.commands[source.resolve()]
        if "-include" not in command or command[command.index("-include") + 1] in self.headers:
            return
        header = pathlib.Path(command[command.index("-include") + 1])
        to = folder / f"precompiled_{len(self.headers)}" / header.name
        to.parent.mkdir()
        to.write_text("\n".join(re.findall("^#include.*$", header.read_text(), re.MULTILINE)))
        compile = self.compile(source, to, f"{to}.gch")
        place = compile.index("-include")
        compile[place : place + 2] = ["-x", "c++-header"]
        subprocess.run(compile, cwd=self.folder, check=True, stdout=subprocess.DEVNULL)
        self.headers[str(header)] = str(to)

    def link(self, test, changed, to):
        """The command that links a test with an object that stands before its libraries: what it defines is not taken from there."""
        said = subprocess.run(["ninja", "-t", "commands", test], cwd=self.folder, capture_output=True, text=True, check=True).stdout
        line = next(line for line in reversed(said.splitlines()) if f" -o {test} " in line)
        words = shlex.split(line)
        words = words[words.index("&&") + 1 :]
        words = words[: words.index("&&")] if "&&" in words else words
        place = words.index("-o")
        return words[:place] + ["-Wl,--allow-multiple-definition", str(changed), "-o", str(to)] + words[place + 2 :]


class Room:
    """The sources of a room and its tests; `slots` of changes are tried at once."""

    def __init__(self, root, build, name, tests, num_slots, folder):
        self.root, self.build, self.name, self.tests = root, build, name, tests
        self.folder = folder
        self.slots = queue.Queue()
        for slot in range(num_slots):
            (self.folder / str(slot)).mkdir()
            self.slots.put(slot)
        for source in sources_of(root, name):
            build.precompile(root / source, folder)
        self.time_limit_s = {}

    def run(self, command, time_limit_s, env=None):
        def limits():
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
            resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_BYTES, FILE_BYTES))
            os.setpgid(0, 0)

        quiet = subprocess.DEVNULL
        child = subprocess.Popen(command, cwd=self.build.folder, env=env, stdin=quiet, stdout=quiet, stderr=quiet, preexec_fn=limits)
        try:
            return child.wait(time_limit_s)
        except subprocess.TimeoutExpired:
            os.killpg(child.pid, 9)
            child.wait()
            return -9

    def outcome(self, source, text):
        """Of a changed source: "noticed", "survived" or, where it does not compile, "broken"."""
        slot = self.slots.get()
        try:
            folder = self.folder / str(slot)
            changed, compiled = folder / pathlib.Path(source).name, folder / "changed.o"
            changed.write_text(text)
            if self.run(self.build.compile(self.root / source, changed, compiled), 600):
                return "broken"
            for test in self.tests:
                name, *options = test.split()
                # Beside the programs that tests start.
                program = self.build.folder / f"mutant_{os.getpid()}_{slot}_{name}"
                if self.run(self.build.link(name, compiled, program), 600):
                    return "broken"
                start = time.monotonic()
                code = self.run([str(program), *options, "--gtest_brief=1", "--gtest_fail_fast"], self.time_limit_s.get(test, 600),
                                {**os.environ, "TEST_TMPDIR": str(folder)})
                program.unlink()
                if code:
                    return "noticed"
                self.time_limit_s.setdefault(test, 30 + 4 * (time.monotonic() - start))
            return "survived"
        finally:
            self.slots.put(slot)


def tried(room, changes, num, jobs, texts):
    """How many of a room's changes were noticed, survived and did not compile; says which survived."""
    counts = {"noticed": 0, "survived": 0, "broken": 0}
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        waiting, rest = {}, iter(changes)
        while True:
            while len(waiting) < jobs and counts["noticed"] + counts["survived"] + len(waiting) < num:
                if (change := next(rest, None)) is None:
                    break
                waiting[pool.submit(room.outcome, change.file, change.applied(texts[change.file]))] = change
            if not waiting:
                return counts
            for done in concurrent.futures.wait(waiting, return_when=concurrent.futures.FIRST_COMPLETED).done:
                change, outcome = waiting.pop(done), done.result()
                counts[outcome] += 1
                if outcome == "survived":
                    print(f"survived {change.said(texts[change.file])}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path, help="a build folder of this checkout")
    parser.add_argument("room", nargs="?", help="such as core/seal; none: lists the rooms and their figures")
    parser.add_argument("--num", type=int, default=100, help="changes to try [100]")
    parser.add_argument("--seed", help="of the draw, any text [the commit]")
    parser.add_argument("--share", action="store_true", help="a few changes of a room that the seed chooses: fails where significantly fewer are noticed")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="changes tried at once [all cores]")
    parser.add_argument("--files", nargs="+", default=[], help="of the room, these alone")
    arguments = parser.parse_args()
    root = pathlib.Path(__file__).resolve().parents[2]
    rooms = tomllib.loads(pathlib.Path(__file__).with_name("rooms.toml").read_text())

    if arguments.seed is None:
        arguments.seed = commit_of(root)
    draw = random.Random(arguments.seed)
    if arguments.share:
        arguments.room = draw.choice(sorted(rooms))
    if not arguments.room:
        for name, room in rooms.items():
            print(f"{name:32} {room['noticed']:3} % by {' '.join(room['tests'])}")
        return 0
    if arguments.room not in rooms:
        print(f"{arguments.room}: not in {pathlib.Path(__file__).with_name('rooms.toml')}, which has {', '.join(rooms)}", file=sys.stderr)
        return 2
    entry = rooms[arguments.room]
    same = entry.get("same", [])
    for stale in unknown_entries(root, arguments.room, same):
        print(f"rooms.toml: {arguments.room}: no source has the change {stale}", file=sys.stderr)
        return 2

    sources = [source for source in sources_of(root, arguments.room) if not arguments.files or pathlib.Path(source).name in arguments.files]
    texts = {source: (root / source).read_text() for source in sources}
    changes = [change for source in sources for change in changes_of(source, texts[source]) if not is_listed(change, texts[source], same)]
    draw.shuffle(changes)
    with tempfile.TemporaryDirectory(prefix="mutation_", dir=arguments.build) as folder:
        room = Room(root, Build(arguments.build.resolve()), arguments.room, entry["tests"], arguments.jobs, pathlib.Path(folder).resolve())
        if not changes or room.outcome(sources[0], texts[sources[0]]) != "survived":
            print(f"{arguments.room}: {'nothing to change' if not changes else 'its tests fail as they are'}", file=sys.stderr)
            return 2
        print(f"{arguments.room}: {len(changes)} changes, {arguments.num} of them tried, seed {arguments.seed}", flush=True)
        counts = tried(room, changes, arguments.num, arguments.jobs, texts)
    num = counts["noticed"] + counts["survived"]
    print(f"{arguments.room}: {counts['noticed']} of {num} changes noticed ({100 * counts['noticed'] / max(1, num):.0f} %; {entry['noticed']} % wanted), "
          f"{counts['broken']} did not compile")
    if arguments.share:
        return int(probability_of_at_most(counts["noticed"], num, entry["noticed"] / 100) < SIGNIFICANCE)
    return int(counts["noticed"] < entry["noticed"] / 100 * num)


if __name__ == "__main__":
    sys.exit(main())
