#!/usr/bin/env python3
"""Counts the instructions that a program for 64-bit ARM executes in functions of namespace cairn, in QEMU:

  count_instructions.py [--by-function] QEMU... PROGRAM ARGUMENT...

The last argument is how many times the program does its work: the count is that of once, less that of none.
QEMU logs each block of instructions when it translates it, and its address whenever it runs it."""

import collections
import os
import subprocess
import sys
import tempfile
import threading


def count(command):
    """Instructions executed, by the name of their function."""
    with tempfile.TemporaryDirectory() as folder:
        pipe = os.path.join(folder, "log")
        os.mkfifo(pipe)
        qemu = [command[0], "-d", "in_asm,exec,nochain", "-D", pipe, *command[1:]]
        runs = collections.Counter()
        lengths, names = {}, {}

        def read():
            address, length = None, 0
            with open(pipe, "rb") as log:
                for line in log:
                    if line.startswith(b"Trace"):
                        start = line.split(b"/", 2)[1]
                        runs[start] += 1
                        if start not in names:
                            names[start] = line.rsplit(b"] ", 1)[1].strip().decode()
                    elif line.startswith(b"0x"):
                        at = line[2:line.index(b":")].rjust(16, b"0")
                        if address is None:
                            address, length = at, 0
                        length += 1
                        lengths[address] = length
                    else:
                        address = None

        reader = threading.Thread(target=read)
        reader.start()
        subprocess.run(qemu, check=True, stdout=subprocess.DEVNULL)
        reader.join()
    by_function = collections.Counter()
    for start, num in runs.items():
        by_function[names[start]] += num * lengths[start]
    return by_function


def main():
    arguments = sys.argv[1:]
    by_function = "--by-function" in arguments
    command = [a for a in arguments if a != "--by-function"]
    once, none = count(command + ["1"]), count(command + ["0"])
    once.subtract(none)
    once = collections.Counter({name: num for name, num in once.items() if "5cairn" in name})  # as compilers spell it
    print(f"{sum(once.values()):,} instructions")
    if by_function:
        for name, num in once.most_common(20):
            print(f"{num:15,} {name}")


if __name__ == "__main__":
    main()
