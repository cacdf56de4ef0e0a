#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Builds targets with ninja, and says the share that is done and about how long the rest takes.

  tools/build_progress.py FOLDER TARGET ...

A step counts by the bytes of the sources that it compiles. The time left follows from the steps that are done; where
a compiler cache serves many, it is too long at first.
"""
import os
import pathlib
import re
import subprocess
import sys
import time

STEP = re.compile(r"\[(\d+)/(\d+)\] (.*)")
LINK_BYTES = 2_000  # what a step counts that compiles nothing
UNIT_BYTES = 20_000  # what the headers of a unit count


def source_bytes(folder, text):
    """Bytes of the sources of an object, as ninja's description of the step names it."""
    words = re.search(r"CXX object (\S+?)/CMakeFiles/[^/]+\.dir/(\S+)\.o$", text)
    if not words:
        return 0
    unit = folder / words[1] / "CMakeFiles" / text.split("/CMakeFiles/")[1].split("/")[0] / words[2]
    if not unit.is_file():
        file = folder.parent / words[1] / words[2]
        return file.stat().st_size if file.is_file() else 0
    included = re.findall(r'#include "(.+?)"', unit.read_text())
    return sum(pathlib.Path(file).stat().st_size for file in included if pathlib.Path(file).is_file())


def weight(folder, text):
    return UNIT_BYTES + source_bytes(folder, text) if " CXX object " in text else LINK_BYTES


def in_words(seconds):
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


def main():
    folder, targets = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2:]
    ninja = ["ninja", "-C", str(folder)]
    environment = {**os.environ, "NINJA_STATUS": "[%f/%t] "}
    plan = subprocess.run([*ninja, "-n", *targets], capture_output=True, text=True, env=environment).stdout
    total = sum(weight(folder, step[3]) for step in map(STEP.match, plan.splitlines()) if step)
    on_screen = sys.stderr.isatty()
    begin, done = time.monotonic(), 0
    with subprocess.Popen([*ninja, *targets], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          env=environment) as build:
        for line in build.stdout:
            step = STEP.match(line)
            if not step:
                if not line.startswith("ninja: Entering"):
                    print(("\n" if on_screen else "") + line, end="", file=sys.stderr)
                continue
            done += weight(folder, step[3])
            share = min(1.0, done / total) if total else 1.0
            left = (time.monotonic() - begin) * (1 - share) / share
            rest = f", about {in_words(left)} left" if 0.05 < share < 1 else ""
            text = f"[{100 * share:3.0f} %{rest}] {step[3]}"
            if on_screen:
                print(f"\r\x1b[K{text[:100]}", end="", file=sys.stderr, flush=True)
            else:
                print(text, file=sys.stderr, flush=True)
    if on_screen and total:
        print(file=sys.stderr)
    sys.exit(build.returncode)


if __name__ == "__main__":
    main()
