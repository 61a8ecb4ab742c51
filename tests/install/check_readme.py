#!/usr/bin/python3
"""The code that README.md, docs/robots.md and docs/active.md show is that of the examples, which the tests build and run.

check_readme.py SOURCES: every line of a c, cpp or python block between the marks "<!-- example: FILE -->" and the block's end
is a line of FILE, in its order.
"""
import re
import sys
from pathlib import Path

sources = Path(sys.argv[1])
num_blocks = 0
for page in ("README.md", "docs/robots.md", "docs/active.md"):
    text = (sources / page).read_text()
    for example, block in re.findall(r"<!-- example: (\S+) -->\n```\w+\n(.*?)```", text, re.S):
        lines = iter([" ".join(line.split()) for line in (sources / example).read_text().splitlines()])
        for line in block.splitlines():
            wanted = " ".join(line.split())
            if wanted and wanted not in lines:
                sys.exit(f"{page}: '{wanted}' is not, or not in this order, in {example}")
        num_blocks += 1
if num_blocks < 3:
    sys.exit(f"README.md and docs/robots.md have {num_blocks} marked examples; expected those in C, C++ and Python")
