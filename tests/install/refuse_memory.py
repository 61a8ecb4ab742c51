#!/usr/bin/env python3
"""A robot's program where requests for memory are refused: it says so by its code, and is not ended.

  refuse_memory.py LIBRARY PROGRAM ARGUMENT...

LIBRARY is tests/preloaded/fault_allocations.cc.  About NUM_FAULTS requests are refused, evenly, each alone and each with all that
follow; all of them where CAIRN_FAULTS_ALL is set."""

import collections
import os
import pathlib
import subprocess
import sys
import tempfile

NUM_FAULTS = 60
NO_MEMORY = 24  # CAIRN_NO_MEMORY
USAGE = 2  # of the example, which has no memory to read its own image


def main():
    library, *command = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        log = pathlib.Path(folder) / "log"

        def run(at, **more):
            environment = os.environ | {"LD_PRELOAD": library, "FAULT_LOG": str(log), "FAULT_AT": str(at)} | more
            return subprocess.run(command, env=environment, capture_output=True, text=True, errors="replace")

        whole = run(0)
        num_requests = int(log.read_text())
        assert whole.returncode == 0 and num_requests > 1000, whole
        step = 1 if os.environ.get("CAIRN_FAULTS_ALL") else max(1, num_requests // NUM_FAULTS)
        for more in ({}, {"FAULT_FROM": "1"}):
            ends = collections.Counter()
            for at in range(1, num_requests + 1, step):
                faulty = run(at, **more)
                ends[faulty.returncode] += 1
                what = f"request {at} of {num_requests} {more}: {faulty.returncode} {faulty.stderr}"
                if faulty.returncode == NO_MEMORY:
                    assert "out of memory" in faulty.stderr, what
                elif faulty.returncode == 0:  # there was another way
                    assert faulty.stdout == whole.stdout, what
                else:
                    assert faulty.returncode == USAGE and "usage" in faulty.stderr, what
            print(f"{num_requests} requests, {'all after one' if more else 'one'} refused: {dict(ends)}")
            assert ends[NO_MEMORY] > 0.9 * ends.total(), ends


if __name__ == "__main__":
    main()
