#!/usr/bin/env python3
"""Would the tests notice?  Changes one operator or number of a room's sources at a time, runs the room's tests, and lists the changes
that no test noticed.

All changes are compiled at once, and chosen as the tests run (schemata.py); those that a constant expression or a template's argument
needs are compiled one by one.  A change is tried by the suites that come by it, the quickest first.

A survivor is a line whose meaning no test checks: write the test, or delete the line.  Changes that mean the same (a bound that is
never reached, a tie that cannot be) stand in rooms.toml with the reason, and are not drawn.

The checkout is left as it is; BUILD is a build folder of it in which the tests are built.  Exit codes: 0, as many were noticed as
rooms.toml says; 1, fewer; 2, something is wrong with the arguments or with the tests as they are.
"""

import argparse
import concurrent.futures
import contextlib
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
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tomllib

from changes import changes_of, is_listed
from schemata import schema_of

MEMORY_BYTES = 8 << 30
COMPILE_LIMIT_S = 1200
NO_SUCH_CHANGE = 97  # chosen.h
MAX_ATTEMPTS = 12  # to compile all that the compiler takes together
# A share of the changes is too few where the room's figure would give so few, or fewer, with less than this probability.
SIGNIFICANCE = 0.01


def unknown_entries(root, room, same):
    """Entries of changes that mean the same which no source has any more."""
    texts = {source: (root / source).read_text() for source in sources_of(root, room)}
    changes = [(change, texts[source]) for source in texts for change in changes_of(source, texts[source])]
    return [entry for entry in same if not any(is_listed(change, text, [entry]) for change, text in changes)]


def sources_of(root, room):
    return sorted(str(path.relative_to(root)) for path in (root / room).glob("*.cc"))


def is_at(change, place):
    """Whether a change is in a file, or on the lines of it that are named."""
    name, _, lines = place.partition(":")
    first, _, last = lines.partition("-")
    return pathlib.Path(change.file).name == name and (not lines or int(first) <= change.line + 1 <= int(last or first))


def give_up(message):
    print(message, file=sys.stderr)
    raise SystemExit(2)


def functions_of(objects):
    """The functions that objects define for others."""
    said = subprocess.run(["nm", "--defined-only", *map(str, objects)], capture_output=True, text=True, check=True).stdout
    return {line.split()[2] for line in said.splitlines() if line[17:19] == "T "}


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

    def together(self, sources):
        """The sources that one command compiles, of each such command."""
        groups = {}
        for source in sources:
            groups.setdefault(tuple(self.compile(source, "source", "object")), []).append(source)
        return list(groups.values())

    def precompile(self, source, folder):
        """Compiles the header that the compiler puts before `source` for what `compile` says; whatever compiles it after that has it."""
        command = self.commands[source.resolve()]
        if "-include" not in command or command[command.index("-include") + 1] in self.headers:
            return
        header = pathlib.Path(command[command.index("-include") + 1])
        to = folder / f"precompiled_{len(self.headers)}" / header.name
        to.parent.mkdir()
        to.write_text("\n".join(re.findall("^#include.*$", header.read_text(), re.MULTILINE)))
        command = self.compile(source, to, f"{to}.gch")
        place = command.index("-include")
        command[place : place + 2] = ["-x", "c++-header"]
        subprocess.run(command, cwd=self.folder, check=True, stdout=subprocess.DEVNULL)
        self.headers[str(header)] = str(to)

    def link(self, test, changed, to):
        """The command that links a test with objects that stand before its libraries: what they define is not taken from there."""
        said = subprocess.run(["ninja", "-t", "commands", test], cwd=self.folder, capture_output=True, text=True, check=True).stdout
        line = next(line for line in reversed(said.splitlines()) if f" -o {test} " in line)
        words = shlex.split(line)
        words = words[words.index("&&") + 1 :]
        words = words[: words.index("&&")] if "&&" in words else words
        place = words.index("-o")
        return words[:place] + ["-Wl,--allow-multiple-definition", *map(str, changed), "-o", str(to)] + words[place + 2 :]


@dataclasses.dataclass
class Suite:
    """Tests of one program that are run together."""
    program: pathlib.Path
    options: list
    cpu_s: float = 0
    wall_s: float = 0
    reached: bytes = b""

    def command(self):
        return [str(self.program), *self.options, "--gtest_brief=1", "--gtest_fail_fast"]


@dataclasses.dataclass(frozen=True)
class Done:
    code: int
    cpu_s: float
    wall_s: float


def run(command, folder, cpu_limit_s, wall_limit_s, env=None, errors=subprocess.DEVNULL):
    """Runs a command, and stops it, and what it started, where it takes longer."""
    def limits():
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(cpu_limit_s), math.ceil(cpu_limit_s) + 1))

    quiet, start = subprocess.DEVNULL, time.monotonic()
    child = subprocess.Popen(command, cwd=folder, env=env, stdin=quiet, stdout=quiet, stderr=errors, preexec_fn=limits, process_group=0)
    late = threading.Timer(wall_limit_s, lambda: os.killpg(child.pid, signal.SIGKILL))
    late.start()
    _, status, usage = os.wait4(child.pid, 0)
    late.cancel()
    child.returncode = os.waitstatus_to_exitcode(status)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child.pid, signal.SIGKILL)
    return Done(child.returncode, usage.ru_utime + usage.ru_stime, time.monotonic() - start)


class Room:
    """The sources of a room and its tests; changes are known by numbers from 1."""

    def __init__(self, root, build, tests, folder, texts, changes):
        self.root, self.build, self.tests, self.folder, self.texts = root, build, tests, folder, texts
        self.changes = changes
        self.suites = []
        self.alone = set()
        self.functions = set()
        self.num_noticed = {}  # by file and suite
        shutil.copy(pathlib.Path(__file__).with_name("chosen.h"), folder)
        for source in texts:
            build.precompile(root / source, folder)

    def compile(self, source, changed, to, *options):
        command = self.build.compile(self.root / source, changed, to)
        command = [word for word in command if not word.startswith("-W")] + ["-w", "-Wno-narrowing", *options]
        with open(f"{to}.errors", "w") as errors:
            code = run(command, self.build.folder, COMPILE_LIMIT_S, COMPILE_LIMIT_S, errors=errors).code
        return code, pathlib.Path(f"{to}.errors").read_text(errors="replace")

    def program(self, test, objects, label):
        # Beside the programs that tests start.
        to = self.build.folder / f"mutant_{os.getpid()}_{label}_{test}"
        done = run(self.build.link(test, objects, to), self.build.folder, COMPILE_LIMIT_S, COMPILE_LIMIT_S)
        return to if done.code == 0 else None

    def compile_schemata(self):
        """Of all sources together that are compiled alike; what the compiler does not take is left for later, one by one."""
        objects = []
        for number, group in enumerate(self.build.together([self.root / source for source in self.texts])):
            names = [str(source.relative_to(self.root)) for source in group]
            to, joined = self.folder / f"schema_{number}.o", self.folder / f"schema_{number}.cc"
            active = {k: change for k, change in self.changes.items() if change.file in names}
            for attempt in range(MAX_ATTEMPTS):
                parts = [f'#include "{self.folder / "chosen.h"}"\n']
                for name in names:
                    schema, lacking = schema_of(self.texts[name], {k: change for k, change in active.items() if change.file == name})
                    parts.append(f'#line 1 "{self.root / name}"\n{schema}\n')
                    for k in lacking:
                        self.alone.add(k)
                        active.pop(k)
                joined.write_text("".join(parts))
                code, said = self.compile(names[0], joined, to, "-fsyntax-only", "-fmax-errors=0")
                if code == 0:
                    code, said = self.compile(names[0], joined, to)
                    if code == 0:
                        break
                refused = self.refused(said, active)
                if not refused or attempt == MAX_ATTEMPTS - 1:
                    give_up(f"{names[0]} and those beside it cannot be compiled together:\n{said[:2000]}")
                self.alone |= refused
                for k in refused:
                    active.pop(k)
            objects.append(to)
        self.functions = functions_of(objects)
        return objects

    def refused(self, said, active):
        """The changes of lines with errors; where none is on such a line, of all that the compiler speaks of, and then near them."""
        places = {(file, int(line), kind) for file, line, kind in re.findall(r"^(/[^:\n]*):(\d+):\d+: +(\w+)", said, re.MULTILINE)}
        errors, all_kinds = ("error", "fatal"), {kind for _, _, kind in places}
        for kinds, near in ((errors, 0), (all_kinds, 0), (all_kinds, 3)):
            found = {k for k, change in active.items() for file, line, kind in places
                     if kind in kinds and file == str(self.root / change.file) and abs(line - 1 - change.line) <= near}
            if found:
                return found
        return set(active)

    def find_suites(self, objects):
        """Links and runs all tests once, as they are."""
        for test in self.tests:
            name, *options = test.split()
            program = next((suite.program for suite in self.suites if suite.program.name.endswith(f"_all_{name}")), None) or self.program(name, objects, "all")
            if program is None:
                give_up(f"{name}: cannot be linked with the changed sources")
            listed = subprocess.run([str(program), *options, "--gtest_list_tests"], cwd=self.build.folder, capture_output=True, text=True, check=False,
                                    timeout=60)
            if listed.returncode:
                give_up(f"its tests fail as they are: {program} --gtest_list_tests")
            suites = {}
            for line in listed.stdout.splitlines():
                if line.startswith("  "):
                    suites.setdefault(suite, []).append(suite + line.split()[0])
                else:
                    suite = line.split("#")[0].strip()
            known = [(suite.program, suite.options) for suite in self.suites]
            chosen = [["--gtest_filter=" + ":".join(names)] for names in suites.values()] or [options]
            self.suites += [Suite(program, each) for each in chosen if (program, each) not in known]
        file = self.folder / "reached"
        for suite in self.suites:
            file.write_bytes(bytes(max(self.changes) + 1))
            done = self.run_suite(suite.command(), 1200, 1200, {"CAIRN_REACHED": str(file)})
            suite.cpu_s, suite.wall_s = done.cpu_s, done.wall_s
            if done.code:
                give_up(f"its tests fail as they are: {' '.join(suite.command())}")
            suite.reached = file.read_bytes()

    def run_suite(self, command, cpu_limit_s, wall_limit_s, env):
        """With a folder of its own for its files."""
        with tempfile.TemporaryDirectory(dir=self.folder, ignore_cleanup_errors=True) as files:
            os.chmod(files, 0o755)  # tests become other users
            return run(command, self.build.folder, cpu_limit_s, wall_limit_s, {**os.environ, "TEST_TMPDIR": files, **env})

    def outcome(self, k, slot):
        """Of a change: "noticed", "survived", "not reached" or, where it does not compile, "broken"."""
        folder = self.folder / str(slot)
        folder.mkdir(exist_ok=True)
        programs, env = {}, {}
        suites = self.suites
        if k in self.alone:
            change = self.changes[k]
            changed, compiled = folder / pathlib.Path(change.file).name, folder / "changed.o"
            changed.write_text(change.applied(self.texts[change.file]))
            # One that has another signature is another function: the tests would have that of the library.
            if self.compile(change.file, changed, compiled)[0] or not functions_of([compiled]) <= self.functions:
                return "broken"
        else:
            env["CAIRN_CHANGE"] = str(k)
            suites = [suite for suite in suites if suite.reached[k]]
            if not suites:
                return "not reached"
        # The quickest first, and those that noticed other changes of the file.
        file = self.changes[k].file
        suites = sorted(suites, key=lambda suite: (0.05 + suite.cpu_s) / (1 + 4 * self.num_noticed.get((file, id(suite)), 0)))
        try:
            for suite in suites:
                program = suite.program
                if k in self.alone:
                    if program not in programs:
                        programs[program] = self.program(program.name.split("_all_")[1], [compiled], slot)
                    program = programs[program]
                    if program is None:
                        return "broken"
                code = self.run_suite([str(program), *suite.command()[1:]], 4 + 5 * suite.cpu_s, 60 + 20 * suite.wall_s, env).code
                if code == NO_SUCH_CHANGE:
                    return "broken"
                if code:
                    self.num_noticed[file, id(suite)] = self.num_noticed.get((file, id(suite)), 0) + 1
                    return "noticed"
            return "survived"
        finally:
            for program in programs.values():
                if program:
                    program.unlink()

    def remove_programs(self):
        for program in {suite.program for suite in self.suites}:
            program.unlink(missing_ok=True)


def tried(room, num, jobs):
    """How many of a room's changes were noticed, survived and did not compile; says which survived."""
    counts = {"noticed": 0, "survived": 0, "broken": 0}
    slots = queue.Queue()
    for slot in range(jobs):
        slots.put(slot)

    def outcome(k):
        slot = slots.get()
        try:
            return room.outcome(k, slot)
        finally:
            slots.put(slot)

    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        waiting, rest = {}, iter(room.changes)
        while True:
            while len(waiting) < jobs and counts["noticed"] + counts["survived"] + len(waiting) < num:
                if (k := next(rest, None)) is None:
                    break
                waiting[pool.submit(outcome, k)] = k
            if not waiting:
                return counts
            for done in concurrent.futures.wait(waiting, return_when=concurrent.futures.FIRST_COMPLETED).done:
                change, outcome_of = room.changes[waiting.pop(done)], done.result()
                counts["survived" if outcome_of == "not reached" else outcome_of] += 1
                if outcome_of in ("survived", "not reached"):
                    print(f"{outcome_of}: {change.said(room.texts[change.file])}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path, help="a build folder of this checkout")
    parser.add_argument("room", nargs="?", help="such as core/seal; none: lists the rooms and their figures")
    parser.add_argument("--num", type=int, default=100, help="changes to try [100]")
    parser.add_argument("--seed", help="of the draw, any text [the commit]")
    parser.add_argument("--share", action="store_true", help="a few changes of a room that the seed chooses: fails where significantly fewer are noticed")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="changes tried at once [all cores]")
    parser.add_argument("--files", nargs="+", default=[], help="of the room, these alone; with lines, a.cc:12 b.cc:7-9, only what is there")
    arguments = parser.parse_args()
    root = pathlib.Path(__file__).resolve().parents[2]
    rooms = tomllib.loads(pathlib.Path(__file__).with_name("rooms.toml").read_text())

    if arguments.seed is None:
        arguments.seed = commit_of(root)
    draw = random.Random(arguments.seed)
    if arguments.share:
        arguments.room = draw.choice(sorted(name for name in rooms if "noticed" in rooms[name]))
    if not arguments.room:
        for name, room in rooms.items():
            figure = f"{room['noticed']:3} %" if "noticed" in room else "not measured,"
            print(f"{name:32} {figure} by {' '.join(room['tests'])}")
        return 0
    if arguments.room not in rooms:
        print(f"{arguments.room}: not in {pathlib.Path(__file__).with_name('rooms.toml')}, which has {', '.join(rooms)}", file=sys.stderr)
        return 2
    entry = rooms[arguments.room]
    same = entry.get("same", [])
    for stale in unknown_entries(root, arguments.room, same):
        print(f"rooms.toml: {arguments.room}: no source has the change {stale}", file=sys.stderr)
        return 2

    texts = {source: (root / source).read_text() for source in sources_of(root, arguments.room)}
    changes = [change for source, text in texts.items() for change in changes_of(source, text)
               if not is_listed(change, text, same) and (not arguments.files or any(is_at(change, place) for place in arguments.files))]
    texts = {source: texts[source] for source in texts if any(change.file == source for change in changes)}
    draw.shuffle(changes)
    if not changes:
        print(f"{arguments.room}: nothing to change", file=sys.stderr)
        return 2
    print(f"{arguments.room}: {len(changes)} changes, {min(arguments.num, len(changes))} of them tried, seed {arguments.seed}", flush=True)
    # A few more, for those that do not compile.
    drawn = dict(enumerate(changes[: arguments.num * 4 // 3 + 4], 1))
    with tempfile.TemporaryDirectory(prefix="mutation_", dir=arguments.build) as folder:
        os.chmod(folder, 0o755)
        room = Room(root, Build(arguments.build.resolve()), entry["tests"], pathlib.Path(folder).resolve(), texts, drawn)
        try:
            room.find_suites(room.compile_schemata())
            print(f"{len(drawn) - len(room.alone)} compiled at once, {len(room.alone)} alone; {len(room.suites)} suites of tests, "
                  f"{sum(suite.wall_s for suite in room.suites):.0f} s", flush=True)
            counts = tried(room, arguments.num, arguments.jobs)
        finally:
            room.remove_programs()
    num, wanted = counts["noticed"] + counts["survived"], entry.get("noticed", 0)
    print(f"{arguments.room}: {counts['noticed']} of {num} changes noticed ({100 * counts['noticed'] / max(1, num):.0f} %; {wanted} % wanted), "
          f"{counts['broken']} did not compile")
    if arguments.share:
        return int(probability_of_at_most(counts["noticed"], num, wanted / 100) < SIGNIFICANCE)
    return int(counts["noticed"] < wanted / 100 * num)


if __name__ == "__main__":
    sys.exit(main())
